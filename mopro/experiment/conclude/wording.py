"""A verdict in words, for the terminal and for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.diagnosis import Estimate, Named, Verdict
from mopro.experiment.compare.comparison import STEADY, Place
from mopro.experiment.predict.forward_model import RUN

NO_PROPOSAL = (
    "No program was found that would tell them apart with these sensors: measure something "
    "else, such as another quantity, another sensor, or the controller's own start."
)
_OFFSET = "sensor_offset"
_WAYS = {1: "forward", -1: "backward"}


def sentence(verdict: Verdict) -> str:
    """The verdict in one sentence."""
    names = ", ".join(" or ".join([e.name, *e.indistinguishable_from]) for e in verdict.effects)
    if verdict.verdict == "unexplained":
        beside = f" beside {names}" if names else ""
        return f"Unexplained{beside}: what is left looks like {verdict.remainder.description}."
    if verdict.verdict == "none" and verdict.gap.noise_rms is None:
        return "None: no effect is called for, as far as that shows with unknown noise."
    if verdict.verdict == "none" and verdict.calibration:
        corrected = " and ".join(effect.name for effect in verdict.calibration)
        return f"None: with {corrected} calibrated, simulation and data agree."
    if verdict.verdict == "none":
        return "None: simulation and data agree within the sensors' noise."
    return f"{verdict.verdict.capitalize()}: {names}."


def calibration_words(verdict: Verdict) -> Iterator[str]:
    """What was corrected within the machine file's tolerances."""
    for effect in verdict.calibration:
        values = ", ".join(
            f"{name} = {value_words(e)} ({interval_words(e)})"
            for name, e in effect.parameters.items()
        )
        yield f"Calibrated, within the machine file's tolerance: {effect.name}, {values}."


def form_words(effect: Named, verdict: Verdict) -> str:
    """What stands after its name: its form, or that it merely calibrates; often nothing."""
    return "calibration" if effect in verdict.calibration else effect.form


def effect_words(effect: Named, verdict: Verdict) -> str:
    form = form_words(effect, verdict)
    return f"{effect.name} ({form})" if form else effect.name


def parameters_shown(effect: Named) -> dict[str, Estimate]:
    """Its parameters but for the number of the run that it happened in, which says nothing."""
    return {name: e for name, e in effect.parameters.items() if name != RUN}


def value_words(estimate: Estimate) -> str:
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    return f"{estimate.value:.4g}{unit}"


def interval_words(estimate: Estimate) -> str:
    """The 95 % interval; what a search of its own found has none."""
    low, high = estimate.ci95
    if math.isnan(low):
        return "as found by search"
    if not (math.isfinite(low) and math.isfinite(high)):
        return "these data do not bound it"
    return f"{low:.4g} to {high:.4g}" + (" (at its bound)" if estimate.at_bound else "")


def origin_words(estimate: Estimate) -> str:
    """How well a value is known, for where nobody sees the head of a table."""
    low, high = estimate.ci95
    bounded = math.isfinite(low) and math.isfinite(high)
    return f"95 %: {interval_words(estimate)}" if bounded else interval_words(estimate)


def held_out_words(effect: Named, verdict: Verdict) -> str:
    """Whether parts that were not fitted gain by it, if there were any."""
    if verdict.gap.held_out_rms is None:
        return "-"
    return "gains" if effect.held_out else "no gain"


def rivals_words(effect: Named) -> str:
    """The alternatives that the data cannot tell from it, each with its EBIC above it."""
    return ", ".join(f"{name} (ΔEBIC {delta:+.2g})" for name, delta in effect.rivals.items())


def place_words(place: Place) -> str:
    """Where in its run: line (a logged command has none), phase, direction and axis."""
    parts = [f"{'row' if place.phase == STEADY else 'line'} {place.line}"] if place.line else []
    parts.append(place.phase)
    parts += [_WAYS[place.direction]] if place.direction else []
    parts += [] if place.axis is None else [f"axis {place.axis}"]
    return ", ".join(parts)


def faint_words(verdict: Verdict) -> list[str]:
    """Each effect that these data could not show, the nearest to being seen first."""
    nearest = sorted(
        verdict.below_resolution, key=lambda faint: faint.needed_sigmas - faint.expected_sigmas
    )
    return [
        f"{f.name} (at most {f.expected_sigmas:.2g} σ in all, {f.needed_sigmas:.2g} σ are needed)"
        for f in nearest
    ]


def undecided_words(verdict: Verdict) -> Iterator[str]:
    """What these data cannot tell apart."""
    for effect in verdict.fitted:
        if effect.rivals:
            yield f"These data cannot tell {effect.name} from {rivals_words(effect)}."


def reservation(effect: Named, verdict: Verdict, runs: tuple[str, ...]) -> str | None:
    """Why an effect that is believed is no property of the machine; None if it is one.

    `runs` are the names of the experiment's runs.
    """
    if effect.name == _OFFSET:
        return "an offset belongs to the sensor's zero"
    run = int(verdict.settings.get(effect.name, {}).get(RUN, -1))
    return None if run == -1 else f"it happened in {runs[run]} alone"


def reservations(verdict: Verdict, runs: tuple[str, ...]) -> Iterator[str]:
    """What the machine file does not get, and what of it a further run will not repeat."""
    for effect in verdict.effects:
        reason = reservation(effect, verdict, runs)
        if reason:
            yield f"{effect.name} is not in the machine file: {reason}."
        elif effect.name == "hum" and len(runs) > 1:
            yield f"hum has another phase in each run; the machine file has that of {runs[0]}."
