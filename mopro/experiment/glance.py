"""The answer at a glance: what a person reads first, in the same words wherever it is shown."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mopro.engine.series import Series
from mopro.engine.verdict import RunGap, Verdict
from mopro.experiment.system import Proposal, Repaired, System
from mopro.experiment.wording import (
    AFTER,
    BEFORE,
    HELD_OUT,
    alternatives_words,
    calibration_words,
    draft_words,
    effect_words,
    left_out_words,
    odd_run_words,
    origin_words,
    parameters_shown,
    reservation,
    sentence,
    value_words,
)
from mopro.units import residual_unit

# The heading under which the page and the terminal have the text of the next experiment.
NEXT_EXPERIMENT = "The next experiment"
# Effects below resolution that are told by name: more of them would hide the rest.
_MOST_FAINT = 6
_TRY = (
    "Try the machine file (--out) on a run that was not fitted: "
    "mopro compare UNSEEN.toml --apply MACHINE.toml"
)
_AGAIN = "Measure again, to see whether it comes back: none of it belongs in the machine file."
_WITH_DRAFTS = (
    "Write what is not listed into the machine file (--with-drafts --out MACHINE.toml), and try it "
    "on a run that was not fitted: mopro compare UNSEEN.toml --apply MACHINE.toml"
)
_LOOK = (
    "Look for a cause of this shape, state it as an [[effect]] of the machine or correct the "
    "readings, and reconcile again."
)
_STATE_NOISE = "State the noise that the data show (mopro noise DATA.csv), and reconcile again."
_MEND = (
    "Mend the machine's file: --out would write none that predicts what the verdict says, and "
    "tells why."
)
_NOTHING = "Nothing is to be repaired."
_KEEP_FITTED = "Nothing is to be added: the machine file (--out) gets the numbers as fitted."


@dataclass(frozen=True)
class Found:
    """An effect of the answer and the sizes of its parameters, each with its interval."""

    effect: str
    sizes: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.effect}: {', '.join(self.sizes)}"


@dataclass(frozen=True)
class Step:
    """One RMS on the way from the residual as it was to the noise: what it is of, and its size."""

    of: str
    rms: str

    def __str__(self) -> str:
        return f"{self.of} {self.rms}"


@dataclass(frozen=True)
class Chain:
    """The RMS residuals of a sensor over all its runs, as they shrink."""

    sensor: str
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return f"{self.sensor}: {' → '.join(map(str, self.steps))}"


@dataclass(frozen=True)
class Glance:
    """The verdict's word and sentence, and what the sentence rests on.

    `beside` the effects: terms that are not listed, calibrations, candidates left out.
    `cannot_tell`: what these data do not decide. `next`: what to do.
    """

    verdict: str
    sentence: str
    effects: tuple[Found, ...]
    beside: tuple[str, ...]
    gap: tuple[Chain, ...]
    cannot_tell: tuple[str, ...]
    next: tuple[str, ...]

    def rows(self) -> Iterator[tuple[str, Sequence[Found | Chain | str]]]:
        """Label and lines of each part that has any, in the order to read them.

        `str` of a line is its text.
        """
        parts: tuple[tuple[str, Sequence[Found | Chain | str]], ...] = (
            ("Effects", (*self.effects, *self.beside)),
            ("Gap, RMS", self.gap),
            ("Cannot tell", self.cannot_tell),
            ("Next", self.next),
        )
        return (part for part in parts if part[1])

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def glance_of(
    verdict: Verdict,
    system: System,
    repaired: Repaired,
    proposal: Proposal | None,
    advice: str,
    left_out: Collection[str] = (),
    tried: Collection[str] = (),
) -> Glance:
    """The answer at a glance; the arguments are those of a `Conclusion`."""
    return Glance(
        verdict=verdict.verdict,
        sentence=sentence(verdict),
        effects=tuple(
            Found(
                effect_words(effect, verdict),
                tuple(
                    f"{name} = {value_words(estimate)} ({origin_words(estimate)})"
                    for name, estimate in parameters_shown(effect).items()
                ),
            )
            for effect in verdict.effects
        ),
        beside=(
            *draft_words(verdict),
            *calibration_words(verdict),
            *left_out_words(left_out, tried),
        ),
        gap=tuple(_chains(verdict, system.series)),
        cannot_tell=tuple(_cannot_tell(verdict, proposal)),
        next=(
            *odd_run_words(verdict),
            *([] if repaired.fault is None else [_MEND]),
            _next(verdict, system, proposal, advice),
        ),
    )


def _chains(verdict: Verdict, data: Sequence[Series]) -> Iterator[Chain]:
    """The gap of each sensor, over the samples of all its runs."""
    by_sensor: dict[tuple[str, str], list[tuple[RunGap, int]]] = {}
    for run, series in zip(verdict.gap.runs, data, strict=True):
        own = by_sensor.setdefault((run.sensor, run.unit), [])
        own.append((run, len(series.values[series.counted])))
    for (sensor, unit), runs in by_sensor.items():
        several = f", {len(runs)} runs" if len(runs) > 1 else ""
        yield Chain(f"{sensor}{several}", tuple(_steps(verdict, unit, runs)))


def _steps(verdict: Verdict, unit: str, runs: Sequence[tuple[RunGap, int]]) -> Iterator[Step]:
    """The RMS before and after the repair, in held-out parts if there are any, and of noise."""
    counts = [count for _, count in runs]

    def step(of: str, sizes: Sequence[float | None]) -> Step:
        known = [size for size in sizes if size is not None]
        if len(known) < len(sizes):
            return Step(of, "unknown")
        rms = math.sqrt(np.average(np.square(known), weights=counts))
        return Step(of, f"{rms:.3g} {residual_unit(unit)}")

    repaired = bool(verdict.fitted)
    yield step(BEFORE if repaired else "without a repair", [run.before_rms for run, _ in runs])
    if repaired:
        yield step(AFTER, [run.after_rms for run, _ in runs])
    if repaired and verdict.gap.held_out_rms is not None:
        yield step(HELD_OUT[verdict.held_out_on], [run.held_out_rms for run, _ in runs])
    yield step("noise alone", [run.noise_rms for run, _ in runs])


def _cannot_tell(verdict: Verdict, proposal: Proposal | None) -> Iterator[str]:
    """A line for each thing that the data leave undecided: alternatives, drafts, small effects."""
    partings = {} if proposal is None else proposal.partings
    for effect in verdict.fitted:
        if effect.rivals:
            yield f"{effect.name} from {alternatives_words(effect, partings)}"
    if verdict.verdict == "ambiguous" and verdict.drafts:
        names = " and ".join(effect.name for effect in verdict.effects)
        yield f"{names or 'noise'} from a term that is not listed"
    if verdict.below_resolution:
        nearest = sorted(
            verdict.below_resolution, key=lambda faint: faint.needed_sigmas - faint.expected_sigmas
        )
        names = ", ".join(faint.name for faint in nearest[:_MOST_FAINT])
        more = len(nearest) - _MOST_FAINT
        others = f" and {more} more" if more > 0 else ""
        yield f"whether there is {names}{others}: below the resolution of these data"
    if any(run.noise_rms is None for run in verdict.gap.runs):
        yield "how much of what is left is noise: its size is unknown"


def _next(verdict: Verdict, system: System, proposal: Proposal | None, advice: str) -> str:
    """The next step, by the verdict."""
    match verdict.verdict:
        case "ambiguous":
            return advice if proposal is None else _run_words(proposal)
        case "unexplained":
            return _after_unexplained(verdict, system)
        case "named":
            filed = [e for e in verdict.fitted if not reservation(e, verdict, system.runs)]
            return _TRY if filed else _AGAIN
        case _:
            return _after_none(verdict)


def _run_words(proposal: Proposal) -> str:
    if proposal.payload_kg is None:
        return f"Play the command under “{NEXT_EXPERIMENT}” (--next writes it): {proposal.summary}."
    separated = ", ".join(f"{name} by {size:.3g} σ" for name, size in proposal.separations.items())
    return (
        f"Run the program under “{NEXT_EXPERIMENT}” with {proposal.payload_kg:g} kg: "
        f"it should separate {separated}."
    )


def _after_unexplained(verdict: Verdict, system: System) -> str:
    if verdict.remainder.only_size:
        return _STATE_NOISE
    writable = (draft.run is None and draft.name in system.terms for draft in verdict.drafts)
    return _WITH_DRAFTS if any(writable) else _LOOK


def _after_none(verdict: Verdict) -> str:
    if verdict.remainder.note:
        return _STATE_NOISE
    return _KEEP_FITTED if verdict.base or verdict.calibration else _NOTHING
