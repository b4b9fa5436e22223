"""The terms that a set of effects adds to the equation of motion.

The terms of all effects of a set are composed to one function each for the further
forces, the states that follow the path and the setpoints of the currents. Composed
functions take the effects' parameters as `numbers`, one tuple for each effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from mopro.effects.base import Active, Effect

Numbers = tuple[tuple[float, ...], ...]
Pair = tuple[float, float]
Path = tuple[float, ...]
# (motor_N, x, v, z, dx, numbers) -> N: all forces besides the motor's and the damping.
Forces = Callable[[float, float, float, Path, float, Numbers], float]
# (z, dx, numbers) -> z: the states that follow the path, after a further way of dx.
Slides = Callable[[Path, float, Numbers], Path]
# (command_m, gain, k, numbers) -> (ia, ib): setpoints of the currents over I.
Setpoints = Callable[[float, float, float, Numbers], Pair]

_F = TypeVar("_F", bound=Callable[..., Any])


class Prepare(Protocol):
    """Makes a function ready to be called: as it stands in plain Python, else compiled."""

    def __call__(self, function: _F, /) -> _F: ...


@dataclass(frozen=True)
class TermSet:
    """The effects of a set that have terms, in their order; the same for all their values."""

    effects: tuple[Effect, ...]

    @classmethod
    def of(cls, active: Sequence[Active]) -> TermSet:
        """The effects of `active` with a term in the equation of motion."""
        return cls(tuple(a.effect for a in active if has_term(a.effect)))

    @property
    def lag(self) -> int | None:
        """The place of the effect behind which the currents lag, if any."""
        return self._loop("lag")

    @property
    def voltage(self) -> int | None:
        """The place of the effect that limits the phases' voltage, if any."""
        return self._loop("voltage")

    def _loop(self, kind: str) -> int | None:
        places = [i for i, e in enumerate(self.effects) if e.current_loop == kind]
        return places[0] if places else None

    @property
    def on_path(self) -> list[int]:
        """The places of effects with a state that follows the path."""
        return [i for i, effect in enumerate(self.effects) if effect.slide]

    @property
    def has_forces(self) -> bool:
        return any(effect.force or effect.reaction for effect in self.effects)

    @property
    def direct(self) -> bool:
        """True if the motor's force follows the command directly, as with an ideal drive."""
        return not any(effect.setpoint or effect.current_loop for effect in self.effects)

    def numbers(self, active: Sequence[Active]) -> Numbers:
        """The values of those of `active` that have terms, as the kernel takes them."""
        return tuple(tuple(map(float, a.values)) for a in active if has_term(a.effect))


def has_term(effect: Effect) -> bool:
    """True if the equation of motion has a term of `effect`."""
    terms = (effect.force, effect.reaction, effect.slide, effect.setpoint, effect.current_loop)
    return any(term is not None for term in terms)


def forces(terms: TermSet, prepare: Prepare) -> Forces:
    """The sum of all further forces, each state taken where the way dx has brought it."""
    states = {i: j for j, i in enumerate(terms.on_path)}
    parts: list[Forces] = []
    for i, effect in enumerate(terms.effects):
        slide = prepare(effect.slide) if effect.slide else None
        for term, of_motor in ((effect.force, False), (effect.reaction, True)):
            if term is not None:
                part = prepare(_force(prepare(term), of_motor, i, states.get(i), slide))
                parts.append(_unless_absent(part, effect, i, prepare))
    if not parts:
        return prepare(_no_force)
    total = parts[0]
    for part in parts[1:]:
        total = prepare(_sum(total, part))
    return total


def _no_force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
    return 0.0


