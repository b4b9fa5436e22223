"""Answer of the engine: verdict, effects with their evidence, gaps, and its JSON."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mopro.engine.residuals import Remainder, Residuals
from mopro.engine.series import Floats, Series, Settings, Simulate


def section(title: str, parts: Iterable[str]) -> str:
    """A heading in bold type with `parts` of HTML below it."""
    return f"<div><strong>{_escaped(title)}</strong>{''.join(parts)}</div>"


def paragraph(text: str) -> str:
    return f"<p>{_escaped(text)}</p>"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{_escaped(column)}</th>" for column in columns)
    body = ("".join(f"<td>{_escaped(cell)}</td>" for cell in row) for row in rows)
    lines = "".join(f"<tr>{cells}</tr>" for cells in body)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"


def _escaped(text: str) -> str:
    """`text` for the inside of an element; characters that do not print as an escape."""
    printed = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return html.escape("".join(printed))


_EFFECTS_SHOWN = (
    "effect", "parameter", "value", "95 % interval", "σ in all", "log10 Bayes", "held out",
)  # fmt: skip
_GAPS_SHOWN = ("run", "sensor", "before", "after", "noise")


@dataclass(frozen=True)
class Estimate:
    """Value of a parameter with its 95 % interval, both in `unit`.

    The interval is infinite where the data do not bound it, and not a number where a search
    found the value. `at_bound`: the fit was stopped by an end of the parameter's range.
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class Named:
    """A supported effect, with the alternatives that the data cannot distinguish from it.

    `rivals`: EBIC of each alternative above that of the effect, within 10. `alternatives`: all
    settings with the alternative in the place of the effect. `log10_bayes_factor`: half the
    EBIC that the effect saves, over ln 10 (Kass and Raftery 1995). `sigmas`: root of the
    chi-squared that it explains. `held_out`: parts that were not fitted are predicted better
    with it. `run`: the only run in which it is on.
    """

    name: str
    form: str
    parameters: dict[str, Estimate]
    indistinguishable_from: list[str]
    rivals: dict[str, float]
    alternatives: dict[str, Settings]
    log10_bayes_factor: float
    sigmas: float
    held_out: bool
    run: str | None = None

    def with_rival(self, rival: str, delta_ebic: float, settings: Settings) -> Named:
        """This effect with one more alternative, unless it is known as one."""
        if rival in self.rivals:
            return self
        return replace(
            self,
            indistinguishable_from=[*self.indistinguishable_from, rival],
            rivals={**self.rivals, rival: delta_ebic},
            alternatives={**self.alternatives, rival: settings},
        )


@dataclass(frozen=True)
class Alike:
    """A set of effects that predicts these data as the answer does, to what a model is exact to.

    `delta_ebic`: its EBIC above that of the answer. `settings`: as it was fitted.
    """

    names: frozenset[str]
    delta_ebic: float
    settings: Settings


@dataclass(frozen=True)
class Draft:
    """A free-form term that describes what no listed effect explains.

    `enters`, `of` and `run` as those of `Law`; `law`: its formula, whose values are in `unit`.
    `held_out` and `parameters` as those of `Named`.
    """

    name: str
    enters: str
    of: str
    law: str
    unit: str
    sigmas: float
    held_out: bool
    run: str | None = None
    parameters: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True)
class Explained:
    """Share of the excess over noise that the effects explain, and that in held-out parts."""

    share: float | None
    held_out_share: float | None


@dataclass(frozen=True)
class Rejected:
    """A candidate that the data do not support, and why; `gain` is its reduction of chi-squared."""

    name: str
    gain: float
    reason: str


@dataclass(frozen=True)
class OddRun:
    """The run that disagrees with a model with which the others agree.

    `scatter`: RMS of what the model leaves there, in standard deviations of the noise; `others`:
    that of the other runs. `description` and `variable`: the clearest shape in it.
    """

    run: str
    scatter: float
    others: float
    description: str
    variable: str | None


@dataclass(frozen=True)
class Taken:
    """Entry of the trace: a pass, the effects of the answer before and after it, the EBIC, and why.

    The EBIC is infinite where the answer has a number at the end of a range that it must not reach.
    """

    name: str
    before: tuple[str, ...]
    after: tuple[str, ...]
    ebic: float
    why: str

    @property
    def decides(self) -> bool:
        """True if the answer is another one after it, or something was found out."""
        return self.before != self.after or bool(self.why)

    def as_json(self) -> dict[str, Any]:
        return {
            "pass": self.name, "before": list(self.before), "after": list(self.after),
            "ebic": self.ebic if math.isfinite(self.ebic) else None, "why": self.why,
        }  # fmt: skip


@dataclass(frozen=True)
class BelowResolution:
    """An effect that these data could not show at any plausible size.

    `expected_sigmas`: root of the chi-squared of the largest plausible one; `needed_sigmas`:
    root of its penalty.
    """

    name: str
    expected_sigmas: float
    needed_sigmas: float


@dataclass(frozen=True)
class Where:
    """RMS residual of one series before any effect is added, and its noise, in its unit."""

    run: str
    sensor: str
    rms: float
    sigma: float | None


