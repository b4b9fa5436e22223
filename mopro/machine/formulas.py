"""Effects that a motor's file or an experiment on it states as formulas."""

from __future__ import annotations

from mopro.errors import ModelError
from mopro.formula.dimension import Dimension, dimension_of_unit
from mopro.formula.entry import Host, read_effects
from mopro.formula.expressions import PI
from mopro.formula.written import COMMAND, FORCE, FRICTION, MEASUREMENT, WrittenEffect
from mopro.tomlfile import Value

PLACES = (FORCE, FRICTION, COMMAND, MEASUREMENT)
_PLACE, _SPEED, _RATE = map(dimension_of_unit, ("m", "m/s", "m/s2"))
_NEWTON, _SECOND, _KELVIN = map(dimension_of_unit, ("N", "s", "K"))
_MOTION = {"x": _PLACE, "v": _SPEED}
_IN_TIME = {**_MOTION, "a": _RATE, "t": _SECOND}
# What a formula may name beside its parameters, and its dimension, by where it enters.
NAMES: dict[str, dict[str, Dimension]] = {
    FORCE: {**_MOTION, "motor": _NEWTON},
    FRICTION: {**_MOTION, "motor": _NEWTON},
    COMMAND: _IN_TIME,
    MEASUREMENT: {**_IN_TIME, "y": _PLACE, "T": _KELVIN},
}
_WANTED = {FORCE: _NEWTON, FRICTION: _NEWTON, COMMAND: _PLACE, MEASUREMENT: _PLACE}
# What a section `[effects.NAME]`, or a setting of a fit, has beside parameters.
_BESIDE = ("axes", "axis", "run")
_RESERVED = frozenset([PI, *_BESIDE]).union(*NAMES.values())
_HOST = Host("sawyer", PLACES, frozenset(), _RESERVED)


def read_formulas(root: Value) -> tuple[WrittenEffect, ...]:
    """The `[[effect]]` sections of a file, their names and units checked; faults are noted."""
    effects = read_effects(root, _HOST)
    for effect in effects:
        try:
            _check(effect)
        except ModelError as error:
            root.include(error)
    return effects


def _check(effect: WrittenEffect) -> None:
    assert effect.value is not None, "it was read from a file"
    for key in ("form", "extends", "driven", "rotary", "angular"):
        if key in effect.value:
            message = f"{key} is of effects of other kinds of machine"
            raise effect.value[key].error(message, "unknown-key")
    own = {p.name: dimension_of_unit(p.unit) for p in effect.parameters}
    what = f"what enters as {effect.enters}"
    effect.term.check(NAMES[effect.enters] | own, _WANTED[effect.enters], what)
    if effect.term.formula.of_signals and effect.enters in (FORCE, FRICTION):
        message = "lag, delayed, play and the like act on whole signals, not inside an equation"
        raise effect.value["formula"].error(message, "bad-formula")
