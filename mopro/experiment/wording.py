"""Wording of a verdict for the terminal and the page."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

from mopro.effects import catalogue
from mopro.engine.candidate import RUN
from mopro.engine.fits import ONE_RUN, OTHER_RUNS
from mopro.engine.series import Series
from mopro.engine.tolerances import CLOCK, GAIN, LINEARITY
from mopro.engine.verdict import Estimate, Named, RunGap, Verdict
from mopro.experiment.comparison import STEADY, Place
from mopro.units import residual_unit

NO_PROPOSAL = (
    "No program was found that would distinguish them with these sensors: measure something "
    "else, such as another quantity, another sensor, or the controller's own start."
)
_MORE_DATA = (
    "More data of this kind, such as a longer run, may tell the effects from the term that is not "
    "listed."
)
# The two states of a machine, wherever their figures stand.
BEFORE, AFTER = "before the repair", "after the repair"
# By what was held out of a verdict's fits.
HELD_OUT = {
    None: "held out",
    OTHER_RUNS: "held out in other runs",
    ONE_RUN: "held out within one run",
}
_FEWEST_DIGITS, _MOST_DIGITS = 4, 15
_OF_SENSORS = {
    LINEARITY: "linearity", GAIN: "gain", CLOCK: "clock",
    **{name: "zero" for name, effect in catalogue().items() if effect.constant_offset},
}  # fmt: skip
# Standard errors of an RMS by which it is told as a larger one.
_SCATTERS = 3.0
_DIRECTIONS = {1: "forward", -1: "backward"}


def sentence(verdict: Verdict) -> str:
    """The verdict in one sentence."""
    names = ", ".join(map(_family_words, verdict.effects))
    if verdict.verdict == "unexplained":
        beside = f" beside {names}{_share_words(verdict)}" if names else ""
        odd = None if any(effect.run for effect in verdict.effects) else verdict.odd_run
        alone = "" if odd is None else f" in {odd.run} alone"
        return f"Unexplained{beside}: what is left{alone} looks like {remainder_words(verdict)}."
    if verdict.verdict == "none" and verdict.gap.noise_rms is None:
        return "None: no effect is called for, as far as that shows with unknown noise."
    if verdict.verdict == "none" and (verdict.calibration or verdict.sensors):
        of_sensors = (f"the {_sensor_words(own)}" for own in verdict.sensors)
        corrected = " and ".join([*(e.name for e in verdict.calibration), *of_sensors])
        return f"None: with {corrected} calibrated, simulation and data agree."
    if verdict.verdict == "none" and verdict.remainder.note:
        return "None: no effect is called for, and the noise is not as stated."
    if verdict.verdict == "none":
        return "None: simulation and data agree within the sensors' noise."
    other = ", or a term that is not listed" if verdict.drafts else ""
    return f"{verdict.verdict.capitalize()}: {names}{other}."


def _family_words(effect: Named) -> str:
    """The effect or those that it cannot be told from, and the run if it is in one only."""
    where = "" if effect.run is None else f" in {effect.run} only"
    return " or ".join([effect.name, *effect.indistinguishable_from]) + where


def odd_run_words(verdict: Verdict) -> Iterator[str]:
    """A line on the run that alone disagrees, if there is one."""
    if (odd := verdict.odd_run) is not None:
        yield (
            f"{odd.run} disagrees ({odd.scatter:.3g} σ), the others do not ({odd.others:.3g} σ): "
            "look at its payload, its program or inputs, and its sensor."
        )


def trace_rows(verdict: Verdict) -> Iterator[list[str]]:
    """A row for each pass that decided something: its name, the effects and EBIC after it, why."""
    for taken in filter(lambda taken: taken.decides, verdict.trace):
        effects = ", ".join(taken.after) or "none"
        yield [taken.name.replace("_", " "), effects, f"{taken.ebic:.1f}", taken.why]


def remainder_words(verdict: Verdict) -> str:
    """The remainder beside the effects in words, and that beside the free-form terms, if any."""
    remainder = verdict.remainder
    if not verdict.drafts:
        return f"{remainder.description}"
    turn = remainder.beside_drafts
    rest = "no more than noise" if turn is None else f"what looks like {turn}"
    terms = "term" if len(verdict.drafts) == 1 else "terms"
    verb = "leaves" if len(verdict.drafts) == 1 else "leave"
    return f"{remainder.description}; the {terms} below {verb} {rest}"


def _share_words(verdict: Verdict) -> str:
    """Share of the disagreement that the effects explain, and that in held-out parts."""
    share, held_out = verdict.explained.share, verdict.explained.held_out_share
    if share is None:
        return ""
    held = "" if held_out is None else f" ({held_out:.1%} {HELD_OUT[verdict.held_out_on]})"
    return f", {share:.1%} of the disagreement explained{held}"


def advice(verdict: Verdict, on_alternatives: str = NO_PROPOSAL) -> str:
    """The advice after an ambiguous verdict: `on_alternatives` if any of them is listed."""
    return on_alternatives if verdict.alternatives else _MORE_DATA


def draft_words(verdict: Verdict) -> Iterator[str]:
    """A line for each free-form term."""
    standing = ", would do as well" if verdict.verdict == "ambiguous" else ""
    for draft in verdict.drafts:
        held = ", held out" if draft.held_out else ""
        where = draft.enters if draft.run is None else f"{draft.enters} of {draft.run}"
        yield (
            f"Not listed{standing}: a term of {draft.of} in the {where}, {draft.law} "
            f"{draft.unit} ({draft.sigmas:.3g} σ in all{held})."
        )


def note_words(verdict: Verdict) -> Iterator[str]:
    """A line for each free number of the model and each note."""
    for name, estimate in verdict.base.items():
        yield f"Fitted: {name} = {value_words(estimate)} ({interval_words(estimate)})."
    for note in verdict.notes:
        yield f"{note[:1].upper()}{note[1:]}."


def calibration_words(verdict: Verdict) -> Iterator[str]:
    """A line for each number corrected within its tolerance, of the machine or of a sensor."""
    for effect in verdict.calibration:
        where = f"within the machine file's tolerance: {effect.name}"
        yield f"Calibrated, {where}, {_values_words(effect)}."
    for own in verdict.sensors:
        yield f"Calibrated, {_sensor_words(own)}: {_values_words(own)}."


def _values_words(effect: Named) -> str:
    return ", ".join(
        f"{name} = {value_words(e)} ({interval_words(e)})" for name, e in effect.parameters.items()
    )


def _sensor_words(own: Named) -> str:
    """The corrected quantity of a sensor, such as `linearity of lvdt`."""
    return f"{_OF_SENSORS.get(own.name, own.name)} of {own.form}"


def form_words(effect: Named, verdict: Verdict) -> str:
    """The effect's form, "calibration" for a corrected number, or nothing."""
    return "calibration" if effect in verdict.calibration else effect.form


