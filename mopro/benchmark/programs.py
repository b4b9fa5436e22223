"""Programs for hidden-effect experiments, drawn from families and written as texts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mopro.benchmark.reference.listing import timeline
from mopro.benchmark.reference.nominal import THESIS, Nominal

Generator = np.random.Generator

_SPEEDS = (3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0)
_RATES = (0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)
# With a payload the axis holds its lock only on gentler ramps.
_GENTLE = (0.04, 0.06, 0.1, 0.15)
_MOST_MOVES = 60


@dataclass(frozen=True)
class Range:
    """Where the forcer may go, in inches from the start."""

    low: float = 0.0
    high: float = 15.0


@dataclass(frozen=True)
class Author:
    """Writes programs within `room`, with `per_inch` microsteps an inch.

    A motor that is less agile than the source's gets ramps that are gentler by `agility`.
    """

    room: Range = Range()
    per_inch: int = THESIS.microsteps_per_inch
    agility: float = 1.0

    @classmethod
    def of(cls, nominal: Nominal, room: Range) -> Author:
        agility = nominal.agility / THESIS.agility
        return cls(room, nominal.microsteps_per_inch, min(agility, 1.0))

    def strokes(
        self, g: Generator, lasts_s: float, heavy: bool = False, two_axes: bool = False
    ) -> str:
        """Moves to and fro with speeds, ramps, profiles and waits that change."""
        text, place = self._head + self._settings(g, heavy), [0.0, 0.0]
        for _ in range(_MOST_MOVES):
            if g.random() < 0.4:
                text += self._settings(g, heavy)
            text += self._leg(g, place, two_axes)
            if timeline(text).duration_s >= lasts_s:
                break
        return text

    def one_speed(self, g: Generator, lasts_s: float) -> str:
        """Equal strokes in one direction at one gentle setting."""
        speed = g.choice([5.0, 10.0, 15.0])
        text = f"{self._head}VEL1 {speed:.1f}\nACC1 {self._rate(0.1)}\n"
        text += "PARA1+\n" if g.random() < 0.5 else ""
        way = min(self.room.high / 2, speed * 0.6)
        count = 0
        while timeline(text).duration_s < lasts_s and (count + 1) * way <= self.room.high:
            text += f"MRI1 {way:.1f}\nWX1\nWT{g.choice([200, 300, 400])}\n"
            count += 1
        return text

    def cycles(self, g: Generator, two_axes: bool = False) -> str:
        """A stroke forth and back for ever, to warm the motor."""
        speed, way = g.choice([5.0, 10.0, 15.0, 20.0, 30.0, 40.0]), g.choice([4.0, 8.0, 15.0])
        rest = f"WT{g.choice([1000, 2000, 4000])}\n"
        rate = self._rate(g.choice([0.1, 0.2, 0.25]))
        text = f"{self._head}VEL0 {speed:.1f}\nACC0 {rate}\n:B1\n"
        for sign in ("", "-"):
            if two_axes:
                text += f"MR1 {sign}{way}\nMR2 {sign}{way / 2}\nGO\nWX1\nWX2\n{rest}"
            else:
                text += f"MRI1 {sign}{way}\nWX1\n{rest}"
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

    def _leg(self, g: Generator, place: list[float], two_axes: bool) -> str:
        """One move (inches, to a place within the room) and a wait."""
        wait = f"WT{int(g.choice([150, 250, 400, 700]))}\n"
        first = self._way(g, place, 0)
        if not two_axes or g.random() < 0.3:
            return f"MRI1 {first}\nWX1\n{wait}"
        second = self._way(g, place, 1)
        if g.random() < 0.2:
            return f"MRI2 {second}\nWX2\n{wait}MRI1 {first}\nWX1\n{wait}"
        return f"MR1 {first}\nMR2 {second}\nGO\nWX1\nWX2\n{wait}"

    def _way(self, g: Generator, place: list[float], axis: int) -> float:
        """A way of half an inch to ten, to somewhere in the room."""
        options = np.arange(self.room.low, self.room.high + 0.1, 0.5)
        ways = np.round(options - place[axis], 3)
        ways = ways[(np.abs(ways) >= 0.5) & (np.abs(ways) <= 10.0)]
        way = float(g.choice(ways))
        place[axis] += way
        return way
