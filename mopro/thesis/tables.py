"""Computes each table by the heat balance, the profiles and whole emulated runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mopro.emulator import Emulator
from mopro.machine import load_machine
from mopro.motion import Profile, plan_profile
from mopro.plant import elongation_m, heat_balance
from mopro.program.compile import compile_file
from mopro.recording import MemorySink, Run
from mopro.thesis.printed import EXPERIMENTS, PROFILE_TABLES, THERMAL, Entry, MoveTest
from mopro.units import INCH_M, POUND_KG

INCH = float(INCH_M)
_MILS_PER_INCH = 1000
_NOT_REPRODUCIBLE = 5


@dataclass(frozen=True)
class Row:
    """One number of a table. `deviation` is relative to the printed value, None for words."""

    table: str
    row: str
    quantity: str
    printed: float | str
    computed: float | str
    deviation: float | None
    note: str = ""


def _numbers(
    table: str, row: str, quantity: str, printed: float, computed: float, note: str = ""
) -> Row:
    deviation = (computed - printed) / printed if printed else computed - printed
    return Row(table, row, quantity, printed, computed, deviation, note)


def table_3_2() -> list[Row]:
    """Peak rise of the temperature, the theory column, by eq. 3.26.

    The Reynolds number's length is the distance travelled; on a diagonal, both that and the
    speed are those of the path.
    """
    machine = load_machine("chow1992")
    rows = []
    for number, test in enumerate(THERMAL, start=1):
        moving = (test.x > 0) + (test.y > 0)
        speed = test.velocity * math.sqrt(max(moving, 1)) * INCH
        balance = heat_balance(machine, moving, speed, math.hypot(test.x, test.y) * INCH)
        note = "not reproducible by any reading" if number == _NOT_REPRODUCIBLE else ""
        rows.append(_numbers("3.2", str(number), "theory (K)", test.theory_K, balance.rise_K, note))
    return rows


def table_3_3() -> list[Row]:
    """Elongations of the platen from the printed measured rises, by eq. 3.32 to 3.39."""
    machine = load_machine("chow1992")
    rows = []
    for number, test in enumerate(THERMAL, start=1):
        elongations = elongation_m(machine, test.actual_K, (test.x * INCH, test.y * INCH))
        computed = tuple(elongations[end][axis] for axis in (0, 1) for end in ("low", "high"))
        for name, printed, value in zip(
            ("x1", "x2", "y1", "y2"), test.elongations, computed, strict=True
        ):
            mils = value / INCH * _MILS_PER_INCH
            rows.append(_numbers("3.3", str(number), f"δ{name} (0.001 in)", printed, mils))
    return rows


# A move of each shape: those of the experiments that the text discusses.
_EXAMPLES = {"trapezoid": 6, "triangle": 7, "smooth": 10, "parabola": 9}


def profile_table(name: str) -> list[Row]:
    """A printed formula's value in the middle of its phase, beside the profile's."""
    shape, entries = PROFILE_TABLES[name]
    example = EXPERIMENTS[_EXAMPLES[shape] - 1]
    s, v, a = example.distance, example.velocity, example.acceleration
    profile = plan_profile(s, v, a, shape in ("smooth", "parabola"))
    rows = []
    for entry in entries:
        t = _middle_s(profile, entry.phase)
        note = f"erratum {entry.erratum}: misprinted" if entry.erratum else ""
        printed, computed = entry.formula(s, v, a, t), _computed(profile, entry, t)
        rows.append(_numbers(name, f"T{entry.phase}", entry.quantity, printed, computed, note))
    return rows


def _middle_s(profile: Profile, phase: int) -> float:
    starts = (0.0, profile.ramp_s, profile.ramp_s + profile.cruise_s)
    lengths = (profile.ramp_s, profile.cruise_s, profile.ramp_s)
    return starts[phase - 1] + lengths[phase - 1] / 2


def _computed(profile: Profile, entry: Entry, t: float) -> float:
    if entry.quantity == "duration":
        return profile.cruise_s if entry.phase == 2 else profile.ramp_s
    state = profile.state(t)
    return {
        "displacement": state.position,
        "velocity": state.velocity,
        "acceleration": state.acceleration,
    }[entry.quantity]


def experiment_path(number: int) -> Path:
    """The program of an experiment, in the installed package or in the checkout beside it."""
    package = Path(__file__).resolve().parents[1]
    place = Path("programs") / "experiments" / f"EXP{number:02d}.CMD"
    installed = package / place
    return installed if installed.is_file() else package.parent / place


def table_4_5() -> list[Row]:
    """All experiments, run through their programs, with their loads."""
    return [
        row
        for number, experiment in enumerate(EXPERIMENTS, start=1)
        for row in _experiment_rows(number, experiment)
    ]


def _experiment_rows(number: int, experiment: MoveTest) -> list[Row]:
    run = _run(number, experiment.load_lb)
    move, row = run.moves[0], str(number)
    note = "stalled" if run.stalled else f"largest lag {move.max_lag:.4f} in"
    if experiment.load_lb:
        note += f", {experiment.load_lb:g} lb"
    shape = Row("4.5", row, "profile", experiment.profile, move.profile, None, note)
    return [
        shape,
        _setting(row, "distance (in)", experiment.distance, move.distance),
        _setting(row, "set velocity (in/s)", experiment.velocity, move.set_velocity),
        _setting(row, "acceleration (in/s²)", experiment.acceleration, move.acceleration),
    ]


def _setting(row: str, quantity: str, printed: float, stated: float) -> Row:
    """A row of Table 4.5 that the program states, so that nothing is computed."""
    return Row("4.5", row, quantity, printed, stated, None, "set by the program")


def _run(number: int, load_lb: float) -> Run:
    emulator = Emulator(load_machine("chow1992"), load_lb * float(POUND_KG))
    return emulator.run(compile_file(experiment_path(number)), MemorySink())


TABLES: dict[str, Callable[[], list[Row]]] = {
    "3.2": table_3_2,
    "3.3": table_3_3,
    "4.1": lambda: profile_table("4.1"),
    "4.2": lambda: profile_table("4.2"),
    "4.3": lambda: profile_table("4.3"),
    "4.4": lambda: profile_table("4.4"),
    "4.5": table_4_5,
}


def table(name: str) -> list[Row]:
    """The rows of one table; KeyError if there is none of that name."""
    return TABLES[name]()
