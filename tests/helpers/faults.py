"""Commands that write, tried with a fault at each of their calls of the system.

Each trial begins with the same folder, in which every output is there already, from another
run, unless the command overwrites no file. Judged is the folder afterwards: an output has its
old bytes or all of the new ones.
"""

import errno
import json
import shutil
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from helpers.faulty_process import CALLS
from helpers.paths import ROOT
from helpers.power_loss import read_changes

# The disk is full when the largest output has reached so many eighths of its size.
FULL_DISK = "disk full"
_EIGHTHS = 8
# Messages must fit a file of such a size, too.
_SMALLEST_LIMIT = 4096
# Memory beyond that of the start is limited to so many parts of what the command takes: first
# the half, then quarters, eighths, ..., so that any number of trials spreads over the whole.
LITTLE_MEMORY = "memory"
_PARTS = 64
KINDS = (*CALLS, FULL_DISK, LITTLE_MEMORY)

MOVE = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 1.0\nWX1\n"
UNTIDY = "uu012500/1\nvel0  40.0\nacc0 0.25\nmri1 1.0\nwx1\n"
FIXABLE = "UU012500/1\nVELO 40.0\nACCO 0.25\nMRI1 1.0\nWX1\n"
OLD = b"the output of another run\n"
ERRORS = {
    "open to write": errno.EACCES, "open to read": errno.EIO, "read": errno.EIO,
    "write": errno.ENOSPC, "fsync": errno.EIO, "rename": errno.EIO, "mkdir": errno.ENOSPC,
    "unlink": errno.EIO, "chmod": errno.EPERM,
}  # fmt: skip
FAILURES = ("lost or torn", "exit 0, output missing", "traceback", "draft left")

_DRAGGED = """\
name = "mine"
extends = "chow1992"

[effects.viscous_drag]
b = { value = 9.0, unit = "N s/m", origin = "assumed", place = "for a trial" }
"""
_EXPERIMENT = """\
machine = "chow1992"

[[sensor]]
kind = "encoder"

[[run]]
program = "P.CMD"
data = "pass.csv"
"""
_LOG = "time_s,command_in,position_in\n" + "".join(
    f"{i / 100:.2f},{min(i, 100) / 50:.3f},{min(max(i - 3, 0), 100) / 50:.3f}\n" for i in range(200)
)
_MEASURED = ("measure P.CMD --machine m.toml --instrument encoder --out pass.csv",)
_EXPERIMENT_FILES = {"P.CMD": MOVE, "m.toml": _DRAGGED, "experiment.toml": _EXPERIMENT}


@dataclass(frozen=True)
class Command:
    """A command line, the files it works on, and the outputs that it is to leave.

    Without `outputs`, those are all files that it changes or makes; they are there before if
    one of the commands in `before` made them. `fresh` outputs are not there before.
    Of `loose` outputs (with a date within) the bytes are not compared, only the size.
    `rewritten` ones have further versions, each whole: JSON that is added to, the recording of
    a run that was ended early. `growing` ones are written as things happen, and may end early
    if the command says that it failed.
    """

    args: str
    outputs: tuple[str, ...] = ()
    program: str = MOVE
    loose: tuple[str, ...] = ()
    files: dict[str, str] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    fresh: bool = False
    rewritten: tuple[str, ...] = ()
    growing: tuple[str, ...] = ()


