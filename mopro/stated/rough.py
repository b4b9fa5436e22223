"""A machine of which only the kind is known: its law and its free numbers, about what data show.

First values come from a straight regression on the data, integrated in time, so that noise is
not magnified; ranges reach a factor of _REACH to either side.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.formula import dimension_of_unit, factor_of, inverse, product
from mopro.formula.evaluate import Floats
from mopro.instruments.quantity import AXIS_UNITS
from mopro.stated.rates import GAP

_REACH = 30.0
# A spring is a part of the model where it leaves less than this share of a regression's squares.
_SPRUNG = 0.2
# Windows in a run at the least. Halved, a regression may follow a single bend; doubled, slow
# motions drown in the noise.
_WINDOWS = 8
# Time constants in a run where the regression gives no loss.
_SLOWEST = 3.0
_NEWTON, _NEWTON_METRE, _METRE, _RAD, _WATT = map(dimension_of_unit, ("N", "N m", "m", "rad", "W"))


@dataclass(frozen=True)
class Sampled:
    """Times (s) and values (SI) of a reading (n,), and the inputs at these times by name.

    `held`: names of inputs that keep their value until the next row. `first`: the value that it
    begins at, where the first one is wild.
    """

    time_s: Floats
    values: Floats
    inputs: Mapping[str, Floats]
    held: frozenset[str] = frozenset()
    first: float | None = None

    @property
    def risen(self) -> Floats:
        """The values less the first."""
        risen: Floats = self.values - (self.values[0] if self.first is None else self.first)
        return risen

    def pushed(self, name: str) -> Floats:
        """The integral of an input from the first time on."""
        return _integral(self.inputs[name], self.since_s, name in self.held)

    @property
    def since_s(self) -> Floats:
        """Times since the first."""
        since: Floats = self.time_s - self.time_s[0]
        return since


def _free(name: str, value: float, unit: str, signed: bool = False, low: float = 0.0) -> str:
    high = _REACH * abs(value)
    ends = f"[{-high if signed else low * abs(value):.4g}, {high:.4g}]"
    return f'{name} = {{ value = {value:.4g}, unit = "{unit}", free = true, range = {ends} }}'


# -- axis --------------------------------------------------------------------------------


def axis_lines(unit: str, units: Mapping[str, str], seen: Sampled, of_place: bool) -> list[str]:
    """Law and `[base]` of an axis in `unit`, driven by inputs in `units`, as lines of its file.

    `seen` is its place, or its speed unless `of_place`.
    """
    sizes = _sizes(seen, list(units), of_place)
    if pushed := _inertia_of(unit, units):
        return [*_of_pushes(list(units), sizes, *pushed)]
    return [*_of_gains(unit, units, sizes)]


def unit_of_speed(speed: str) -> str:
    """The SI unit of the place whose rate is in the unit `speed`."""
    own = dimension_of_unit(product(speed, "s"))
    return next(unit for unit in AXIS_UNITS if dimension_of_unit(unit) == own)


def _of_gains(unit: str, units: Mapping[str, str], sizes: _Sizes) -> Iterator[str]:
    terms = [f"gain_{name} * {name}" for name in units] + ["-damping * v"]
    yield f'acceleration = "{_sum([*terms, *(["-w2 * x"] if sizes.stiffness else [])])}"'
    yield "[base]"
    for (name, own), gain in zip(units.items(), sizes.gains, strict=True):
        stated = product(f"{unit}/s2", inverse(own))
        yield _free(f"gain_{name}", gain / factor_of(stated), stated, signed=True)
    yield _free("damping", sizes.damping, "1/s")
    if sizes.stiffness:
        yield _free("w2", sizes.stiffness, "1/s2")


def _of_pushes(names: Sequence[str], sizes: _Sizes, inertia: str, turns: bool) -> Iterator[str]:
    """The law and the numbers of an axis under forces, or torques if it `turns`."""
    mass = 1 / max(float(np.mean(np.abs(sizes.gains))), 1e-12)
    terms = [*names, "-viscous * v", *(["-spring * x"] if sizes.stiffness else [])]
    yield f'acceleration = "({_sum(terms)}) / {inertia}"'
    yield "[base]"
    yield _free(inertia, mass, "kg m2" if turns else "kg", low=1 / _REACH)
    yield _free("viscous", sizes.damping * mass, "N m s/rad" if turns else "N s/m")
    if sizes.stiffness:
        yield _free("spring", sizes.stiffness * mass, "N m/rad" if turns else "N/m")


def _sum(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def _inertia_of(unit: str, units: Mapping[str, str]) -> tuple[str, bool] | None:
    """The inertia's name, and whether it turns, if all inputs are forces or torques; else None."""
    dimensions = {dimension_of_unit(own) for own in units.values()}
    if dimension_of_unit(unit) == _METRE and dimensions == {_NEWTON}:
        return "mass", False
    turns = dimension_of_unit(unit) == _RAD and dimensions == {_NEWTON_METRE}
    return ("inertia", True) if turns else None


