"""The token of a TCP link to a virtual controller: how it is asked for, stated and refused.

The controller sends PROMPT to whoever connects, and takes one line as the answer. A client
that it turns away is told why in a line that begins with NOTICE. Nothing is encrypted.
"""

from __future__ import annotations

VARIABLE = "MOPRO_TOKEN"  # of the environment, at both ends
PROMPT = b"MOPRO TOKEN?\r\n"
NOTICE = b"mopro serve: "
SHORTEST, LONGEST = 16, 128


def checked(token: str | None) -> str | None:
    """The token, None without one; ValueError if it cannot be one."""
    if not token:
        return None
    fits = SHORTEST <= len(token) <= LONGEST
    if not (fits and token.isascii() and token.isprintable() and " " not in token):
        bounds = f"{SHORTEST} to {LONGEST} printable ASCII characters"
        raise ValueError(f"{VARIABLE} must have {bounds}, without blanks")
    return token