def effect_words(effect: Named, verdict: Verdict) -> str:
    form = form_words(effect, verdict)
    return f"{effect.name} ({form})" if form else effect.name


def parameters_shown(effect: Named) -> dict[str, Estimate]:
    """The effect's parameters without the number of its run."""
    return {name: e for name, e in effect.parameters.items() if name != RUN}


def value_words(estimate: Estimate) -> str:
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    return f"{estimate.value:.{_digits(estimate)}g}{unit}"


def _digits(estimate: Estimate) -> int:
    """Significant digits that show the interval: four, more if it is narrower than they tell."""
    low, high = estimate.ci95
    width, size = high - low, max(abs(low), abs(high))
    if not 0 < width < math.inf:
        return _FEWEST_DIGITS
    return min(max(math.ceil(math.log10(size / width)) + 1, _FEWEST_DIGITS), _MOST_DIGITS)


def interval_words(estimate: Estimate) -> str:
    """The 95 % interval; an estimate found by search alone has none (NaN)."""
    low, high = estimate.ci95
    if math.isnan(low):
        return "as found by search"
    if not (math.isfinite(low) or math.isfinite(high)):
        return "these data do not bound it"
    digits = _digits(estimate)
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"at most {high:.{digits}g}" if math.isfinite(high) else f"at least {low:.{digits}g}"
    ends = f"{low:.{digits}g} to {high:.{digits}g}"
    return ends + (" (at its bound)" if estimate.at_bound else "")


