"""Backlash of hobby servos that hold a target while two others pull them left and right.

python examples/servo_backlash.py FOLDER, with the measured set `servo_backlash_sts3215`: what
examples/servo/ does by files, by mopro.reconcile and a model in Python. The base model stays at
its target.
"""

import sys
from pathlib import Path

import numpy as np
from common import columns, cross_test, diagnose, effect, getter, moves

from mopro.engine import Candidate, Parameter, Role, Series

SINGLE = [("single_sts3215", "dut")]
PAIR = [("coupled_sts3215_no_offset", dut) for dut in ("dut1", "dut2")]
REACH = Parameter("w", "count of pull", 5, 400, (30.0, 150.0), role=Role.SHAPE)
EFFECTS = [
    effect("compliance", "c", "count/count", -1, 1, 0.01),
    effect("backlash", "play", "count", 0, 60, 5.0),
    Candidate("dry friction", (Parameter("f", "count", 0, 60, (3.0,)), REACH)),
    effect("hardening", "c3", "count/count^3", -1e-4, 1e-4, 1e-8),
    effect("creep", "rate", "count/s", -1, 1, 0.01),
]


def friction(pull, reach):
    """Dry friction as a share of its limit: it follows the pull until it slides."""
    state = [0.0]
    for step in np.diff(pull):
        state.append(min(max(state[-1] + step / reach, -1.0), 1.0))
    return np.array(state)


def experiment(folder, servos):
    """Model and data of servos."""
    known, data = [], []
    for file, servo in servos:
        names = (f"{servo}_target", f"{servo}_position", "pullA_position", "pullB_position")
        wanted = ("time_s", *(f"{name}_count" for name in names))
        t, target, position, a, b = columns(folder / f"{file}.csv", *wanted)
        changed = np.maximum.accumulate(np.where(np.diff(target, prepend=0) != 0, t, 0.0))
        hold = (target == 2047) & (t - changed > 1.0)
        side = 1 if servo == "dut2" else -1  # the second of a pair is turned round
        pull, t, position = side * (a + b - 1747 - 2347)[hold], t[hold], position[hold]
        strong = np.where(np.abs(pull) > 60, np.sign(pull), 0)
        last = strong[np.maximum.accumulate(np.where(strong != 0, np.arange(len(t)), 0))]
        known.append((t, pull, last))
        data.append(Series(file, servo, "count", position, None, t, moves(t)))

    def simulate(settings):
        of, reach = getter(settings), settings.get("dry friction", {"w": 1.0})["w"]
        for t, pull, last in known:
            elastic = of("compliance", "c") * pull + of("hardening", "c3") * pull**3
            lost = of("backlash", "play") / 2 * last - of("dry friction", "f") * friction(
                pull, reach
            )
            yield 2047 + elastic + lost + of("creep", "rate") * t

    return lambda settings: list(simulate(settings)), data


def main(folder):
    known = {"backlash play": 7.03}  # by the makers, in counts
    verdict = diagnose("single", experiment(folder, SINGLE), EFFECTS, documented=known)
    cross_test(verdict, experiment(folder, PAIR))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
