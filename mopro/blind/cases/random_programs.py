"""Random programs for the cases, as texts of the motion language, and their runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mopro.blind.cases.spec import LVDT, CaseSpec
from mopro.blind.reference.listing import timeline
from mopro.blind.reference.motor import INCH_M, THESIS, Generator, Nominal
from mopro.blind.reference.plant import ProgramRun

_SPEEDS = (3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0)
_RATES = (0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)
# With a payload the axis would stall on steeper ramps.
_GENTLE = (0.04, 0.06, 0.1, 0.15)
_MOST_MOVES = 60


@dataclass(frozen=True)
class PositionRange:
    """The range of positions that programs use, in inches from the start."""

    low: float = 0.0
    high: float = 15.0


@dataclass(frozen=True)
class ProgramWriter:
    """Writer of random programs.

    Positions stay within `travel`; `per_inch` is the number of microsteps per inch. Ramps are
    scaled by `agility` (0 to 1) for a motor that is weaker for its mass than the default one.
    """

    travel: PositionRange = PositionRange()
    per_inch: int = THESIS.microsteps_per_inch
    agility: float = 1.0

    @classmethod
    def of(cls, nominal: Nominal, travel: PositionRange) -> ProgramWriter:
        """A writer for the machine `nominal`."""
        agility = nominal.agility / THESIS.agility
        return cls(travel, nominal.microsteps_per_inch, min(agility, 1.0))

    def strokes(
        self, g: Generator, lasts_s: float, heavy: bool = False, two_axes: bool = False
    ) -> str:
        """Moves in both directions with changing speeds, ramps, profiles and waits."""
        text, place = self._head + self._settings(g, heavy), [0.0, 0.0]
        for _ in range(_MOST_MOVES):
            if g.random() < 0.4:
                text += self._settings(g, heavy)
            text += self._move(g, place, two_axes)
            if timeline(text).duration_s >= lasts_s:
                break
        return text

    def one_speed(self, g: Generator, lasts_s: float) -> str:
        """Equal strokes in one direction at one speed."""
        speed = g.choice([5.0, 10.0, 15.0])
        text = f"{self._head}VEL1 {speed:.1f}\nACC1 {self._rate(0.1)}\n"
        text += "PARA1+\n" if g.random() < 0.5 else ""
        distance = min(self.travel.high / 2, speed * 0.6)
        count = 0
        while timeline(text).duration_s < lasts_s and (count + 1) * distance <= self.travel.high:
            text += f"MRI1 {distance:.1f}\nWX1\nWT{g.choice([200, 300, 400])}\n"
            count += 1
        return text

    def cycles(self, g: Generator, two_axes: bool = False) -> str:
        """An endless loop of strokes in both directions, to heat the motor."""
        speed, distance = g.choice([5.0, 10.0, 15.0, 20.0, 30.0, 40.0]), g.choice([4.0, 8.0, 15.0])
        rest = f"WT{g.choice([1000, 2000, 4000])}\n"
        rate = self._rate(g.choice([0.1, 0.2, 0.25]))
        text = f"{self._head}VEL0 {speed:.1f}\nACC0 {rate}\n:B1\n"
        for sign in ("", "-"):
            if two_axes:
                text += f"MR1 {sign}{distance}\nMR2 {sign}{distance / 2}\nGO\nWX1\nWX2\n{rest}"
            else:
                text += f"MRI1 {sign}{distance}\nWX1\n{rest}"
        return text + "JUMP B1\n"

    @property
    def _head(self) -> str:
        return f"UU{self.per_inch:06d}/1\n"

    def _rate(self, rate: float) -> float:
        return round(float(rate) * self.agility, 4)

    def _settings(self, g: Generator, heavy: bool) -> str:
        profile = "+" if g.random() < 0.5 else "-"
        rate = self._rate(g.choice(_GENTLE if heavy else _RATES))
        return f"VEL0 {g.choice(_SPEEDS):.1f}\nACC0 {rate}\nPARA0{profile}\n"

    def _move(self, g: Generator, place: list[float], two_axes: bool) -> str:
        """Statements of one move and a wait; `place` (inches) of each axis is updated."""
        wait = f"WT{int(g.choice([150, 250, 400, 700]))}\n"
        first = self._distance(g, place, 0)
        if not two_axes or g.random() < 0.3:
            return f"MRI1 {first}\nWX1\n{wait}"
        second = self._distance(g, place, 1)
        if g.random() < 0.2:
            return f"MRI2 {second}\nWX2\n{wait}MRI1 {first}\nWX1\n{wait}"
        return f"MR1 {first}\nMR2 {second}\nGO\nWX1\nWX2\n{wait}"

    def _distance(self, g: Generator, place: list[float], axis: int) -> float:
        """A distance of 0.5 to 10 in, to a position within the travel; `place` is updated."""
        options = np.arange(self.travel.low, self.travel.high + 0.1, 0.5)
        distances = np.round(options - place[axis], 3)
        distances = distances[(np.abs(distances) >= 0.5) & (np.abs(distances) <= 10.0)]
        distance = float(g.choice(distances))
        place[axis] += distance
        return distance


_PAYLOADS_KG = (0.0, 0.0, 1.0, 2.268)
_TRAVEL = {LVDT: PositionRange(-9.0, 9.0)}
_CUT = (0.4, 0.9)  # share of a program that is recorded if it is cut off


def random_runs(g: Generator, spec: CaseSpec, nominal: Nominal) -> list[ProgramRun]:
    """The runs of a case, each with a program and a payload, and cut off if it says so."""
    writer = ProgramWriter.of(nominal, _TRAVEL.get(spec.sensor, PositionRange()))
    return [_run(g, spec, writer) for _ in range(spec.runs)]


def _run(g: Generator, spec: CaseSpec, writer: ProgramWriter) -> ProgramRun:
    run = _whole_run(g, spec, writer)
    if not spec.cut:
        return run
    whole_s = run.until_s or timeline(run.text, microstep_m=INCH_M / writer.per_inch).duration_s
    return replace(run, until_s=round(whole_s * float(g.uniform(*_CUT)), 3))


def _whole_run(g: Generator, spec: CaseSpec, writer: ProgramWriter) -> ProgramRun:
    if spec.style == "cycles":
        return ProgramRun(writer.cycles(g, bool(g.random() < 0.3)), 0.0, spec.run_s)
    if spec.style == "one speed":
        return ProgramRun(writer.one_speed(g, spec.run_s))
    payload = float(g.choice(_PAYLOADS_KG))
    two_axes = spec.style == "two axes"
    return ProgramRun(writer.strokes(g, spec.run_s, payload > 0, two_axes), payload)
