"""Flashes and runs under random faults against the virtual controller, in simulated time.

    python bench/link_campaign.py --flashes 1000 --runs 300 --hostile 400

Each trial has a seed of its own, from which its program, its faults and its line come. The
truth is looked up in the controller's own memory, which no fault can reach. Prints a table
for each dialect and exits with 1 if anything is broken that must not break:

- a flash or run that reports success while the controller holds or did something else
  (with a checksum this must not happen; without one it is counted and said),
- a trial that goes on past its deadline, or ends in anything but a report,
- a stored program that is neither the old nor the new one,
- motion after the host has reported a stop.

Then the controller itself turns hostile at a random moment of a run: replies of any kind, lines
without an end, another dialect, silence, echo, NUL bytes, noise. A run must end in time, in a
report, and with a stop sent.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import cycle, islice, product
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers import hostile
from mopro.controller import Device, LoopbackPort, MemoryStore, Scenario, Station
from mopro.controller.faults import Fault, PlantFault
from mopro.emulator import Emulator
from mopro.errors import LinkError
from mopro.link import SerialBackend, Session, builtin_dialects, load_dialect
from mopro.link.flash import allowed_s, flash, statements_of
from mopro.machine import load_machine
from mopro.program import AXES, Program
from mopro.program.compile import compile as compile_text
from mopro.recording import MemorySink, Run

SLACK_S = 0.5
DEADLINE_S = 40.0
AFTERWARDS_S = 3.0
BREAKAGES = ("late end", "neither old nor new", "moved after stop")


@dataclass
class Tally:
    """Counts over trials: endings, faults that happened, and what broke."""

    endings: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    broken: Counter[str] = field(default_factory=Counter)
    seeds: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.endings += other.endings
        self.faults += other.faults
        self.broken += other.broken
        self.seeds += other.seeds


def random_program(random: Random, most_moves: int) -> Program:
    """A program of short moves, there and back, in either profile."""
    lines = ["UU012500/1", f"VEL0 {random.choice(['4.0', '8.5', '12.25'])}", "ACC0 0.2"]
    if random.random() < 0.5:
        lines.append("PARA0+")
    for _ in range(random.randint(1, most_moves)):
        way = f"{random.uniform(0.05, 1.5):.4f}"
        if random.random() < 0.3:
            lines += [f"MR1 {way}", f"MR2 -{way}", "GO", "WX0", f"MR1 -{way}", f"MR2 {way}", "GO"]
            lines += ["WX0"]
        else:
            axis = random.choice(AXES)
            lines += [f"MRI{axis} {way}", f"WX{axis}", f"WT{random.randint(1, 200)}"]
            lines += [f"MRI{axis} -{way}", f"WX{axis}"]
    return compile_text("\n".join(lines) + "\n", "trial.CMD")


def random_fault(random: Random, within_s: float) -> Fault:
    kind = random.choice(
        ["drop", "double", "flip", "split", "merge", "late", "missing", "garbled"] * 2
        + ["echo_off", "busy", "disconnect", "reset"]
    )
    rate = 10 ** random.uniform(-4, -1.5)
    at_s = random.uniform(0, within_s)
    direction = random.choice(["to_controller", "to_host", "both"])
    if kind in ("drop", "double", "flip", "split", "merge"):
        return Fault(kind, rate=rate, direction=direction)
    if kind == "late":
        return Fault(kind, rate=rate * 3, delay_s=random.choice([0.2, 0.9, 1.5, 4.0]))
    if kind in ("missing", "garbled"):
        return Fault(kind, rate=rate * 3)
    for_s = random.choice([0.1, 1.0, 5.0, math.inf if kind == "busy" else 20.0])
    return Fault(kind, at_s=at_s, for_s=min(for_s, 0.5) if kind == "reset" else for_s)


def random_plant_fault(random: Random) -> PlantFault:
    kind = random.choice(["limit", "overheated", "lost_steps"])
    axis, run_s = random.choice(AXES), random.uniform(0, 1.0)
    return PlantFault(kind, run_s, axis, random.choice([-3, -1, 1, 2]))


def random_scenario(random: Random, within_s: float, plant: bool) -> Scenario:
    faults = [random_fault(random, within_s) for _ in range(random.randint(0, 3))]
    befalls = [random_plant_fault(random)] if plant and random.random() < 0.3 else []
    return Scenario(random.randrange(2**31), faults, befalls)


def joined(random: Random, dialect: str, scenario: Scenario) -> tuple[Station, Session]:
    baud = random.choice([9600, 115200])
    language = load_dialect(dialect)
    emulator = Emulator(load_machine("chow1992"))
    station = Station(language, emulator, MemoryStore(), scenario, baud)
    port = LoopbackPort(station, breaks=random.random() < 0.5)
    return station, Session(port, language, Random(random.randrange(2**31)), baud)


def flash_trial(dialect: str, seed: int) -> Tally:
    random = Random(f"flash {dialect} {seed}")
    old, new = random_program(random, 3), random_program(random, 8)
    station, session = joined(random, dialect, random_scenario(random, 4.0, plant=False))
    station.store.write("MAIN", statements_of(old))
    allowed = allowed_s(session, new)
    session.give(allowed)
    tally = Tally()
    try:
        session.open()
        flash(session, new, "MAIN")
        ending = "done, line by line as sent"
    except LinkError as error:
        ending = f"failed: {error.rule}"
    stored = station.store.read("MAIN")
    whole = stored in (statements_of(old), statements_of(new))
    if ending.startswith("done") and stored != statements_of(new):
        ending = "done, but not what was sent"
        tally.broken["silent corruption"] += 1
    if not whole:
        tally.broken["neither old nor new"] += 1
    if ending.startswith("failed") and stored == statements_of(new):
        tally.endings["(of the failed: new program already whole)"] += 1
    if session.port.now_s() > allowed + SLACK_S:
        tally.broken["late end"] += 1
    return closed(tally, ending, station, f"flash {dialect} {seed}")


def closed(tally: Tally, ending: str, station: Station, name: str) -> Tally:
    tally.endings[ending] += 1
    tally.faults.update({kind: min(1, n) for kind, n in station.injector.happened.items()})
    tally.seeds += [name] if tally.broken else []
    return tally


def run_trial(dialect: str, seed: int) -> Tally:
    random = Random(f"run {dialect} {seed}")
    program = random_program(random, 2)
    station, session = joined(random, dialect, random_scenario(random, 6.0, plant=True))
    backend = SerialBackend(session, load_machine("chow1992"), deadline_s=DEADLINE_S)
    tally = Tally()
    sink = MemorySink()
    try:
        run = backend.run(program, sink)
    except LinkError as error:
        if session.port.now_s() > DEADLINE_S + SLACK_S:
            tally.broken["late end"] += 1
        return closed(tally, f"not begun: {error.rule}", station, f"run {dialect} {seed}")
    if session.port.now_s() > DEADLINE_S + SLACK_S:
        tally.broken["late end"] += 1
    ending = "went well" if run.trouble is None else "ended early, stop "
    if run.trouble is not None:
        ending += "not confirmed" if "NOT CONFIRMED" in run.trouble else "confirmed or at rest"
    if not ending.endswith("not confirmed") and moved_since(station.device, session.port.now_s()):
        tally.broken["moved after stop"] += 1
    if run.trouble is None and not told_the_truth(run, program, station):
        ending = "went well, but the report is wrong"
        tally.broken["silent corruption"] += 1
    return closed(tally, ending, station, f"run {dialect} {seed}")


def moved_since(device: Device, now_s: float) -> bool:
    """True if the motor is told to move, or moves by itself, after `now_s`."""
    before = [device.do(name, {}, now_s)[0] for name in ("position", "measured")]
    moving = device.do("motion", {}, now_s)[0]
    after = [device.do(name, {}, now_s + AFTERWARDS_S)[0] for name in ("position", "measured")]
    return before != after or any(moving.values())


def told_the_truth(run: Run, program: Program, station: Station) -> bool:
    """True if the report's moves are those that the machine made."""
    rows = station.device.do("moves", {"first": 1}, 1e6)
    truth = [(row["complete"], row["lost"], row["slipped"], row["lag"]) for row in rows]
    unit = 12500 * load_machine("chow1992").microstep_m
    told = [(m.complete, m.lost_pitches, m.slipped, m.max_lag) for m in run.moves[: len(rows)]]
    same = [
        (c, lost, slipped) == (bool(tc), tl, bool(ts))
        and lag is not None
        and math.isclose(lag * unit, tlag, rel_tol=1e-9)
        for (c, lost, slipped, lag), (tc, tl, ts, tlag) in zip(told, truth, strict=False)
    ]
    return len(told) == len(truth) and all(same)


