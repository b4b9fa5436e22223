"""Waves in place and in time, which are one where all runs move at one speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.engine.assumed import VERY_STRONG
from mopro.engine.series import Series, Settings
from mopro.engine.verdict import Named, Verdict, rms
from mopro.experiment.stated.repaired import corrects
from mopro.formula.evaluate import Floats
from mopro.formula.expressions import parse, substituted
from mopro.formula.written import AMPLITUDE, MEASUREMENT, PERIOD, WrittenEffect
from mopro.stated.model import KINEMATIC
from mopro.stated.simulation import Known, Model, term_of

_NOTE = (
    "all runs move at one speed, where a wave in place is one in time: {}; a run at another speed "
    "tells which"
)


def at_one_speed(model: Model, series: Sequence[Series], verdict: Verdict) -> Verdict:
    """The verdict with each wave in place as ambiguous with the same one in time, and the reverse.

    A search tells such alternatives by the names in a set, which stay if two waves change places.
    """
    if model.machine.kind != KINEMATIC or model.foreign is not None:
        return verdict
    sigmas = [s.sigma or rms(left) for s, left in zip(series, verdict.after, strict=True)]
    # A number of the machine beyond its tolerance is named as well, and has no form.
    waves = [e for e in verdict.effects if not corrects(model.machine, e.name)]
    twins = {e.name: t for e in waves if (t := _twin(model, e, verdict, sigmas))}
    kept = {e.name for e in verdict.effects} - twins.keys()
    # A name stands once in a set.
    twins = {name: twin for name, twin in twins.items() if twin[0].name not in kept}
    if not twins:
        return verdict
    exchanged = {n: own for n, own in verdict.settings.items() if n not in twins}
    exchanged |= {twin.name: own for twin, own in twins.values()}
    effects = tuple(
        e.with_rival(twins[e.name][0].name, 0.0, exchanged) if e.name in twins else e
        for e in verdict.effects
    )
    others = dict.fromkeys([*verdict.alternatives, _names(verdict, twins)])
    word = "ambiguous" if verdict.verdict == "named" else verdict.verdict
    pairs = " and ".join(_words(model, verdict, name, twins[name]) for name in sorted(twins))
    return replace(
        verdict, verdict=word, effects=effects, alternatives=tuple(others),
        notes=(*verdict.notes, _NOTE.format(pairs)),
    )  # fmt: skip


_Twin = tuple[WrittenEffect, Mapping[str, float]]


def _names(verdict: Verdict, twins: Mapping[str, _Twin]) -> tuple[str, ...]:
    """The names of the answer with each wave as the other kind."""
    named = (twins[e.name][0].name if e.name in twins else e.name for e in verdict.effects)
    return tuple(sorted(named))


def _words(model: Model, verdict: Verdict, name: str, twin: _Twin) -> str:
    own = model.form(name, verdict.settings[name].keys())
    periods = (_period(own, verdict.settings[name]), _period(*twin))
    return " is ".join(periods)


def _period(effect: WrittenEffect, values: Mapping[str, float]) -> str:
    p = next(p for p in effect.parameters if p.role == PERIOD)
    return f"{values[p.name]:.4g} {p.unit}"


def _twin(model: Model, effect: Named, verdict: Verdict, sigmas: list[float]) -> _Twin | None:
    """The wave in the other variable that predicts the same, with its values; None without any.

    Its period is by the speed of all runs, its sizes by least squares.
    """
    own = model.form(effect.name, verdict.settings[effect.name].keys())
    other = _of_other_variable(model, own)
    speed = _speed(model, verdict.settings) if other is not None else 0.0
    if other is None or not speed:
        return None
    period = next(p for p in own.parameters if p.role == PERIOD)
    length = verdict.settings[own.name][period.name] * period.factor
    length = length / speed if _variable(own) == "x" else length * speed
    values = {period.name: length} | {p.name: 0.0 for p in other.parameters if p.role == AMPLITUDE}
    sizes = [name for name in values if name != period.name]
    shown = _Shown(model, own, verdict.settings, sigmas)
    wanted = shown.term(own, _in_si(own, verdict.settings[own.name]))
    columns = [shown.term(other, {**values, name: 1.0}) for name in sizes]
    basis = np.stack(columns, axis=1)
    found = np.linalg.lstsq(basis, wanted, rcond=None)[0]
    if float(np.sum((wanted - basis @ found) ** 2)) > VERY_STRONG:
        return None
    factors = {p.name: p.factor for p in other.parameters}
    values |= dict(zip(sizes, found.tolist(), strict=True))
    return other, {name: value / factors[name] for name, value in values.items()}


def _in_si(effect: WrittenEffect, values: Mapping[str, float]) -> dict[str, float]:
    return {p.name: values.get(p.name, 0.0) * p.factor for p in effect.parameters}


def _variable(effect: WrittenEffect) -> str:
    return "x" if "x" in effect.term.formula.names else "t"


def _of_other_variable(model: Model, effect: WrittenEffect) -> WrittenEffect | None:
    """The effect with the same formula of time in the place of place, or the reverse."""
    roles = [p.role for p in effect.parameters]
    if effect.enters != MEASUREMENT or roles.count(PERIOD) != 1 or len(set(roles)) != 2:
        return None
    one, other = ("x", "t") if _variable(effect) == "x" else ("t", "x")
    wanted = substituted(effect.term.formula, {one: parse(other)}).text
    for form in model.forms:
        same = substituted(form.term.formula, {}).text == wanted
        if same and form.target == effect.target and form.name != effect.name:
            return form
    return None


def _moved(model: Model, settings: Settings) -> Iterator[tuple[Floats, Floats]]:
    """Times (s) and places (SI) of the samples of each reading."""
    for run, reading in model.readings:
        x = model.motion(run, settings).states["x"]
        yield run.time_s[reading.rows], x[reading.rows]


def _speed(model: Model, settings: Settings) -> float:
    """The size of the speed of all runs (SI), by a straight line through place against time."""
    times, places = (np.concatenate(own) for own in zip(*_moved(model, settings), strict=True))
    return abs(float(np.polyfit(times, places, 1)[0])) if np.ptp(times) else 0.0


@dataclass(frozen=True)
class _Shown:
    """The samples that show an effect `of` the measurement, over their noise."""

    model: Model
    of: WrittenEffect
    settings: Settings
    sigmas: Sequence[float]

    def term(self, effect: WrittenEffect, values: Mapping[str, float]) -> Floats:
        """The term of an effect at all these samples, without free zeros."""
        model, parts = self.model, []
        for (run, reading), sigma in zip(model.readings, self.sigmas, strict=True):
            sensor = reading.sensor
            if model.shows(self.of, sensor) and self.of.name not in run.without:
                known: Known = {
                    **model.values_in(run, self.settings),
                    **model.values(self.settings),
                }
                term = term_of(effect, values, known, run.time_s)[reading.rows]
                term = term * (sensor.scale or 1.0) / (sensor.factor * (sigma or 1.0))
                parts.append(term - term.mean() if sensor.zero is None else term)
        return np.concatenate(parts)