def origin_words(estimate: Estimate) -> str:
    """The interval with its level, for places without a table heading."""
    low, high = estimate.ci95
    bounded = math.isfinite(low) or math.isfinite(high)
    return f"95 %: {interval_words(estimate)}" if bounded else interval_words(estimate)


def held_out_words(effect: Named, verdict: Verdict) -> str:
    """Result on held-out parts: "gains", "no gain", or "-" if none were held out."""
    if verdict.gap.held_out_rms is None:
        return "-"
    return "gains" if effect.held_out else "no gain"


def alternatives_words(effect: Named, partings: Mapping[tuple[str, str], str]) -> str:
    """The indistinguishable alternatives, each with its EBIC minus that of `effect`.

    With what would tell each, of `partings` (those of a `Proposal`).
    """

    def words(rival: str, delta: float) -> str:
        parting = partings.get((effect.name, rival))
        return f"{rival} (ΔEBIC {delta:+.2g}{'' if parting is None else f'; {parting}'})"

    return ", ".join(words(*each) for each in effect.rivals.items())


def place_words(place: Place) -> str:
    """Location in the run: line (none for a logged command), phase, direction and axis."""
    parts = [f"{'row' if place.phase == STEADY else 'line'} {place.line}"] if place.line else []
    parts.append(place.phase)
    parts += [_DIRECTIONS[place.direction]] if place.direction else []
    parts += [] if place.axis is None else [f"axis {place.axis}"]
    return ", ".join(parts)


def candidate_rows(verdict: Verdict) -> Iterator[list[str]]:
    """A row for each candidate: its name, status, size in σ and the reason of the status.

    First those supported, then those rejected or alternatives, then those below resolution.
    """
    alternative_to = {name: e.name for e in verdict.fitted for name in e.rivals}
    for effect in verdict.fitted:
        status = "calibrated" if effect in verdict.calibration else "supported"
        yield [effect.name, status, f"{effect.sigmas:.3g}", "lowers the extended BIC"]
    for rejected in sorted(verdict.rejected, key=lambda r: -r.gain):
        status, reason = "rejected", rejected.reason
        if rejected.name in alternative_to:
            status = f"alternative to {alternative_to[rejected.name]}"
            reason = f"fits as well in its place, but not in addition: {reason}"
        yield [rejected.name, status, f"{math.sqrt(max(rejected.gain, 0.0)):.2g}", reason]
    for faint in verdict.below_resolution:
        most, needed = f"{faint.expected_sigmas:.2g}", f"{faint.needed_sigmas:.2g}"
        yield [
            faint.name,
            "below resolution",
            f"at most {most}",
            f"the largest plausible effect gives {most} σ; {needed} σ are needed to detect it",
        ]


def left_out_words(left_out: Collection[str], tried: Collection[str]) -> Iterator[str]:
    """A line on the effects that were no candidates, or on the few that were; none if all were."""
    if len(left_out) > len(tried):
        yield f"No effects were tried but {', '.join(tried)}."
    elif left_out:
        yield f"Not tried, as asked: {', '.join(sorted(left_out))}."


def reservation(effect: Named, verdict: Verdict, runs: tuple[str, ...]) -> str | None:
    """Reason why a named effect is no property of the machine; None if it is one.

    `runs` are the names of the experiment's runs.
    """
    known = catalogue().get(effect.name)
    if effect.run is not None and effect.run not in runs:
        return f"it is in {effect.run} alone, which is no run of the motor"
    if known is not None and known.reservation is not None:
        return known.reservation
    # A machine file states an effect for certain runs; an event counts the moves of its program.
    run = -1 if effect.run else int(verdict.settings.get(effect.name, {}).get(RUN, -1))
    return None if run == -1 else f"it happened in {runs[run]} alone"


