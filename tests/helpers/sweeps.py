"""A small sweep, whose runs take a millisecond each, and executors that fail as planned."""

import os
import signal
import sys
from pathlib import Path

import mopro
from mopro.machine import load_machine
from mopro.sweeps import Sweep
from mopro.sweeps.designs import Design
from mopro.sweeps.executors import local
from mopro.sweeps.targets import Variant

TEXT = "UU012500/1\nVEL1 10.0\nACC1 0.5\nMRI1 0.2\nWX1\n"
VARY = {"VEL1": "10:60:5", "ACC1": "0.5,1,3", "payload": "0,5lb"}


def small_sweep(vary=VARY, text=TEXT, machine="chow1992"):
    base = Variant(mopro.compile(text, "P.CMD"), load_machine(machine), 0.0)
    return Sweep.of(base, vary.items(), Design())


class Ended(Exception):
    """What an executor raises that was told to."""


def counting(points, after=None, end=None):
    """One process that writes to `points` what it does; `end` is called `after` so many chunks."""

    def run(function, chunks):
        if after == 0:
            end()
        for number, chunk in enumerate(chunks, start=1):
            points.extend(task.point for task in chunk.tasks)
            yield from local(1)(function, [chunk])
            if number == after:
                end()

    return run


def twice(function, chunks):
    """One process that gives each result twice, the later chunks first."""
    for rows in reversed([function(chunk) for chunk in chunks]):
        yield rows
        yield rows


def kill_itself():
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    small_sweep().run(counting([], 20, kill_itself), out=Path(sys.argv[1]))