COMMANDS = {
    "run, csv": Command("run P.CMD --force --emulate --out r.csv", ("r.csv",)),
    "run, npz": Command("run P.CMD --force --emulate --out r.npz", ("r.npz",)),
    "run, parquet": Command("run P.CMD --force --emulate --out r.parquet", ("r.parquet",)),
    "run, picture and page": Command(
        "run P.CMD --force --emulate --rate 200Hz --out r.csv --plot p.png --report r.html",
        ("r.csv", "p.png", "r.html"), loose=("r.html",),
    ),
    "run --port --trace": Command(
        "run P.CMD --force --port loopback --out r.csv --trace t.log", ("r.csv", "t.log"),
        growing=("t.log",), rewritten=("r.csv",),
    ),
    "measure, dat": Command("measure P.CMD --out m.dat", ("m.dat",)),
    "measure, csv": Command("measure P.CMD --out m.csv", ("m.csv",)),
    "fmt": Command("fmt P.CMD", ("P.CMD",), UNTIDY),
    "lint --fix": Command("lint --fix P.CMD", ("P.CMD",), FIXABLE),
    "sweep": Command(
        "sweep P.CMD --vary VEL1=10,20 --jobs 1 --out s.csv --picture s.png", ("s.csv", "s.png"),
        fresh=True, growing=("s.csv.rows",),
    ),
    "limits": Command("limits --velocities 10 --plot l.svg", ("l.svg",), loose=("l.svg",)),
    "flash to a store": Command("flash-to-store MAIN", ("store/MAIN.CMD",)),
    "compare": Command(
        "compare experiment.toml --apply m.toml --plot p.png --report r.html",
        ("p.png", "r.html"), loose=("r.html",), files=_EXPERIMENT_FILES, before=_MEASURED,
    ),
    "reconcile": Command(
        "reconcile experiment.toml --jobs 1 --only viscous_drag --out new.toml --report r.html",
        ("new.toml", "r.html"), loose=("r.html",), files=_EXPERIMENT_FILES, before=_MEASURED,
    ),
    "import": Command("import log.csv --as made", fresh=True, files={"log.csv": _LOG}),
    "init": Command("init made", fresh=True),
    "machine new": Command("machine new mine.toml", ("mine.toml",), fresh=True),
    "completion": Command(
        "completion bash --install --force", ("data/bash-completion/completions/mopro",)
    ),
    "blind make": Command(
        "blind make --seed 1 --grid smoke --cases 1 --out cases", rewritten=("cases/made.json",),
        before=("blind make --seed 2 --grid smoke --cases 1 --out cases",),
    ),
    "blind score": Command(
        "blind score cases --jobs 1 --report score.md", ("score.md", "cases/001/verdict.json"),
        before=("blind make --seed 1 --grid smoke --cases 1 --out cases",),
        rewritten=("cases/001/verdict.json",),
    ),
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
        self.before = self._made_before()
        self.expected = self._clean()

    def _made_before(self):
        """The files before each trial, by their paths: inputs, and outputs of another run."""
        self.before = {"P.CMD": self.command.program.encode()}
        self.before |= {name: text.encode() for name, text in self.command.files.items()}
        for args in self.command.before:
            answer = self._run(CALLS[0], 0, args=args)
            assert answer["code"] == 0, answer["err"]
            self.before = self._files()
        old = () if self.command.fresh else self.command.outputs
        return {**dict.fromkeys(old, OLD), **self.before}

    def _clean(self):
        """The files after a run without a fault; the second one finds a filled cache."""
        for _ in range(2):
            answer = self._run(CALLS[0], 0)
            assert answer["code"] == 0, answer["err"]
        self._peak = answer["peak"]
        after = self._files()
        changed = [n for n in after if after[n] != self.before.get(n)]
        self.outputs = self.command.outputs or tuple(changed)
        assert changed, "the command has an output"
        return after

    def _files(self):
        """The content of each file but those of the cache and drafts, by its path."""
        inside = {p.relative_to(self._folder): p for p in self._folder.rglob("*") if p.is_file()}
        return {
            name.as_posix(): path.read_bytes()
            for name, path in inside.items()
            if name.parts[0] != "cache" and ".mopro-" not in name.name
        }

    def _run(self, call, number, args=None, **limits):
        """The answer of the process to one run in a fresh folder."""
        self._renew_folder()
        asked = {
            "args": (args or self.command.args).split(), "folder": str(self._folder), "call": call,
            "number": number, "errno": ERRORS.get(call, 0), **limits,
        }  # fmt: skip
        print(json.dumps(asked), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def _renew_folder(self):
        if (self._folder / "cache").is_dir() and not self._cache.is_dir():
            shutil.move(self._folder / "cache", self._cache)
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir()
        if self._cache.is_dir():
            shutil.copytree(self._cache, self._folder / "cache")
        for name, content in self.before.items():
            (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self._folder / name).write_bytes(content)

    def trial(self, call, number):
        """The trial, or None if there were fewer calls of this kind."""
        limits = self._limits(call, number)
        if limits is None:
            return None
        answer = self._run(call, number, **limits)
        if answer["called"] < number and not limits:
            return None
        code, said = answer["code"], answer["err"]
        return Trial(self.name, call, number, code, tuple(self._failures(call, code, said)), said)

    def changes(self):
        """The start and the changes of the folder in a run without a fault."""
        record = self._cache.with_name("changes")
        answer = self._run(CALLS[0], 0, record=str(record))
        assert answer["code"] == 0, answer["err"]
        return read_changes(record)

    def _limits(self, call, number):
        """The limits of the `number`-th trial of a kind, by their names; None if there is none."""
        if call == FULL_DISK:
            largest = max(len(self.expected[name]) for name in self.outputs)
            limit = max(_SMALLEST_LIMIT, number * largest // _EIGHTHS)
            return None if number >= _EIGHTHS or limit >= largest else {"limit": limit}
        if call == LITTLE_MEMORY:
            return None if number >= _PARTS else {"memory": int(_spread(number) * self._peak)}
        return {}

    def _failures(self, call, code, said):
        after = self._files()
        if any(self._is_torn(name, after.get(name)) for name in {*self.before, *after}):
            yield "lost or torn"
        if code == 0 and not all(self._is_new(name, after.get(name)) for name in self.outputs):
            yield "exit 0, output missing"
        if "Traceback" in said or code < 0:
            yield "traceback"
        drafts = [p for p in self._folder.rglob(".*.mopro-*") if "cache" not in p.parts]
        if drafts and call != "unlink":
            yield "draft left"

    def _is_torn(self, name, content):
        """True for a file that is neither as before nor as after a run without a fault."""
        if content == self.before.get(name) or self._is_new(name, content):
            return False
        if name in self.command.rewritten and content is not None:
            return not _is_whole(name, content)
        return name not in self.command.growing

    def _is_new(self, name, content):
        expected = self.expected.get(name)
        if name in self.command.loose and content is not None:
            return abs(len(content) - len(expected)) < 100
        return content == expected


def _spread(number):
    """The `number`-th of 1/2, 1/4, 3/4, 1/8, 5/8, 3/8, ... (its binary digits mirrored)."""
    digits = f"{number:b}"
    return int(digits[::-1], 2) / 2 ** len(digits)


def _is_whole(name, content):
    """True for JSON that can be read, and for a table without a half row."""
    if name.endswith(".csv"):
        rows = content.split(b"\n")
        return rows.pop() == b"" and len({row.count(b",") for row in rows if row[:1] != b"#"}) == 1
    try:
        json.loads(content)
    except ValueError:
        return False
    return True


@contextmanager
def workplace(name, folder):
    """The workplace of the command `name`; its process ends with the block."""
    command = [sys.executable, "-B", "-m", "helpers.faulty_process"]
    with subprocess.Popen(
        command, cwd=ROOT / "tests", stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield Workplace(name, folder, process)
        finally:
            process.stdin.close()
