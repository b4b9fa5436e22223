"""Backlash of a hobby servo: position of a servo that holds while two others pull it about.

python examples/servo_backlash.py FOLDER, with the files of the measured set
`servo_backlash_sts3215` in FOLDER. The base model holds its target; listed effects are
compliance, backlash (the last side pulled to decides), dry friction and creep.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from mopro.diagnosis import Candidate, Parameter, Series, reconcile

RELAXED = {"A": 1747.0, "B": 2347.0}
EFFECTS = [
    Candidate("compliance", (Parameter("c", "count/count", -2, 2, (0.02,)),)),
    Candidate("backlash", (Parameter("b", "count", -60, 60, (3.0,)),)),
    Candidate("creep", (Parameter("r", "count/s", -5, 5, (0.01,)),)),
]


def read(path, servo, relaxed=RELAXED):
    """Times, positions of `servo` and the pull (counts that the pullers are off their rest)."""
    with path.open() as lines:
        rows = [r for r in csv.DictReader(lines) if r[f"{servo}_position_count"] and r["pullA_position_count"] and r["pullB_position_count"]]
    t, x, a, b = (np.array([float(r[k]) for r in rows]) for k in (
        "time_s", f"{servo}_position_count", "pullA_position_count", "pullB_position_count"))
    pull = (a - relaxed["A"]) + (b - relaxed["B"])
    target = np.array([float(r[f"{servo}_target_count"]) for r in rows])
    changed = np.maximum.accumulate(np.where(np.diff(target, prepend=target[0]) != 0, t, 0.0))
    hold = (np.abs(target - 2047) < 1) & (t - changed > 1.0)
    t, x, pull = t[hold], x[hold], pull[hold]
    return t, x, pull


def side(pull, threshold=60):
    """The side (+1, -1; 0 before the first) that was last pulled to."""
    sign = np.where(np.abs(pull) > threshold, np.sign(pull), 0)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), -1))
    return np.where(last >= 0, sign[last], 0.0)


def diagnose(path, servo, relaxed=RELAXED):
    t, x, pull = read(path, servo, relaxed)

    def simulate(settings):
        model = np.zeros(len(t))
        model += settings.get("compliance", {}).get("c", 0.0) * pull
        model += settings.get("backlash", {}).get("b", 0.0) * side(pull)
        model += settings.get("creep", {}).get("r", 0.0) * t
        return [model]

    folds = np.minimum((8 * (t - t[0]) / (t[-1] - t[0])).astype(int), 7)
    data = [Series(path.stem, "encoder", "count", x, None, t, folds)]
    return reconcile(simulate, EFFECTS, data)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for name, servos in {"single_sts3215": ["dut"], "coupled_sts3215_no_offset": ["dut1", "dut2"], "coupled_sts3215_home_offset": ["dut1", "dut2"],
                         "coupled_sts3215_pgain_zero_deadband": ["dut1", "dut2"], "single_sts3250": ["dut"]}.items():
        for servo in servos:
            relaxed = {"A": 2347.0, "B": 1747.0} if "3250" in name else RELAXED
            v = diagnose(folder / f"{name}.csv", servo, relaxed)
            print(name, servo, v.verdict, [(e.name, {k: (round(p.value, 3), [round(c, 3) for c in p.ci95]) for k, p in e.parameters.items()}, e.held_out, e.indistinguishable_from) for e in v.effects],
                  "gap", round(v.gap.before_rms, 2), round(v.gap.after_rms, 2), v.gap.held_out_rms and round(v.gap.held_out_rms, 2), v.notes, [d.law for d in v.drafts], v.remainder.description, v.alternatives, [(r.name, r.reason[:40]) for r in v.rejected])
