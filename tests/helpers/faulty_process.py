"""Runs commands of mopro, each in a fork of its own, in which the n-th call of a kind fails.

    cd tests && python -m helpers.faulty_process

Reads a trial a line as JSON: `args`, `folder` (the working folder), `call`, `number`, `errno`,
`limit` (the most bytes that a file may have, if there is a limit), `memory` (the most bytes
beyond those that the process has at its start), `record` (a file for the changes of the
folder, in the place of a fault).
Writes one line for each: `code` (negative: the signal), `called` (how many calls there were of
this kind), `peak` (bytes of memory, beyond those at the start), `out`, `err`. Calls are counted
where they name a file below the folder. Writing within libraries that are not Python meets only
the limit.
"""

import builtins
import faulthandler
import importlib
import io
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
from functools import partial
from pathlib import Path
from random import Random
from unittest.mock import patch

import click

import mopro.link
from helpers.power_loss import Recorder
from mopro.blind.scoring.verdict_source import VerdictSource
from mopro.cli import main
from mopro.cli.main import COMMANDS
from mopro.controller import FolderStore, LoopbackPort, MemoryStore, Station
from mopro.emulator import Emulator
from mopro.link import Session, load_dialect
from mopro.link.flash import flash
from mopro.machine import load_machine
from mopro.program.compile import compile_file

LIMIT_S = 60
# What a command needs that takes long to load: loaded once, before the first fork.
_DRAWING = ["mopro.recording.shown_figure", "matplotlib.backends.backend_agg"]
NEEDED = {
    "import": ["mopro.importing"],
    "compare": ["mopro.experiment.opened", "mopro.viewer.comparison", *_DRAWING],
    "reconcile": ["mopro.experiment.opened", "mopro.viewer.conclusion", *_DRAWING],
}
# That of this process, if changes are recorded.
RECORDERS = []
PROPOSED = "UU012500/1\nVEL1 8.0\nACC1 0.25\nMRI1 2.0\nWX1\n"
CALLS = (
    "open to write", "open to read", "read", "write", "fsync", "rename", "mkdir", "unlink", "chmod",
)  # fmt: skip


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
    """A file each of whose reads and writes may fail."""

    def __init__(self, faults, path, mode, closefd, opener):
        super().__init__(path, mode, closefd, opener)
        self._faults, self._place = faults, f"/proc/self/fd/{self.fileno()}"

    def write(self, data):
        self._faults.meet("write", self._place)
        return super().write(data)

    def readinto(self, buffer):
        self._faults.meet("read", self._place)
        return super().readinto(buffer)

    def readall(self):
        self._faults.meet("read", self._place)
        return super().readall()

    def read(self, size=-1):
        self._faults.meet("read", self._place)
        return super().read(size)


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
        if isinstance(file, int) and not writes:
            return real_open(file, mode, buffering, encoding, errors, newline, closefd, opener)
        path = file if isinstance(file, int) else os.fspath(file)
        raw = FaultyRaw(faults, path, mode.replace("b", "").replace("t", ""), closefd, opener)
        kind = io.BufferedWriter if writes else io.BufferedReader
        buffer = io.BufferedRandom(raw) if "+" in mode else kind(raw)
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
    if RECORDERS:
        _note_replies(station.device, RECORDERS[0])
    session = Session(LoopbackPort(station), dialect, Random(1))
    session.give(60.0)
    session.open()
    flash(session, compile_file(Path("P.CMD")), name)


def _note_replies(device, recorder):
    """Have it noted that success is told whenever the controller has done a statement."""
    do = device.do

    def noted(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        recorder.told()
        return rows

    device.do = noted


def child(trial, told, streams):
    """Run one trial, write what was counted to the descriptor `told`, and leave."""
    faulthandler.register(signal.SIGALRM, chain=True)  # where it hangs, then the end
    signal.alarm(LIMIT_S)
    os.chdir(trial["folder"])
    os.environ["XDG_CACHE_HOME"] = str(Path(trial["folder"]) / "cache")
    os.environ["XDG_DATA_HOME"] = str(Path(trial["folder"]) / "data")
    for number, stream in streams.items():
        os.dup2(stream.fileno(), number)
    faults = Faults(trial["folder"], trial["call"], trial["number"], trial["errno"])
    if "record" in trial:
        RECORDERS.append(Recorder(trial["folder"]))
    install(RECORDERS[0] if RECORDERS else faults)
    if "limit" in trial:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (trial["limit"], resource.RLIM_INFINITY))
    start = memory("VmSize")
    if "memory" in trial:
        resource.setrlimit(resource.RLIMIT_AS, (start + trial["memory"], resource.RLIM_INFINITY))
    code = 1
    try:
        sys.argv = ["mopro", *trial["args"]]
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        if sys.exc_info()[0] is not None:
            traceback.print_exc()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        if RECORDERS:
            RECORDERS[0].save(trial["record"], code == 0)
        peak = memory("VmPeak") - start
        os.write(told, json.dumps({"called": faults.count, "peak": peak}).encode())
        os._exit(code)


def memory(name):
    """The memory of this process in bytes, of the kind that /proc calls `name`."""
    with open("/proc/self/status", encoding="ascii") as file:
        line = next(line for line in file if line.startswith(f"{name}:"))
    return int(line.split()[1]) * 1024


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
            counts = json.loads(pipe.read() or '{"called": 0, "peak": 0}')
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode("utf-8", "replace"))
    code = os.waitstatus_to_exitcode(status)
    return {"code": code, **counts, "out": texts[0], "err": texts[1]}


def loopback(url, line, baud, token):
    """A port with a virtual controller behind it, in simulated time."""
    station = Station(load_dialect("checked"), Emulator(load_machine("chow1992")), MemoryStore())
    return LoopbackPort(station)


def reconciled(source, experiment, without, out=None):
    """The answer that `mopro reconcile` gives to every case at once; it proposes an experiment."""
    return {
        "verdict": "ambiguous", "effects": [], "next_experiment": PROPOSED, "seconds": 1.0,
        "exit_code": 0, "stderr": "",
    }  # fmt: skip


def serve():
    COMMANDS["flash-to-store"] = "__main__:command"
    # Patches refuse a name that is not there.
    patch.object(mopro.link, "SerialPort", loopback).start()
    patch.object(mopro.link, "Session", partial(Session, random=Random(1))).start()
    patch.object(VerdictSource, "_reconciled", reconciled).start()
    for line in sys.stdin:
        trial = json.loads(line)
        for module in NEEDED.get(trial["args"][0], []):
            importlib.import_module(module)
        print(json.dumps(done(trial)), flush=True)


if __name__ == "__main__":
    serve()
