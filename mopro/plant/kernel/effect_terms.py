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
    from mopro.effects.effect import Active, Effect

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
    parts = [
        _force(effect, i, states.get(i), prepare, term)
        for i, effect in enumerate(terms.effects)
        for term in (effect.force, effect.reaction)
        if term is not None
    ]
    if not parts:
        return prepare(_no_force)
    total = parts[0]
    for part in parts[1:]:
        total = prepare(_sum(total, part))
    return total


def _no_force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
    return 0.0


def _force(
    effect: Effect, i: int, j: int | None, prepare: Prepare, term: Callable[..., float]
) -> Forces:
    """The `term` of effect `i`, whose state, if it has one, is the state number `j`.

    It is skipped where the effect is there for the sake of its kernel group only.
    """
    of_motor, term = term is effect.reaction, prepare(term)
    slide, has_state = prepare(effect.slide) if effect.slide else term, effect.slide is not None
    skippable, first, first_null, last, last_null = _absence(effect)
    state = 0 if j is None else j

    def force(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        own = numbers[i]
        if skippable and own[first] == first_null and own[last] == last_null:
            return 0.0
        if has_state:
            if of_motor:
                return term(x, v, slide(z[state], dx, *own), motor_N, *own)
            return term(x, v, slide(z[state], dx, *own), *own)
        if of_motor:
            return term(x, v, motor_N, *own)
        return term(x, v, *own)

    return prepare(force)


def _absence(effect: Effect) -> tuple[bool, int, float, int, float]:
    """True if the effect can be absent, and places and nulls of its two sizes."""
    absent_at = effect.absent_at
    return (True, *absent_at[0], *absent_at[1]) if absent_at else (False, 0, 0.0, 0, 0.0)


def _sum(one: Forces, other: Forces) -> Forces:
    def total(motor_N: float, x: float, v: float, z: Path, dx: float, numbers: Numbers) -> float:
        return one(motor_N, x, v, z, dx, numbers) + other(motor_N, x, v, z, dx, numbers)

    return total


def slides(terms: TermSet, prepare: Prepare) -> Slides:
    """All states that follow the path after a further way of dx (m)."""
    advanced: Slides = prepare(_no_states)
    for j, i in enumerate(terms.on_path):
        advanced = prepare(_advanced(advanced, terms.effects[i], i, j, prepare))
    return advanced


def _no_states(z: Path, dx: float, numbers: Numbers) -> Path:
    return ()


def _advanced(before: Slides, effect: Effect, i: int, j: int, prepare: Prepare) -> Slides:
    """The states of `before` and that of effect `i`, number `j`, which an absent one keeps."""
    assert effect.slide is not None, "its place is one of those with such a state"
    slide = prepare(effect.slide)
    skippable, first, first_null, last, last_null = _absence(effect)

    def advanced(z: Path, dx: float, numbers: Numbers) -> Path:
        own = numbers[i]
        if skippable and own[first] == first_null and own[last] == last_null:
            return (*before(z, dx, numbers), z[j])
        return (*before(z, dx, numbers), slide(z[j], dx, *own))

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