def campaign(kind: str, dialect: str, trials: int, jobs: int) -> Tally:
    trial = partial(flash_trial if kind == "flash" else run_trial, dialect)
    total = Tally()
    with ProcessPoolExecutor(jobs) as pool:
        for tally in pool.map(trial, range(trials), chunksize=10):
            total.add(tally)
    return total


def show(kind: str, dialect: str, trials: int, tally: Tally, wall_s: float) -> None:
    print(f"\n{kind}, dialect {dialect}: {trials} trials in {wall_s:.0f} s")
    for ending, count in sorted(tally.endings.items(), key=lambda item: -item[1]):
        print(f"  {count:6d}  {ending}")
    met = ", ".join(f"{kind} {count}" for kind, count in sorted(tally.faults.items()))
    print(f"  trials that met a wire or controller fault of a kind: {met}")
    for what in ("silent corruption", *BREAKAGES):
        print(f"  {tally.broken[what]:6d}  {what}")
    if tally.seeds:
        print(f"  see: {', '.join(tally.seeds[:12])}")


def hostile_campaign(trials: int, jobs: int) -> bool:
    """Print a row for each kind of hostile controller; True if any trial has failed."""
    chosen = islice(cycle(product(hostile.KINDS, builtin_dialects())), trials)
    arguments = [(kind, dialect, n) for n, (kind, dialect) in enumerate(chosen)]
    with ProcessPoolExecutor(jobs) as pool:
        done = list(pool.map(hostile.trial, *zip(*arguments, strict=True), chunksize=4))
    print(f"\nhostile controllers: {trials} trials")
    for kind in hostile.KINDS:
        own = [t for t in done if t.kind == kind]
        endings = Counter(t.ending for t in own)
        words = ", ".join(f"{ending} {count}" for ending, count in endings.most_common())
        failed = Counter(f for t in own for f in t.failures)
        shown = ", ".join(f"{name} {failed[name]}" for name in hostile.FAILURES)
        print(f"  {len(own):5d}  {kind:16} {words}; failures: {shown}")
    for t in [t for t in done if t.failures][:12]:
        print(f"  see: {t}")
    return any(t.failures for t in done)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--flashes", type=int, default=1000, help="for each dialect")
    parser.add_argument("--runs", type=int, default=300, help="for each dialect")
    parser.add_argument("--hostile", type=int, default=400, help="over both dialects")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    failed = bool(chosen.hostile) and hostile_campaign(chosen.hostile, chosen.jobs)
    for kind, trials in (("flash", chosen.flashes), ("run", chosen.runs)):
        for dialect in builtin_dialects():
            started_s = time.perf_counter()
            tally = campaign(kind, dialect, trials, chosen.jobs)
            show(kind, dialect, trials, tally, time.perf_counter() - started_s)
            excused = load_dialect(dialect).check is None
            must_not = BREAKAGES if excused else ("silent corruption", *BREAKAGES)
            failed |= any(tally.broken[what] for what in must_not)
    print("\nBROKEN" if failed else "\nall that must hold held")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