@dataclass(frozen=True)
class _Sizes:
    """Rough sizes (SI): accelerations for one unit of each input, damping and stiffness, over m.

    The stiffness is 0 unless the data ask for one.
    """

    gains: Sequence[float]
    damping: float
    stiffness: float


def _sizes(seen: Sampled, names: Sequence[str], of_place: bool) -> _Sizes:
    """Sizes by regression on the place, or on the speed.

    x = x0 + w t + sum of gain * input integrated twice - damping * integral of x - stiffness *
    x integrated twice + half the steady acceleration * t²; of a speed, the same integrated once
    less. Both sides are differenced over windows of several lengths, twice for a place, which
    removes x0 and w: an integral over the whole run would add up what is not linear. Windows with a
    gap in them are left out, as nobody knows what was integrated there. The length with the
    smallest share of squares left is taken.
    """
    times = 2 if of_place else 1
    time_s, measured = seen.since_s, seen.values
    pushed = [seen.pushed(name) for name in names]
    pushed = [_integral(p, time_s) for p in pushed] if of_place else pushed
    once = _integral(measured - measured[0], time_s)
    steady = time_s**times
    columns = [*pushed, -once, steady, -_integral(once, time_s)]
    plain, sprung = (np.inf, [0.0] * len(columns)), (np.inf, [0.0] * len(columns))
    gaps = _gaps_before(time_s)
    for window in _windows(len(time_s)):
        whole = gaps[times * window :] == gaps[: -times * window]
        if not whole.any():
            continue
        own, *others = (_differences(c, time_s, window, times)[whole] for c in (measured, *columns))
        plain = min(plain, _regressed(own, others[:-1]))
        sprung = min(sprung, _regressed(own, others))
    has_spring = sprung[0] < _SPRUNG * plain[0] and sprung[1][-1] > 0
    found = (sprung if has_spring else plain)[1]
    gains = [
        gain or (float(np.std(measured)) / (float(np.std(column)) or 1.0)) or 1.0
        for gain, column in zip(found, pushed, strict=False)
    ]
    damping = max(found[len(names)], _SLOWEST / max(float(time_s[-1]), 1e-9))
    return _Sizes(gains, damping, sprung[1][-1] if has_spring else 0.0)


def _windows(count: int) -> Iterator[int]:
    """Lengths of windows (samples): 1, and each power of 2 with `_WINDOWS` of them in `count`."""
    window = 1
    while window == 1 or window * _WINDOWS <= count:
        yield window
        window *= 2


def _gaps_before(time_s: Floats) -> Floats:
    """The number of gaps before each time."""
    steps = np.diff(time_s)
    found: Floats = np.cumsum(np.r_[0, steps > GAP * np.median(steps)])
    return found


