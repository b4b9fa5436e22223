"""Ends of a sensor's range: readings that begin again there, are unwrapped, or stay."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.importing.propose import Proposal, noise_of
from mopro.importing.roles import Signal
from mopro.instruments.agreement import Floats, expected
from mopro.logs import Decision
from mopro.logs.timed import spacing_of
from mopro.noise import End, ends_of

# -- wraps ------------------------------------------------------------------------------------
# Angles and counters that begin again at the end of their range: recognised, and unwrapped.


Indices = NDArray[np.intp]

_TURN = 2 * math.pi
_COUNTED = ("count", "step")
# Ranges of counters, in bits.
_BITS = range(8, 33)
# A range may be passed by the rounding of its two ends.
_ROUNDED = 1e-3
# Samples to either side in which motion is looked for, and the multiple of the usual bend of three
# neighbours by which it is more than noise: six standard deviations of a difference of two.
_WINDOWS = (3, 10, 30)
_CLEAR = 5.0
# A wrap may fall on the sharpest bend of all: it is at most so much sharper than the others.
_AS_BENT = 2.0
_FEWEST = 8
_NO_GAPS: Indices = np.array((), np.intp)


@dataclass(frozen=True)
class Wraps:
    """The span of a range at whose ends the values begin again, and how often they do."""

    span: float
    count: int


def unwrapped(signal: Signal) -> tuple[Signal, Decision | None]:
    """The signal as it goes on beyond its range, and what was done to it; None if nothing was."""
    rows = np.flatnonzero(~np.isnan(signal.values))
    values = signal.values[rows]
    if not signal.is_place or not _jumps(values, signal.unit, signal.si):
        return signal, None
    gaps = _gaps(signal.time_s[rows])
    found = wraps_of(values, signal.unit, signal.si, gaps)
    if found is None:
        return signal, None
    turned = signal.values.copy()
    turned[rows] = values - found.span * np.concatenate(
        ([0.0], np.cumsum(_turns(np.diff(values), found.span)))
    )
    reason = f"it wraps at {found.span:.10g} {signal.unit_word}, {found.count} times"
    reason += "; the turns in a gap of the readings are not known" if len(gaps) else ""
    done = Decision(f"column {signal.raw}", "unwrapped in the data", reason, check=True)
    return replace(signal, values=turned), done


def _jumps(values: Floats, unit: str | None, size: float) -> bool:
    """True if a step is as large as one of a wrap of these values is at the least."""
    if len(values) < _FEWEST:
        return False
    largest = float(np.max(np.abs(np.diff(values))))
    return any(largest > span / 2 for span in _spans(values, unit, size))


def _gaps(time_s: Floats) -> Indices:
    """The steps between readings that lead over a gap."""
    return np.array(spacing_of(time_s).gaps if len(time_s) > 1 else (), np.intp)


def wraps_of(
    values: Floats, unit: str | None, size: float = 1.0, gaps: Indices = _NO_GAPS
) -> Wraps | None:
    """The wraps of the values of a place in `unit`, of `size` in SI; None if there are none.

    Steps at the indices `gaps` tell nothing: the axis may have turned as often as it likes.

    A wrap is a jump by nearly one span, after which the motion goes on as before but for that
    span: all jumps have the same size then, no value is beyond one span, and the axis moves on
    both sides of one of them. A step of a whole turn has no motion beside it.
    """
    if len(values) < _FEWEST:
        return None
    steps = np.diff(values)
    for span in _spans(values, unit, size):
        jumps = np.setdiff1d(np.flatnonzero(np.abs(steps) > span / 2), gaps)
        inside = float(np.ptp(values)) <= span * (1 + _ROUNDED)
        if inside and len(jumps) and _goes_on(steps, jumps, span, gaps):
            return Wraps(span, len(jumps))
    return None


def _spans(values: Floats, unit: str | None, size: float) -> Iterator[float]:
    """Spans of a range in `unit`: a turn; of a counter a power of two, or the jumps' own size."""
    if unit not in _COUNTED:
        yield _TURN / size
        return
    reach = float(np.ptp(values))
    yield from (float(1 << bits) for bits in _BITS if reach < 1 << bits <= 2 * reach)
    steps = np.diff(values)
    jumps = np.flatnonzero(np.abs(steps) > reach / 2)
    if len(jumps):
        yield float(np.round(np.mean(_sizes(steps, jumps, reach))))


