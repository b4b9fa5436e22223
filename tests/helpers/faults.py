"""Commands that write, tried with a fault at each of their calls of the system.

Each trial begins with the same folder, in which every output is there already, from another
run. Judged is the folder afterwards: an output has its old bytes or all of the new ones.
"""

import errno
import json
import shutil
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from helpers.faulty_process import CALLS
from helpers.paths import ROOT

# The disk is full when the largest output has reached so many eighths of its size.
FULL_DISK = "disk full"
_EIGHTHS = 8
# Messages must fit a file of such a size, too.
_SMALLEST_LIMIT = 4096

MOVE = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 1.0\nWX1\n"
UNTIDY = "uu012500/1\nvel0  40.0\nacc0 0.25\nmri1 1.0\nwx1\n"
FIXABLE = "UU012500/1\nVELO 40.0\nACCO 0.25\nMRI1 1.0\nWX1\n"
OLD = b"the output of another run\n"
ERRORS = {
    "open to write": errno.EACCES, "open to read": errno.EIO, "write": errno.ENOSPC,
    "fsync": errno.EIO, "rename": errno.EIO, "mkdir": errno.ENOSPC, "unlink": errno.EIO,
    "chmod": errno.EPERM,
}  # fmt: skip
FAILURES = ("lost or torn", "exit 0, output missing", "traceback", "draft left")


@dataclass(frozen=True)
class Command:
    """A command line, the program it works on, and the outputs that it is to leave.

    Of `loose` outputs (with a date within) the bytes are not compared, only the size; what
    is a `drawing` may be missing after an exit with 0 if standard error says so.
    """

    args: str
    outputs: tuple[str, ...]
    program: str = MOVE
    loose: tuple[str, ...] = ()


COMMANDS = {
    "run, csv": Command("run P.CMD --force --emulate --out r.csv", ("r.csv",)),
    "run, npz": Command("run P.CMD --force --emulate --out r.npz", ("r.npz",)),
    "run, parquet": Command("run P.CMD --force --emulate --out r.parquet", ("r.parquet",)),
    "run, picture and page": Command(
        "run P.CMD --force --emulate --rate 200Hz --out r.csv --plot p.png --report r.html",
        ("r.csv", "p.png", "r.html"), loose=("r.html",),
    ),
    "measure, dat": Command("measure P.CMD --out m.dat", ("m.dat",)),
    "measure, csv": Command("measure P.CMD --out m.csv", ("m.csv",)),
    "fmt": Command("fmt P.CMD", ("P.CMD",), UNTIDY),
    "lint --fix": Command("lint --fix P.CMD", ("P.CMD",), FIXABLE),
    "limits": Command("limits --velocities 10 --plot l.svg", ("l.svg",), loose=("l.svg",)),
    "flash to a store": Command("flash-to-store MAIN", ("store/MAIN.CMD",)),
}  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """A command with the `number`-th call of a kind failing, and what came of it."""

    command: str
    call: str
    number: int
    code: int
    failures: tuple[str, ...]
    said: str


class Workplace:
    """A folder for the trials of one command, and the process that runs them."""

    def __init__(self, name, folder, process):
        self.name, self.command = name, COMMANDS[name]
        self._folder, self._process = Path(folder) / "work", process
        self._cache = Path(folder) / "cache"
        self.expected = self._clean()

    def _clean(self):
        """The outputs of a run without a fault; the second one finds a filled cache."""
        for _ in range(2):
            code, _, said = self._run(CALLS[0], 0)
            assert code in (0, 1), said
        self.code = code
        return {name: self._bytes(name) for name in self.command.outputs}

    def _bytes(self, name):
        path = self._folder / name
        return path.read_bytes() if path.is_file() else None

    def _before(self, name):
        return self.command.program.encode() if name == "P.CMD" else OLD

    def _run(self, call, number, limit=0):
        """Exit code, count of the calls, and standard error of one run in a fresh folder."""
        if self._cache.is_dir():
            shutil.rmtree(self._cache)
        if (self._folder / "cache").is_dir():
            shutil.move(self._folder / "cache", self._cache)
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir()
        if self._cache.is_dir():
            shutil.copytree(self._cache, self._folder / "cache")
        for name in {"P.CMD", *self.command.outputs}:
            (self._folder / name).parent.mkdir(exist_ok=True)
            (self._folder / name).write_bytes(self._before(name))
        asked = {
            "args": self.command.args.split(), "folder": str(self._folder), "call": call,
            "number": number, "errno": ERRORS.get(call, 0), "limit": limit,
        }  # fmt: skip
        print(json.dumps(asked), file=self._process.stdin, flush=True)
        told = json.loads(self._process.stdout.readline())
        return told["code"], told["called"], told["err"]

    def trial(self, call, number):
        """The trial, or None if there were fewer calls of this kind."""
        limit = 0
        if call == FULL_DISK:
            largest = max(map(len, self.expected.values()))
            limit = max(_SMALLEST_LIMIT, number * largest // _EIGHTHS)
            if number >= _EIGHTHS or limit >= largest:
                return None
        code, called, said = self._run(call, number, limit)
        if called < number and not limit:
            return None
        return Trial(self.name, call, number, code, tuple(self._failures(call, code, said)), said)

    def _failures(self, call, code, said):
        after = {name: self._bytes(name) for name in ("P.CMD", *self.command.outputs)}
        new = {name: self._is_new(name, content) for name, content in after.items()}
        if any(not new[n] and content != self._before(n) for n, content in after.items()):
            yield "lost or torn"
        if code == self.code and not all(new[name] for name in self.command.outputs):
            yield "exit 0, output missing"
        if "Traceback" in said or code < 0:
            yield "traceback"
        drafts = [p for p in self._folder.rglob(".*.mopro-*") if "cache" not in p.parts]
        if drafts and call != "unlink":
            yield "draft left"

    def _is_new(self, name, content):
        expected = self.expected.get(name)
        if content is None or expected is None:
            return False
        if name in self.command.loose:
            return abs(len(content) - len(expected)) < 100
        return content == expected


@contextmanager
def workplace(name, folder):
    """The workplace of the command `name`; its process ends with the block."""
    command = [sys.executable, "-B", str(Path(__file__).with_name("faulty_process.py"))]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield Workplace(name, folder, process)
        finally:
            process.stdin.close()