def _force(
    term: Callable[..., float],
    of_motor: bool,
    i: int,
    j: int | None,
    slide: Callable[..., float] | None,
) -> Forces:
    """The term of effect `i`; with a state it is the state number `j`.

    `of_motor` tells whether the term wants the motor's force.
    """
    if j is None or slide is None:
        return _stateless(term, of_motor, i)

    def force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return term(x, v, slide(z[j], dx, *numbers[i]), *numbers[i])

    def reaction(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return term(x, v, slide(z[j], dx, *numbers[i]), motor_N, *numbers[i])

    return reaction if of_motor else force


def _stateless(term: Callable[..., float], of_motor: bool, i: int) -> Forces:
    def force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return term(x, v, *numbers[i])

    def reaction(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return term(x, v, motor_N, *numbers[i])

    return reaction if of_motor else force


def _unless_absent(part: Forces, effect: Effect, i: int, prepare: Prepare) -> Forces:
    """`part`, skipped where the effect `i` is there for the sake of its kernel group only."""
    if effect.absent_at is None:
        return part
    (first, first_null), (last, last_null) = effect.absent_at

    def force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        if numbers[i][first] == first_null and numbers[i][last] == last_null:
            return 0.0
        return part(motor_N, x, v, z, dx, numbers)

    return prepare(force)


def _sum(one: Forces, other: Forces) -> Forces:
    def total(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return one(motor_N, x, v, z, dx, numbers) + other(motor_N, x, v, z, dx, numbers)

    return total


def slides(terms: TermSet, prepare: Prepare) -> Slides:
    """All states that follow the path after a further way of dx (m)."""
    advanced: Slides = prepare(_no_states)
    for j, i in enumerate(terms.on_path):
        term = terms.effects[i].slide
        assert term is not None, "its place is one of those with such a state"
        slide = _slide_unless_absent(prepare(term), terms.effects[i], prepare)
        advanced = prepare(_first_state(slide, i) if j == 0 else _next_state(advanced, slide, i, j))
    return advanced


def _slide_unless_absent(
    slide: Callable[..., float], effect: Effect, prepare: Prepare
) -> Callable[..., float]:
    """`slide`, with the effect's numbers in one tuple; an absent effect's state stays."""

    def always(z: float, dx: float, numbers: tuple[float, ...]) -> float:
        return slide(z, dx, *numbers)

    if effect.absent_at is None:
        return prepare(always)
    (first, first_null), (last, last_null) = effect.absent_at

    def unless_absent(z: float, dx: float, numbers: tuple[float, ...]) -> float:
        if numbers[first] == first_null and numbers[last] == last_null:
            return z
        return slide(z, dx, *numbers)

    return prepare(unless_absent)


def _no_states(z: Path, dx: float, numbers: Numbers) -> Path:
    return z


def _first_state(slide: Callable[..., float], i: int) -> Slides:
    def advanced(z: Path, dx: float, numbers: Numbers) -> Path:
        return (slide(z[0], dx, numbers[i]),)

    return advanced


def _next_state(before: Slides, slide: Callable[..., float], i: int, j: int) -> Slides:
    def advanced(z: Path, dx: float, numbers: Numbers) -> Path:
        return (*before(z, dx, numbers), slide(z[j], dx, numbers[i]))

    return advanced


def setpoints(terms: TermSet, prepare: Prepare) -> Setpoints:
    """i_a = cos θ, i_b = sin θ with θ = k x_c, through each effect's `setpoint`, times gain."""
    shaped: Callable[[float, float, float, Numbers], Pair] | None = None
    for i, effect in enumerate(terms.effects):
        if effect.setpoint:
            term = prepare(effect.setpoint)
            shaped = prepare(_shaped(term, i) if shaped is None else _reshaped(shaped, term, i))
    return prepare(_plain_setpoints if shaped is None else _shaped_setpoints(shaped))


def _shaped(
    setpoint: Callable[..., Pair], i: int
) -> Callable[[float, float, float, Numbers], Pair]:
    def shaped(theta: float, ia: float, ib: float, numbers: Numbers) -> Pair:
        return setpoint(theta, ia, ib, *numbers[i])

    return shaped


def _reshaped(
    before: Setpoints, setpoint: Callable[..., Pair], i: int
) -> Callable[[float, float, float, Numbers], Pair]:
    def shaped(theta: float, ia: float, ib: float, numbers: Numbers) -> Pair:
        ia, ib = before(theta, ia, ib, numbers)
        return setpoint(theta, ia, ib, *numbers[i])

    return shaped


def _plain_setpoints(command_m: float, gain: float, k: float, numbers: Numbers) -> Pair:
    theta = k * command_m
    return math.cos(theta) * gain, math.sin(theta) * gain


def _shaped_setpoints(shaped: Callable[[float, float, float, Numbers], Pair]) -> Setpoints:
    def setpoints(command_m: float, gain: float, k: float, numbers: Numbers) -> Pair:
        theta = k * command_m
        ia, ib = shaped(theta, math.cos(theta), math.sin(theta), numbers)
        return ia * gain, ib * gain

    return setpoints
