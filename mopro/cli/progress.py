"""Progress of long work: one line on a terminal's standard error, with speed and time left."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Protocol, TypeVar

from mopro.cli.say import end_status, is_terminal, say_status
from mopro.units import UNITS, length_unit_name

if TYPE_CHECKING:
    from mopro.machine import Machine
    from mopro.machine.backend import OnProgress, Progress
    from mopro.program import Program

T = TypeVar("T")

_EVERY_S = 0.1
# Work that ends before this shows nothing.
_AFTER_S = 0.5
_BAR = 20


@dataclass
class _Line:
    """Shows texts, not more often than can be read, from `after_s` on."""

    after_s: float
    _begun_s: float = field(default_factory=lambda: time.monotonic())
    _last_s: float = 0.0

    @property
    def spent_s(self) -> float:
        return time.monotonic() - self._begun_s

    def show(self, text: Callable[[], str]) -> None:
        if is_terminal(sys.stderr) and self.spent_s >= max(self.after_s, self._last_s + _EVERY_S):
            self._last_s = self.spent_s
            say_status(text())


class Tell(Protocol):
    """Tells how much of the work is done, and of how much where that was not known before."""

    def __call__(self, done: float, total: float = 0) -> None: ...


@contextmanager
def counted(label: str, total: float, unit: str) -> Iterator[Tell]:
    """A function to tell how much of `total` is done; 0 for a total that is not known yet."""
    whole, line = total, _Line(_AFTER_S)

    def tell(done: float, total: float = 0) -> None:
        line.show(lambda: _count_text(label, done, total or whole, unit, line.spent_s))

    try:
        yield tell
    finally:
        end_status()


def each_counted(steps: Iterable[T], total: int, label: str, unit: str) -> list[T]:
    """`steps` as a list, counted as they come."""
    done: list[T] = []
    with counted(label, total, unit) as tell:
        for step in steps:
            done.append(step)
            tell(len(done))
    return done


def _count_text(label: str, done: float, total: float, unit: str, spent_s: float) -> str:
    speed = done / spent_s if spent_s else 0.0
    pace = f"{speed:.3g} {unit}/s" if speed >= 1 or not speed else f"{1 / speed:.3g} s a {unit}"
    if not total:
        return f"{label}: {done:g} {unit}, {pace}"
    full = round(_BAR * min(done / total, 1.0))
    bar = "#" * full + "-" * (_BAR - full)
    left = f", {duration((total - done) / speed)} left" if speed else ""
    return f"{label} [{bar}] {done:.4g} of {total:.4g} {unit}, {pace}{left}"


def duration(seconds: float) -> str:
    """A time for a person: `12 s`, `3:05 min`, `2:10 h`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d} min"
    return f"{whole // 3600}:{whole % 3600 // 60:02d} h"


@contextmanager
def simulated() -> Iterator[OnProgress]:
    """Shows how much of a run is simulated, and how fast."""
    with counted("simulating", 0, "s") as tell:
        yield lambda progress: tell(progress.time_s, progress.total_s)


@contextmanager
def in_motion(unit: str) -> Iterator[OnProgress]:
    """Shows time, line, positions, speed and time left of a run in real time, in `unit`."""
    metres = float(UNITS[unit][1])
    seen: list[Progress] = []

    def show(progress: Progress) -> None:
        say_status(_motion_text(progress, seen[-1] if seen else progress, unit, metres))
        seen[:] = [progress]

    try:
        yield show
    finally:
        end_status()


def _motion_text(progress: Progress, before: Progress, unit: str, metres: float) -> str:
    elapsed_s = progress.time_s - before.time_s
    gone = [abs(x - before.position_m[axis]) / metres for axis, x in progress.position_m.items()]
    speed = max(gone) / elapsed_s if elapsed_s > 0 else 0.0
    places = ", ".join(f"axis {axis} {x / metres:.3f}" for axis, x in progress.position_m.items())
    left_s = progress.total_s - progress.time_s
    left = f"{duration(left_s)} left" if left_s > 0 else "settling"
    return (
        f"{progress.time_s:.1f} of {progress.total_s:.1f} s, line {progress.line}, "
        f"{places} {unit}, {speed:.1f} {unit}/s, {left}"
    )


def length_unit(program: Program, machine: Machine) -> str:
    """The program's first user unit, if it has a name; else mm."""
    from mopro.program import ir

    for op in program.ops:
        if isinstance(op, ir.SetUnits):
            microstep = Fraction(machine.microstep_m).limit_denominator(10**9)
            name = length_unit_name(Fraction(op.numerator, op.denominator) * microstep)
            return "mm" if name == "uu" else name
    return "mm"