@dataclass(frozen=True)
class RunGap:
    """RMS residuals of one series, in its own unit."""

    run: str
    sensor: str
    unit: str
    before_rms: float
    after_rms: float
    held_out_rms: float | None
    noise_rms: float | None


@dataclass(frozen=True)
class Gap:
    """RMS of measured - simulated, in `unit`; `held_out_rms` that of parts not fitted."""

    unit: str
    before_rms: float
    after_rms: float
    noise_rms: float | None
    held_out_rms: float | None
    runs: tuple[RunGap, ...] = ()


@dataclass(frozen=True)
class Signature:
    """Change of each series by an effect, in its unit, and its reduction of chi-squared."""

    name: str
    changes: tuple[Floats, ...]
    gain: float


@dataclass(frozen=True)
class Verdict:
    """`none`, `named`, `ambiguous` or `unexplained`, and the evidence for it.

    `before` and `after`: the residual of each series, in its unit, without and with the
    effects. `settings`: all that was fitted but drafts, and as it was fitted beside those.
    `without_drafts`: the same as it fits without them, where there are any.
    `next_experiment`: a program that would distinguish alternatives, if the caller writes one.
    `calibration`: corrections of the model's own numbers within their tolerances, which are no
    findings. `sensors`: those of the sensors, within theirs, and of their zeros; the form is the
    name of the sensor. `alternatives`: sets of effects within 10 of the answer's EBIC, the lowest
    first. `alike`: others that predict the same here, whatever their EBIC: they are alternatives
    where other motions of the machine tell them from the answer. `base`: the model's free numbers,
    `base_before` those without effects. `drafts`: free-form terms beside the effects or, if the
    verdict is `ambiguous`, of a set that does as well. `notes`: remarks on the noise, and on that
    set. `nuisances`: the fitted coefficients of each series' nuisances, in its unit. `correlations`
    of the estimates, by `effect.parameter`.
    `odd_run`: the run that alone disagrees with all runs' model. `trace`: what each pass did.
    `held_out_on`: what was held out, `other runs` or parts `within one run`; None if nothing was.
    """

    verdict: str
    effects: tuple[Named, ...]
    rejected: tuple[Rejected, ...]
    below_resolution: tuple[BelowResolution, ...]
    where: tuple[Where, ...]
    gap: Gap
    remainder: Remainder
    settings: Settings
    before: tuple[Floats, ...] = ()
    after: tuple[Floats, ...] = ()
    signatures: tuple[Signature, ...] = ()
    next_experiment: str | None = None
    calibration: tuple[Named, ...] = ()
    sensors: tuple[Named, ...] = ()
    explained: Explained = Explained(None, None)
    alternatives: tuple[tuple[str, ...], ...] = ()
    base: Mapping[str, Estimate] = field(default_factory=dict)
    base_before: Settings = field(default_factory=dict)
    drafts: tuple[Draft, ...] = ()
    notes: tuple[str, ...] = ()
    nuisances: tuple[Floats, ...] = ()
    correlations: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    without_drafts: Settings | None = None
    odd_run: OddRun | None = None
    trace: tuple[Taken, ...] = ()
    held_out_on: str | None = None
    alike: tuple[Alike, ...] = ()

    @property
    def settings_alone(self) -> Settings:
        """The fitted settings to predict with where no draft is added."""
        return self.settings if self.without_drafts is None else self.without_drafts

    @property
    def unrepaired(self) -> Verdict:
        """The verdict without anything that was fitted, as the model came in."""
        return replace(
            self, effects=(), calibration=(), sensors=(), base={}, drafts=(), settings={},
            without_drafts=None,
        )  # fmt: skip

    def predict(self, simulate: Simulate, data: Sequence[Series]) -> tuple[RunGap, ...]:
        """Gap of each series of runs that were not fitted, before and after the effects.

        `simulate` predicts `data` as it does for `reconcile`. The settings of this verdict,
        without drafts, are kept; only the nuisances of each series (an offset) are its own.
        """
        residuals = Residuals(simulate, data, scaled_at=self.base_before)
        residuals = residuals.calibrated_at(self.base_before)
        models = (self.base_before, self.settings_alone)
        before, after = (residuals.in_units(residuals.at(settings)) for settings in models)
        return tuple(
            RunGap(s.run, s.sensor, s.unit, rms(b), rms(a), None, s.sigma)
            for s, b, a in zip(data, before, after, strict=True)
        )

    def __str__(self) -> str:
        """The verdict, a line for each number of the effects and each gap, and remarks."""
        lines = [f"Verdict: {self.verdict}"]
        for name, parameter, value, interval, *_ in _effect_cells(self.fitted):
            lines.append(f"{name}: {parameter} = {value} ({interval})")
        for run, sensor, before, after, noise in _gap_cells(self.gap.runs):
            lines.append(f"{run}, {sensor}: rms {before} before, {after} after, noise {noise}")
        return "\n".join([*lines, *self._remarks()])

    def _repr_html_(self) -> str:
        """Effects with their evidence, the gap, alternatives and notes."""
        parts = [table(_EFFECTS_SHOWN, _effect_cells(self.fitted))] if self.fitted else []
        parts.append(table(_GAPS_SHOWN, _gap_cells(self.gap.runs)))
        return section(f"Verdict: {self.verdict}", [*parts, *map(paragraph, self._remarks())])

    def _remarks(self) -> list[str]:
        """Calibrations, alternatives, drafts, what stays unexplained and notes, in sentences."""
        said = [f"Calibrated: {own.name} of {own.form}." for own in self.sensors]
        said += [f"As good an explanation: {' and '.join(n)}." for n in self.alternatives]
        said += [f"{self.odd_run.run} alone disagrees."] if self.odd_run else []
        said += [f"In no catalogue: {d.law} {d.unit}, of {d.of}." for d in self.drafts]
        if self.remainder.significant:
            said.append(f"Unexplained: {self.remainder.description}.")
        return said + [f"{note[:1].upper()}{note[1:]}." for note in self.notes]

    @property
    def fitted(self) -> tuple[Named, ...]:
        """All that was added to the model: the effects and the calibrations."""
        return (*self.effects, *self.calibration)

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "effects": [_effect_json(effect) for effect in self.effects],
            "calibration": [
                *map(_effect_json, self.calibration),
                *({**_effect_json(each), "sensor": each.form} for each in self.sensors),
            ],
            "where": [vars(where) for where in self.where],
            "gap": {
                "unit": self.gap.unit,
                "before_rms": self.gap.before_rms,
                "after_rms": self.gap.after_rms,
                "noise_rms": self.gap.noise_rms,
                "held_out": self.gap.held_out_rms is not None,
                "held_out_rms": self.gap.held_out_rms,
                "held_out_on": self.held_out_on,
                "runs": [vars(run) for run in self.gap.runs],
            },
            "remainder": {
                "significant": self.remainder.significant,
                "description": self.remainder.description,
                "scatter_sigma": self.remainder.scatter,
                "variable": self.remainder.variable,
                "beside_drafts": self.remainder.beside_drafts,
            },
            "odd_run": None
            if self.odd_run is None
            else {
                "run": self.odd_run.run,
                "description": self.odd_run.description,
                "scatter_sigma": self.odd_run.scatter,
                "others_scatter_sigma": self.odd_run.others,
            },
            "rejected": [vars(rejected) for rejected in self.rejected],
            "below_resolution": [vars(faint) for faint in self.below_resolution],
            "next_experiment": self.next_experiment,
            "explained": vars(self.explained),
            "alternatives": [list(names) for names in self.alternatives],
            "base": {name: _estimate_json(e) for name, e in self.base.items()},
            "drafts": [
                {
                    "enters": d.enters,
                    "of": d.of,
                    "law": d.law,
                    "unit": d.unit,
                    "sigmas": d.sigmas,
                    "held_out": d.held_out,
                    "confirmed": False,
                    **({} if d.run is None else {"run": d.run}),
                }
                for d in self.drafts
            ],
            "notes": list(self.notes),
            "correlations": {name: dict(row) for name, row in self.correlations.items()},
            "trace": [taken.as_json() for taken in self.trace],
        }