def _turns(steps: Floats, span: float) -> Floats:
    """The spans in each step: -1, 0 or 1."""
    turns: Floats = np.sign(steps) * (np.abs(steps) > span / 2)
    return turns


def _sizes(steps: Floats, jumps: Indices, span: float) -> Floats:
    """Size of each jump beyond the mean step beside it, against its direction (signal's unit)."""
    own = steps - span * _turns(steps, span)
    padded = np.concatenate((own[1:2], own, own[-2:-1]))
    beside = (padded[jumps] + padded[jumps + 2]) / 2
    sizes: Floats = np.abs(steps[jumps]) - np.sign(steps[jumps]) * beside
    return sizes


def _goes_on(steps: Floats, jumps: Indices, span: float, gaps: Indices) -> bool:
    """True if the jumps are of the span, as nearly as other steps are like their neighbours."""
    own = steps - span * _turns(steps, span)
    bends = np.abs(own[1:-1] - (own[2:] + own[:-2]) / 2)
    known = np.concatenate((jumps, gaps))
    near = np.concatenate((known - 2, known - 1, known))
    other = np.delete(bends, near[(near >= 0) & (near < len(bends))])
    largest = float(other.max()) if len(other) else 0.0
    tiny = 1e-6 * span
    deviations = _sizes(steps, jumps, span) - span
    alike = float(np.max(np.abs(deviations))) <= _AS_BENT * largest + tiny
    # Noise chooses the side of an axis that rests at the end of the range: its mean is not zero.
    usual = float(np.mean(other)) if len(other) else 0.0
    most = _AS_BENT * largest / math.sqrt(len(jumps)) + usual + tiny
    right = abs(float(np.mean(deviations))) <= most
    return alike and right and _moves(steps, own, jumps, float(np.median(bends)))


def _moves(steps: Floats, own: Floats, jumps: Indices, usual: float) -> bool:
    """True if the axis clearly moves against a jump on both its sides."""
    places = np.concatenate(([0.0], np.cumsum(own)))
    for window in _WINDOWS:
        before = places[jumps] - places[np.maximum(jumps - window, 0)]
        after = places[np.minimum(jumps + 1 + window, len(places) - 1)] - places[jumps + 1]
        way = -np.sign(steps[jumps])
        if np.any((way * before > _CLEAR * usual) & (way * after > _CLEAR * usual)):
            return True
    return False


# -- readings that stay -----------------------------------------------------------------------
# Readings that do not change where the machine does: at the end of a range, or stuck.


def stuck_in(run: Proposal, where: str = "", own_noise: bool = True) -> Iterator[Decision]:
    """CHECKs on the sensors of a run that stay at a value; `where` names the run among several.

    The noises of the proposal are this run's if it has its `own_noise`.
    """
    for sensor in run.sensors:
        times, values = sensor.present
        subject = f"column {sensor.raw}{where}"
        at_end = [end for end in ends_of(values) if _is_end(end, run.command, times, values)]
        for end in at_end:
            reason = (
                f"first at {times[end.first]:.6g} s; --missing {end.value:.10g} leaves them out"
            )
            yield Decision(subject, end.words(sensor.unit_word), reason, check=True)
        noise = run.noises[sensor.label] if own_noise else noise_of(sensor)
        for first, last in noise.stuck:
            if values[first] not in {end.value for end in at_end}:
                taken = f"{last - first} readings in a row are exactly {values[first]:.10g} "
                taken += f"{sensor.unit_word}: is the sensor stuck?"
                reason = f"from {times[first]:.6g} to {times[last - 1]:.6g} s; others have noise"
                yield Decision(subject, taken, reason, check=True, lasting=True)


def _is_end(end: End, command: Signal | None, times: Floats, values: Floats) -> bool:
    told = None if command is None else (*command.present, times, values, command.held, ~end.at)
    return end.is_passed(values, None if told is None else expected(*told))