def _differences(values: Floats, time_s: Floats, window: int, times: int) -> Floats:
    """Differences over `window` samples, or, if `times` is 2, those of the slopes over them."""
    apart: Floats = values[window:] - values[:-window]
    if times == 1:
        return apart
    slope: Floats = apart / (time_s[window:] - time_s[:-window])
    return slope[window:] - slope[:-window]


def _regressed(measured: Floats, columns: Sequence[Floats]) -> tuple[float, list[float]]:
    """The share of the squares that is left, and the factor of each column."""
    basis = np.stack(columns, axis=1)
    sizes = np.linalg.norm(basis, axis=0)
    sizes[sizes == 0] = 1.0
    found = np.linalg.lstsq(basis / sizes, measured, rcond=1e-9)[0] / sizes
    left = float(np.sum((measured - basis @ found) ** 2))
    return left / (float(measured @ measured) or 1.0), found.tolist()


def _integral(values: Floats, time_s: Floats, held: bool = False) -> Floats:
    """Integral from the first time on, of straight lines between values, or of steps if `held`."""
    means = values[:-1] if held else (values[1:] + values[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(np.diff(time_s) * means)])


# -- thermal -----------------------------------------------------------------------------


def thermal_lines(
    nodes: Sequence[str], units: Mapping[str, str], seen: Mapping[str, Sampled]
) -> Iterator[str]:
    """`[nodes]` and `[base]` of thermal nodes heated by inputs in `units`; `seen`: by node."""
    driven = _driven(nodes, list(units))
    powered = {dimension_of_unit(unit) for unit in units.values()} == {_WATT}
    gains, loss = _of_nodes(seen, driven)
    yield "[nodes]"
    for node in nodes:
        own = [n if powered else f"a_{n} * {n}" for n in driven.get(node, ())]
        heated = " + ".join(own) + " - " if own else "-"
        yield f'{node} = "{heated}{"loss" if powered else "U"} * (T - ambient)"'
    yield "[base]"
    if powered:
        capacity = 1 / float(np.mean(list(gains.values())))
        yield _free("capacity", capacity, "J/K", low=1 / _REACH)
        yield _free("loss", loss * capacity, "W/K")
        return
    for name, unit in units.items():
        stated = "K/s" if unit in ("1", "%") else product("K/s", inverse(unit))
        yield _free(f"a_{name}", gains[name] / factor_of(stated), stated)
    yield _free("U", loss, "1/s")


def _driven(nodes: Sequence[str], inputs: Sequence[str]) -> dict[str, list[str]]:
    """Inputs of each node: the node that bears the input's number, else the first one."""
    driven: dict[str, list[str]] = {}
    for name in inputs:
        digits = [c for c in name if c.isdigit()][:1]
        same = [node for node in nodes if digits and digits[0] in node]
        driven.setdefault((same or list(nodes))[0], []).append(name)
    return driven


def _of_nodes(
    seen: Mapping[str, Sampled], driven: Mapping[str, Sequence[str]]
) -> tuple[dict[str, float], float]:
    """Rates (K/s in SI) for one unit of each input, and the rate of loss (1/s), roughly.

    T = T0 + sum of gain * integral of input - loss * integral of T - T0.
    """
    gains: dict[str, float] = {}
    losses = [] if driven else [_SLOWEST / max(float(next(iter(seen.values())).since_s[-1]), 1e-9)]
    for node, names in driven.items():
        own = seen[node]
        risen = own.risen
        pushed = [own.pushed(name) for name in names]
        *found, loss = _regressed(risen, [*pushed, -_integral(risen, own.since_s)])[1]
        slowest = _SLOWEST / max(float(own.since_s[-1]), 1e-9)
        losses.append(loss if loss > slowest / _REACH else slowest)
        for name, gain, column in zip(names, found, pushed, strict=True):
            rough = float(np.ptp(risen)) / (float(np.ptp(column)) or 1.0)
            gains[name] = gain if gain > 0 else rough or 1.0
    return gains, float(np.mean(losses))
