"""Runs commands of mopro, each in a fork of its own, in which the n-th call of a kind fails.

    python tests/helpers/faulty_process.py

Reads a trial a line as JSON: `args`, `folder` (the working folder), `call`, `number`, `errno`,
`limit` (the most bytes that a file may have; 0 for no limit).
Writes one line for each: `code` (negative: the signal), `called` (how many calls there were of
this kind, and whether the fault came about), `out`, `err`. Calls are counted where they name a
file below the folder. Writing within libraries that are not Python meets only the limit.
"""

import builtins
import io
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from random import Random

import click

from mopro.cli import main
from mopro.cli.main import COMMANDS
from mopro.controller import FolderStore, LoopbackPort, Station
from mopro.emulator import Emulator
from mopro.link import Session, load_dialect
from mopro.link.flash import flash
from mopro.machine import load_machine
from mopro.program.compile import compile_file

LIMIT_S = 120
CALLS = ("open to write", "open to read", "write", "fsync", "rename", "mkdir", "unlink", "chmod")


class Faults:
    """Counts the calls of one kind and fails the `number`-th with `errno`; 0 fails none."""

    def __init__(self, folder, call, number, errno):
        self.folder = os.path.realpath(folder)
        self.call, self.number, self.errno = call, number, errno
        self.count = 0

    def meet(self, call, path):
        if call != self.call or not self._is_watched(path):
            return
        self.count += 1
        if self.count == self.number:
            named = () if isinstance(path, int) else (os.fsdecode(path),)
            raise OSError(self.errno, os.strerror(self.errno), *named)

    def _is_watched(self, path):
        if isinstance(path, int):
            path = f"/proc/self/fd/{path}"
        place = os.path.realpath(os.fsdecode(path))
        return place.startswith(self.folder + os.sep) or place == self.folder


class FaultyRaw(io.FileIO):
    """A file opened to be written, each of whose writes may fail."""

    def __init__(self, faults, path, mode, closefd, opener):
        super().__init__(path, mode, closefd, opener)
        self._faults, self._place = faults, f"/proc/self/fd/{self.fileno()}"

    def write(self, data):
        self._faults.meet("write", self._place)
        return super().write(data)


def install(faults):
    """Put `faults` before the calls of the system of this process."""
    real_open, real_low_open = io.open, os.open

    def low_open(path, flags, *args, **kwargs):
        writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        faults.meet("open to write" if writes else "open to read", path)
        return real_low_open(path, flags, *args, **kwargs)

    def faulty_open(
        file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, closefd=True,
        opener=None,
    ):  # fmt: skip
        writes = any(letter in mode for letter in "wxa+")
        if not isinstance(file, int):
            faults.meet("open to write" if writes else "open to read", file)
        if not writes:
            return real_open(file, mode, buffering, encoding, errors, newline, closefd, opener)
        raw = FaultyRaw(faults, file, mode.replace("b", "").replace("t", ""), closefd, opener)
        buffer = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        if "b" in mode:
            return raw if buffering == 0 else buffer
        return io.TextIOWrapper(buffer, encoding or "utf-8", errors, newline)

    def guarded(name, call):
        real = getattr(os, name)

        def faulty(path, *args, **kwargs):
            faults.meet(call, path)
            return real(path, *args, **kwargs)

        setattr(os, name, faulty)

    builtins.open = io.open = faulty_open
    os.open = low_open
    names = {
        "fsync": "fsync", "replace": "rename", "rename": "rename", "mkdir": "mkdir",
        "unlink": "unlink", "remove": "unlink", "chmod": "chmod", "utime": "chmod",
        "chown": "chmod",
    }  # fmt: skip
    for name, call in names.items():
        guarded(name, call)


@click.command()
@click.argument("name")
def command(name):
    """Flash P.CMD to a virtual controller that stores programs in the folder `store`."""
    dialect = load_dialect("checked")
    station = Station(dialect, Emulator(load_machine("chow1992")), FolderStore(Path("store")))
    session = Session(LoopbackPort(station), dialect, Random(1))
    session.give(60.0)
    session.open()
    flash(session, compile_file(Path("P.CMD")), name)


def child(trial, told, streams):
    """Run one trial, write what was counted to the descriptor `told`, and leave."""
    signal.alarm(LIMIT_S)
    os.chdir(trial["folder"])
    os.environ["XDG_CACHE_HOME"] = str(Path(trial["folder"]) / "cache")
    for number, stream in streams.items():
        os.dup2(stream.fileno(), number)
    faults = Faults(trial["folder"], trial["call"], trial["number"], trial["errno"])
    install(faults)
    if trial["limit"]:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (trial["limit"], resource.RLIM_INFINITY))
    code = 1
    try:
        sys.argv = ["mopro", *trial["args"]]
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        if sys.exc_info()[0] is not None:
            traceback.print_exc()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os.write(told, json.dumps(faults.count).encode())
        os._exit(code)


def done(trial):
    """The outcome of one trial in a fork of this process."""
    heard, told = os.pipe()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = os.fork()
        if process == 0:
            os.close(heard)
            child(trial, told, {1: out, 2: err})
        os.close(told)
        _, status = os.waitpid(process, 0)
        with os.fdopen(heard) as pipe:
            count = int(pipe.read() or "0")
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode("utf-8", "replace"))
    return {
        "code": os.waitstatus_to_exitcode(status), "called": count, "out": texts[0],
        "err": texts[1],
    }  # fmt: skip


def serve():
    COMMANDS["flash-to-store"] = "__main__"
    for line in sys.stdin:
        print(json.dumps(done(json.loads(line))), flush=True)


if __name__ == "__main__":
    serve()
