"""Runs measured by mopro's own instruments with nothing hidden: `mopro reconcile` says `none`.

    python bench/measured_nulls.py [--seeds 5] [--only INSTRUMENT] [--jobs 1] [--hidden]

Each of four instruments sees six programs of `programs/`, each with noise of so many seeds. The
LVDT stores 960 readings, 1.2 s; laser and encoder see the whole program. A thermocouple sees
TEMP1 and TEMP2, which loop for ever, cut (`--for`) after 10, 30 and 90 minutes, and half a minute
later with each seed, as it has no noise but its converter's steps. Prints a line for each miss, the
table of `none`, and the time that a verdict took. --hidden: runs with an effect, which is named.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.measured import Measured
from mopro.engine.verdict import Verdict

LVDT = ("LVDT1", "LVDT2", "LVDT3", "LVDT4", "experiments/EXP01", "experiments/EXP04")
FINE = ("LVDT1", "LVDT2", "LVDT3", "LVDT4", "experiments/EXP05", "experiments/EXP08")
MINUTES = (10, 30, 90)
LATER_S = 30
# Effects that are hidden, with their sizes in SI, and the instrument that sees them. The LVDT bends
# by five times what its data sheet states, and the encoder's gain is beyond its stated tolerance.
BENT = {"c3": 0.0125, "mid": 0.1905}
HIDDEN = (
    ("encoder", "viscous_drag", {"b": 9.0}, ""),
    ("encoder", "backlash", {"B": 2e-5}, ""),
    ("encoder", "current_loop_lag", {"tau": 3e-4}, ""),
    ("encoder", "pitch_scale", {"e": 2e-4}, ""),
    ("encoder", "sensor_gain", {"g": 2e-3}, "gain_tolerance = 1e-4"),
    ("encoder", "coulomb_friction", {"Fc": 5.0}, ""),
    ("lvdt", "acceleration_scale", {"e": 0.1}, ""),
    ("lvdt", "start_delay", {"d": 5e-3}, ""),
    ("lvdt", "sensor_gain", {"g": -1e-2}, ""),
    ("lvdt", "sensor_nonlinearity", BENT, ""),
    ("lvdt", "hum", {"A": 5e-4}, ""),
)  # fmt: skip


def nulls(seeds: int) -> Iterator[Measured]:
    """The runs with nothing hidden."""
    for instrument, programs in (("lvdt", LVDT), ("laser", FINE), ("encoder", FINE)):
        for name in programs:
            for seed in range(seeds):
                yield Measured(instrument, f"{name}.CMD", seed)
    for name in ("TEMP1", "TEMP2"):
        for minutes in MINUTES:
            for seed in range(seeds):
                yield Measured("thermocouple", f"{name}.CMD", seed, 60.0 * minutes + LATER_S * seed)


def hidden() -> Iterator[Measured]:
    """The runs with an effect."""
    for seed, (instrument, name, values, keys) in enumerate(HIDDEN):
        yield Measured(instrument, "LVDT1.CMD", seed, hidden={name: values}, keys=keys)


def answered(case: Measured) -> tuple[Measured, Verdict, float]:
    """A case, the verdict on it and the time (s) that it took."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        verdict = case.verdict(Path(folder))
        return case, verdict, time.perf_counter() - begun


def words(verdict: Verdict) -> str:
    """The verdict, what it names, and what stays unexplained."""
    names = [" or ".join([e.name, *e.indistinguishable_from]) for e in verdict.effects]
    of_sensors = [f"({own.name})" for own in verdict.sensors]
    rest = [str(verdict.remainder.description)] if verdict.remainder.significant else []
    return " ".join([verdict.verdict, *names, *of_sensors, *rest])


def column(case: Measured) -> str:
    """Heading of a column of the table: the program, and the minutes of a cut run."""
    cut = "" if case.cut_s is None else f" {case.cut_s // 600 * 10:.0f} min"
    return f"{Path(case.program).stem}{cut}"


def right(case: Measured, verdict: Verdict) -> bool:
    """True if nothing is told where nothing is hidden, or what is hidden among its look-alikes."""
    families = [{e.name, *e.indistinguishable_from} for e in verdict.effects]
    if not case.hidden:
        return verdict.verdict == "none"
    return len(families) == 1 and set(case.hidden) <= families[0]


def main(seeds: int, only: str | None, jobs: int, with_effects: bool) -> None:
    cases = [
        c for c in (hidden() if with_effects else nulls(seeds)) if only in (None, c.instrument)
    ]
    counts: dict[tuple[str, str], list[bool]] = defaultdict(list)
    slowest = total_s = 0.0
    with ProcessPoolExecutor(jobs) as pool:
        for case, verdict, took_s in pool.map(answered, cases):
            good = right(case, verdict)
            counts[case.instrument, column(case)].append(good)
            slowest, total_s = max(slowest, took_s), total_s + took_s
            if with_effects or not good:
                what = ", ".join(case.hidden) or f"{column(case)}, seed {case.seed}"
                miss = "" if good else "MISS: "
                print(f"{miss}{case.instrument}, {what}: {words(verdict)}", flush=True)
    print(f"{'instrument':14}{'program':16}right")
    for (instrument, name), own in counts.items():
        print(f"{instrument:14}{name:16}{sum(own)} of {len(own)}")
    every = [good for own in counts.values() for good in own]
    mean_s = total_s / len(every)
    print(f"{sum(every)} of {len(every)}; a verdict took {mean_s:.1f} s, at most {slowest:.1f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--only", help="one instrument")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--hidden", action="store_true", help="runs with an effect")
    args = parser.parse_args()
    main(args.seeds, args.only, args.jobs, args.hidden)
