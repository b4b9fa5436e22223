"""Periodic error of a telescope's worm gear, found behind the corrections of an autoguider.

python examples/telescope_worm.py FOLDER, with the measured set `telescope_worm_periodic_error`.
The base model tracks perfectly and drifts; what the guider has corrected so far is known.
"""

import sys
from pathlib import Path

import numpy as np
from common import columns, cross_test, diagnose, effect, getter, moves

from mopro.diagnosis import Candidate, Parameter, Role, Series

PERIODS = {"astrophysics_run_a": 382.95, "losmandy_g11_gemini": 239.34}  # of the worm, s


S, C, S2, C2, Q2, Q3 = (
    Parameter(name, "arcsec", -99, 99, (1.0,)) for name in ("s", "c", "s2", "c2", "q2", "q3")
)
DRIFT = Parameter("offset", "arcsec", -99, 99, (0,)), Parameter("rate", "arcsec/s", -1, 1, (0,))


def line(name, shortest, longest, *harmonic, **form):
    """A candidate of a free period (s), which a periodogram of the residual finds."""

    def strongest(view):
        (series,), (left,) = view.data, view.residuals
        step = 0.2 / np.ptp(series.time_s)
        tried = np.arange(max(1 / longest, 10 * step), 1 / shortest, step)
        waves = np.exp(2j * np.pi * np.outer(tried, series.time_s)) @ left
        best = np.argmax(np.abs(waves))
        size = 2 * view.sigmas[0] / len(left) * waves[best]
        yield {"P": 1 / tried[best], "s": size.imag, "c": size.real, "s2": 0.0, "c2": 0.0}

    period = Parameter("P", "s", shortest, longest, role=Role.SHAPE, inverse=True, difference=1e-5)
    return Candidate(name, (period, S, C, *harmonic), find_starts=strongest, **form)


EFFECTS = [
    line("worm", 150, 1500),
    line("worm", 150, 1500, S2, C2, form="2nd harmonic", extends=""),
    line("spur gear", 20, 150),
    Candidate("bending drift", (Q2, Q3)),
    effect("guide rate", "k", "1", -0.3, 0.3, 0.05),
    effect("backlash", "b", "arcsec", -9, 9, 0.5),
]


def experiment(folder, file, axis="ra", part=(0, 1), bend_s=None):
    """Model and data of a part of a run; `bend_s`: the drift may bend each so many seconds."""
    names = (f"{axis}_residual_arcsec", f"{axis}_correction_arcsec")
    t, left, sent = columns(folder / f"{file}.csv", "time_s", *names)
    corrected, share = np.cumsum(sent) - sent, t / t[-1]
    before = np.append(0.0, sent[:-1])
    last = np.sign(before)[np.maximum.accumulate(np.where(before != 0, np.arange(len(t)), 0))]
    own = (part[0] <= share) & (share <= part[1])

    def simulate(settings):
        of = getter(settings)
        star = of("base", "offset") + of("base", "rate") * t + of("backlash", "b") * last
        for name in ("worm", "spur gear"):
            w = 2 * np.pi * t / (of(name, "P") or 1.0)
            star += of(name, "s") * np.sin(w) + of(name, "c") * np.cos(w)
            star += of(name, "s2") * np.sin(2 * w) + of(name, "c2") * np.cos(2 * w)
        star += of("bending drift", "q2") * share**2 + of("bending drift", "q3") * share**3
        return [(star - (1 + of("guide rate", "k")) * corrected)[own]]

    knots = np.arange(0, t[-1] + bend_s, bend_s) if bend_s else np.zeros(0)
    bends = np.maximum(1 - np.abs(t[own, None] - knots) / (bend_s or 1), 0)
    return simulate, [Series(file, axis, "arcsec", left[own], None, t[own], moves(t[own]), bends)]


def of_period(period):
    return [Candidate("worm", (S, C), fixed={"P": period})]


def main(folder):
    found = {}
    for file, period in PERIODS.items():
        whole, known = experiment(folder, file), {"worm P": period}
        found |= {file: diagnose(file, whole, EFFECTS, DRIFT, known).settings.get("worm")}
        early, late = (experiment(folder, file, "ra", part) for part in ((0, 0.6), (0.6, 1)))
        cross_test(diagnose(f"{file}, first 60 %", early, EFFECTS, DRIFT, known), late)
        diagnose(f"{file}, declination", experiment(folder, file, "dec"), EFFECTS, DRIFT, known)
        diagnose(f"{file}, wrong period only", whole, of_period(1.25 * period), DRIFT)
    other, known = "astrophysics_run_b_long", {"worm P": PERIODS["astrophysics_run_a"]}
    diagnose(f"{other}, straight drift", experiment(folder, other), EFFECTS, DRIFT, known)
    bent = experiment(folder, other, bend_s=2 * known["worm P"])
    diagnose(f"{other}, bent drift", bent, EFFECTS, documented=known)
    if worm := found["astrophysics_run_a"]:
        diagnose(f"{other}, bent drift, period of run a", bent, of_period(worm["P"]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
