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

FORCE_N, SIGMA_N = 111.2, 6.0
# A move that a well damped motor follows with any force above one, and with none below.
HARD = "UU012500/1\nVEL1 60.0\nACC1 1.7 ; as fast as it goes\nMRI1 3.0\nWX1\n"


def uncertain_text(low=FORCE_N - 1.959964 * SIGMA_N, high=FORCE_N + 1.959964 * SIGMA_N, top=""):
    """A well damped machine whose force is known to an interval of 95 %."""
    place = f"pull.toml, 95 %: {low!r} to {high!r}; or backlash"
    return (
        f'{top}extends = "chow1992"\n[axis]\n'
        'damping_ratio = { value = 0.4, unit = "1", origin = "assumed" }\n'
        f'pull_out_force = {{ value = {FORCE_N}, unit = "N", origin = "measured", '
        f'place = "{place}" }}\n'
    )


def least_force_N(base, low=30.0, high=300.0, **vary):
    """The force of a motor, known without a doubt, below which it stalls."""

    def stalls(force_N):
        varied = {**vary, "axis.pull_out_force": [force_N]}
        (row,) = Sweep.of(base, varied.items(), Design()).run(local(1)).to_pylist()
        return row["outcome"] == "stalled"

    assert stalls(low)
    assert not stalls(high)
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (middle, high) if stalls(middle) else (low, middle)
    return high


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
