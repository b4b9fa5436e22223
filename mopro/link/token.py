"""The token of a TCP link to a virtual controller: how it is stated and refused.

The client says `MOPRO TOKEN ...` in its first line; an end that wants none passes over that
line. The client speaks first because what comes while a port is being opened may be lost. One
that is turned away is told why in a line that begins with NOTICE. Nothing is encrypted.
"""

from __future__ import annotations

VARIABLE = "MOPRO_TOKEN"  # of the environment, at both ends
STATEMENT = b"MOPRO TOKEN "
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


def statement(token: str) -> bytes:
    """The client's first line."""
    return STATEMENT + token.encode("ascii") + b"\r\n"
