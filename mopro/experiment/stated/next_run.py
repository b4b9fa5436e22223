"""The run of another motion that best tells the alternatives of a verdict apart."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.series import Settings, key_of
from mopro.engine.verdict import Named, Verdict
from mopro.experiment.separation import (
    AMPLE_SIGMAS,
    LEAST_SIGMAS,
    family_pairs,
    from_named,
    score,
    separation_words,
    sigma_words,
    size_error,
)
from mopro.experiment.stated.other_motions import driving
from mopro.experiment.stated.other_runs import Apart, OtherRun, other_runs, states
from mopro.experiment.system import Proposal
from mopro.formula import factor_of
from mopro.formula.evaluate import Floats
from mopro.stated.data import Run
from mopro.stated.model import KINEMATIC
from mopro.stated.simulation import Model

_SPEED = "v"
_Ends = tuple[float, float]


@dataclass(frozen=True)
class _Pair:
    """Two effects of a family, the settings with either, and the share that sizes are known to."""

    names: tuple[str, str]
    one: Settings
    other: Settings
    size_error: float

    def apart(self, run: OtherRun, base: Settings) -> Apart:
        return run.apart(self.one, self.other, base, self.size_error)


def propose(model: Model, verdict: Verdict) -> Proposal | None:
    """The run that best separates the named effects from their alternatives, with its command.

    It stays within the places and the forces of the log, or the stated range of a sensor of the
    place. It is as fast as the log and as loaded, unless one of twice as much tells more. None if
    no run separates any of them by more than the least.
    """
    pairs = [pair for effect in verdict.effects for pair in _pairs(verdict, effect)]
    runs = other_runs(model, verdict) if pairs else []
    if not runs:
        return None
    apart = [[pair.apart(run, verdict.base_before) for pair in pairs] for run in runs]
    sigmas = np.array([[own.sigmas for own in of_run] for of_run in apart])
    shown = _Shown.of(model, verdict.settings)
    usable = [nth for nth, run in enumerate(runs) if shown.holds(run, pairs)]
    named = frozenset(effect.name for effect in verdict.effects)

    def worth(nth: int) -> tuple[float, bool, float, float]:
        run, own = runs[nth], sigmas[nth]
        enough = float(score(own**2))
        return enough, shown.has(run, pairs), -run.duration_s, float(own.min())

    best = max(usable, key=worth, default=None)
    if best is None:
        return None
    own = dict(zip((pair.names for pair in pairs), sigmas[best].tolist(), strict=True))
    if max(from_named(own, named).values()) <= LEAST_SIGMAS:
        return None
    run = runs[best]
    summary = (
        f"{run.run.name} again, {run.motion.words}, {run.duration_s:.4g} s: "
        f"{separation_words(own, named)}"
    )
    return Proposal(
        _command_text(model, run.run, summary), summary, None, from_named(own, named), own,
        suffix=".csv", partings=dict(_partings(pairs, runs, sigmas, named)),
    )  # fmt: skip


def _pairs(verdict: Verdict, effect: Named) -> Iterator[_Pair]:
    """All pairs of an effect and its alternatives."""
    for (name, one), (rival, other) in family_pairs(verdict, effect):
        yield _Pair((name, rival), one, other, size_error(effect))


def _partings(
    pairs: Sequence[_Pair], runs: Sequence[OtherRun], sigmas: Floats, named: frozenset[str]
) -> Iterator[tuple[tuple[str, str], str]]:
    """In words, the first motion that separates each alternative amply from its effect.

    The best one where none does; whatever the log shows. None for those that no motion separates.
    """
    for pair, own in zip(pairs, sigmas.T, strict=True):
        best = int(np.argmax(np.minimum(own, AMPLE_SIGMAS)))
        if pair.names[0] in named and own[best] > LEAST_SIGMAS:
            yield pair.names, f"a run {runs[best].motion.words} differs by {sigma_words(own[best])}"


# -- what the log shows -----------------------------------------------------------------------


@dataclass(frozen=True)
class _Shown:
    """The ends (SI) of what the log shows: of the states of the machine, and of its inputs."""

    states: dict[str, _Ends]
    inputs: dict[str, _Ends]

    @staticmethod
    def of(model: Model, settings: Settings) -> _Shown:
        runs = model.experiment.trials
        every = [states(model, run, settings) for run in runs]
        seen = {name: _ends([own[name] for own in every]) for name in every[0]}
        inputs = {name: _ends([run.inputs[name] for run in runs]) for name in runs[0].inputs}
        if model.machine.kind != KINEMATIC:
            # A force may be had either way.
            inputs |= {name: _either_way(inputs[name]) for name in driving(model) & inputs.keys()}
        if _SPEED in seen:
            seen[_SPEED] = _either_way(seen[_SPEED])
        if "x" in seen:
            seen["x"] = _ends([np.array(seen["x"]), *_stated_ranges(model)])
        return _Shown(seen, inputs)

    def holds(self, run: OtherRun, pairs: Sequence[_Pair]) -> bool:
        """True if it leaves neither the places nor the drive of the log, whichever set is true."""
        held = self.states.keys() - {_SPEED}
        driven = driving(run.model) & self.inputs.keys()
        return all(_within(run.run.inputs[n], self.inputs[n]) for n in driven) and all(
            _within(own[name], self.states[name]) for own in _each(run, pairs) for name in held
        )

    def has(self, run: OtherRun, pairs: Sequence[_Pair]) -> bool:
        """True if it is neither faster nor more loaded than the log."""
        loads = self.inputs.keys() - driving(run.model)
        fast = self.states.keys() & {_SPEED}
        return all(_within(run.run.inputs[n], self.inputs[n]) for n in loads) and all(
            _within(own[name], self.states[name]) for own in _each(run, pairs) for name in fast
        )


def _each(run: OtherRun, pairs: Sequence[_Pair]) -> Iterator[dict[str, Floats]]:
    """States (rows, SI) of the machine in a run, as each set of the pairs predicts them."""
    sides = {key_of(side): side for pair in pairs for side in (pair.one, pair.other)}
    for settings in sides.values():
        yield states(run.model, run.run, settings)


def _ends(arrays: Sequence[Floats]) -> _Ends:
    return min(float(own.min()) for own in arrays), max(float(own.max()) for own in arrays)


def _either_way(ends: _Ends) -> _Ends:
    most = max(map(abs, ends))
    return -most, most


def _stated_ranges(model: Model) -> Iterator[Floats]:
    """The ends (SI) of what each sensor of a place is stated to cover."""
    for _, reading in model.readings:
        sensor = reading.sensor
        if sensor.quantity.tells_place and isinstance(sensor.tolerances.range, tuple):
            yield np.array(sensor.tolerances.range) * sensor.factor / (sensor.scale or 1.0)


def _within(values: Floats, ends: _Ends) -> bool:
    """True if the values are between the ends, but for a tenth of their distance."""
    low, high = ends
    reach = LEAST_SHARE * (high - low) + math.ulp(max(map(abs, ends)))
    return bool(np.all((values >= low - reach) & (values <= high + reach)))


# -- text ---------------------------------------------------------------------------------------


def _command_text(model: Model, run: Run, summary: str) -> str:
    """A CSV file of the times and inputs of a run, under the names and in the units of its log."""
    columns = {"t": run.time_s, **run.inputs}
    units = {"t": "s", **model.experiment.units}
    names, values = [], []
    for name, own in columns.items():
        column, factor = run.headings.get(name, (f"{name}_{units[name]}", factor_of(units[name])))
        names.append(column)
        values.append(own / factor)
    read = ", ".join(reading.sensor.column for reading in run.readings)
    head = [f"# {summary}", f"# Add what is measured ({read}), and the file as a [[run]]."]
    rows = (",".join(f"{value:.9g}" for value in row) for row in zip(*values, strict=True))
    return "\n".join([*head, ",".join(names), *rows]) + "\n"