def reservations(verdict: Verdict, runs: tuple[str, ...]) -> Iterator[str]:
    """Lines on effects left out of the machine file, and on intervals beside the unexplained."""
    for effect in verdict.effects:
        reason = reservation(effect, verdict, runs)
        if reason:
            yield f"{effect.name} is not in the machine file: {reason}."
    if verdict.verdict == "unexplained" and (verdict.base or verdict.fitted):
        yield (
            "The intervals hold for the model as it stands: what is unexplained may move the "
            "numbers further."
        )


def unconfirmed_words(verdict: Verdict, filed: Verdict) -> Iterator[str]:
    """A line on each draft that the machine file has: `filed` is the verdict with those."""
    for effect in filed.effects:
        if effect not in verdict.effects:
            yield f"The machine file has {effect.name}: compare it with a run that it has not seen."


def _why_of_runs(verdict: Verdict, name: str) -> str:
    run = next((e.run for e in verdict.fitted if e.name == name), None)
    if run is None:
        return (
            "of the runs' own time: in the machine file it belongs to the runs of this experiment"
        )
    return f"in {run} only: in the machine file it belongs to that run"


def _is_worse(rms: float | None, before_rms: float, series: Series) -> bool:
    """True if an RMS residual is above that of the machine that came in by more than noise is."""
    scatter = _SCATTERS / math.sqrt(2 * len(series))
    return rms is not None and rms > before_rms * (1 + scatter)


def harmed(verdict: Verdict, data: Sequence[Series]) -> list[RunGap]:
    """The runs that are predicted worse, by a fit of the others, than by the machine that came in.

    Only beside what nothing explains: what was fitted makes up for it in the runs that it was
    fitted to. Where all is explained, too few other runs tell of a number.
    """
    if verdict.verdict != "unexplained":
        return []
    pairs = zip(verdict.gap.runs, data, strict=True)
    return [gap for gap, own in pairs if _is_worse(gap.held_out_rms, gap.before_rms, own)]


def harm_words(gap: RunGap, verdict: Verdict) -> str:
    """Why nothing that was fitted is in the machine file, by one run that it would harm."""
    unit = residual_unit(gap.unit)
    on_others = verdict.held_out_on == OTHER_RUNS
    others = "other runs" if on_others else f"other parts of {gap.run}"
    drafts = (
        ", and no draft (--with-drafts writes those inside the model)"
        if verdict.without_drafts is not None
        else ""
    )
    return (
        f"Nothing that was fitted is in the machine file{drafts}: fitted to {others}, it predicts "
        f"{gap.sensor} in {gap.run} worse than the machine that came in, "
        f"{gap.held_out_rms:.3g} {unit} instead of {gap.before_rms:.3g} {unit}, as it makes up for "
        "what is unexplained."
    )


def file_words(
    verdict: Verdict,
    of_runs: Sequence[str],
    rerun_rms: Sequence[float | None],
    data: Sequence[Series],
) -> Iterator[str]:
    """Lines on how the machine file differs from the verdict, and on where it is worse than before.

    `of_runs`: its effects of the runs' own time. `rerun_rms`: the RMS residual of each series.
    """
    if verdict.without_drafts is not None and all(draft.run for draft in verdict.drafts):
        yield "The machine file has no drafts: what is in one run is none of the machine."
    elif verdict.without_drafts is not None:
        yield (
            "The machine file has no drafts: its numbers are those that fit without them, and may "
            "differ from those above (--with-drafts writes those inside the model)."
        )
    for name in of_runs:
        yield (f"{name} is {_why_of_runs(verdict, name)}, and is off in all others.")
    for gap, again, series in zip(verdict.gap.runs, rerun_rms, data, strict=True):
        if again is not None and _is_worse(again, gap.before_rms, series):
            unit = residual_unit(gap.unit)
            yield (
                f"The machine file predicts {gap.sensor} in {gap.run} worse than the machine that "
                f"came in: {again:.3g} {unit} instead of {gap.before_rms:.3g} {unit}."
            )