def _effect_cells(effects: Sequence[Named]) -> Iterator[list[str]]:
    for effect in effects:
        name = " or ".join([effect.name, *effect.indistinguishable_from])
        name += "" if effect.run is None else f" in {effect.run} only"
        held = "gains" if effect.held_out else "-"
        evidence = [f"{effect.sigmas:.3g}", f"{effect.log10_bayes_factor:.3g}", held]
        for parameter, estimate in effect.parameters.items():
            ends = [f"{end:.4g}" for end in estimate.ci95 if math.isfinite(end)]
            interval = " to ".join(ends) if len(ends) == 2 else "-"
            value = f"{estimate.value:.4g} {estimate.unit}"
            yield [name, parameter, value, interval, *evidence]


def _gap_cells(runs: Sequence[RunGap]) -> Iterator[list[str]]:
    for run in runs:
        sizes = (run.before_rms, run.after_rms, run.noise_rms)
        shown = ["unknown" if size is None else f"{size:.3g} {run.unit}" for size in sizes]
        yield [run.run, run.sensor, *shown]


def rms(values: Floats) -> float:
    return math.sqrt(float(np.mean(values**2)))


def _estimate_json(e: Estimate) -> dict[str, Any]:
    return {"value": e.value, "unit": e.unit, "ci95": list(e.ci95), "at_bound": e.at_bound}


def _effect_json(effect: Named) -> dict[str, Any]:
    return {
        "name": effect.name,
        "form": effect.form,
        "indistinguishable_from": effect.indistinguishable_from,
        "parameters": {name: _estimate_json(e) for name, e in effect.parameters.items()},
        "evidence": {
            "log10_bayes_factor": effect.log10_bayes_factor,
            "sigmas": effect.sigmas,
            "held_out": effect.held_out,
            "rivals": effect.rivals,
        },
        **({} if effect.run is None else {"run": effect.run}),
    }
