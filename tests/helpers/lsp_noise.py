"""Sessions of an editor that sends anything, to a `mopro lsp` of its own process."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from random import Random
from tempfile import NamedTemporaryFile, TemporaryFile

from helpers.commands import LIMIT_S, SETTINGS
from helpers.fuzzing.lines import LSP_WORDS, MESSAGES
from helpers.fuzzing.parser import changed

CODES = (0, 2)  # done; the input ended where no message begins
MOST_MB = 300.0
_LENGTH = re.compile(rb"Content-Length: (\d+)\r\n(?:[^\r\n]+\r\n)*\r\n")
_ENDS = ("asked to end", "cut off", "no length", "absurd length", "end of input")
_FILES = ("file:///dev/zero", "file:///", "file:///dev/stdin", "untitled:1", "http://[", "%00", "")


@dataclass(frozen=True)
class Session:
    """Result of a session; `failures` are in words."""

    seed: int
    messages: int
    said: Counter[str]
    code: int
    mb: float
    seconds: float
    failures: tuple[str, ...]


def framed(body: bytes) -> bytes:
    """A message with its header."""
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


def _body(random: Random) -> bytes:
    """A message in or out of its turn, a damaged one, one about another file, or a large one."""
    kind, body = random.randrange(6), random.choice(MESSAGES)
    if kind == 0:
        return changed(random, body, LSP_WORDS, 20_000) or b"{}"
    if kind == 1:
        return random.randbytes(random.randrange(1, 200))
    if kind == 2:
        return body.replace(b"file:///nowhere/a.CMD", random.choice(_FILES).encode())
    if kind == 3:
        return random.choice([b"[" * 5000, b"9" * 5000, b'{"jsonrpc": "2.0"}', b"[1]", b"null"])
    if kind == 4 and random.random() < 0.2:
        return body.replace(b"VEL0 0", b"VEL0 0\\n" * 100_000)
    return body


# A process begins with the memory of the one that it was forked from: a small one starts it.
_MEASURED = """
import resource, subprocess, sys
code = subprocess.call([sys.executable, "-m", "mopro", "lsp"])
with open(sys.argv[1], "w") as size:
    size.write(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
sys.exit(code)
"""


def noise(seed: int, most: int) -> tuple[int, bytes]:
    """The number of messages and the bytes of a session; it ends in one of five ways."""
    random = Random(f"editor {seed}")
    bodies = [*MESSAGES[:3], *(_body(random) for _ in range(random.randrange(most)))]
    data = b"".join(map(framed, bodies))
    end = random.choice(_ENDS)
    if end == "asked to end":
        exits = b'{"jsonrpc": "2.0", "method": "exit"}'
        data += framed(MESSAGES[-1]) + framed(exits)
    elif end == "cut off":
        data += framed(b"{}" * 50)[: random.randrange(1, 100)]
    elif end == "no length":
        data += random.choice([b"A: b\r\n\r\n", b"x" * 3000, b"Content-Length: -1\r\n\r\n"])
    elif end == "absurd length":
        data += b"Content-Length: 9999999999\r\n\r\n{}"
    return len(bodies), data


def session(seed: int, most: int = 40) -> Session:
    """Run the session of this seed, the same each time."""
    messages, data = noise(seed, most)
    began_s = time.monotonic()
    with (
        TemporaryFile() as sent,
        TemporaryFile() as out,
        TemporaryFile() as errors,
        NamedTemporaryFile("r") as size,
    ):
        sent.write(data)
        sent.seek(0)
        process = subprocess.run(
            [sys.executable, "-c", _MEASURED, size.name], stdin=sent, stdout=out, stderr=errors,
            env=os.environ | SETTINGS, check=False,
        )  # fmt: skip
        out.seek(0)
        errors.seek(0)
        said, told, kilobytes = out.read(), errors.read(), int(size.read())
    seconds, mb = time.monotonic() - began_s, kilobytes / 1024
    failures = ["a traceback"] if b"Traceback" in told else []
    failures += [] if process.returncode in CODES else [f"exit code {process.returncode}"]
    failures += ["too much memory"] if mb > MOST_MB else []
    failures += ["too long"] if seconds > LIMIT_S else []
    replies = Counter(map(_kind, _replies(said)))
    failures += ["no reply to initialize"] if not replies["results"] else []
    return Session(seed, messages, replies, process.returncode, mb, seconds, tuple(failures))


def _replies(said: bytes) -> list[dict[str, object]]:
    """The messages of the server; each has to be whole."""
    made, at = [], 0
    while match := _LENGTH.match(said, at):
        at = match.end() + int(match[1])
        made.append(json.loads(said[match.end() : at]))
    assert at == len(said), said[at : at + 200]
    return made


def _kind(reply: dict[str, object]) -> str:
    if "id" not in reply:
        return "notices"
    return "errors" if "error" in reply else "results"
