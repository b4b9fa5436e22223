"""Readings that do not change where the machine does: at the end of a range, or stuck."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mopro.importing.agreement import Floats, agreement, followed
from mopro.importing.propose import Proposal, noise_of
from mopro.importing.roles import Signal
from mopro.logs import Decision
from mopro.noise import End, ends_of

# What a play, a lag or a lost motion leaves of a rest is as far off as what it leaves elsewhere.
# Halved, a rest beside a play is called an end; doubled, a range that is cut by little is missed.
_CLEAR = 2.0
# Share of the readings' range by which a fit is rounded.
_ROUNDED = 1e-9


def stuck_in(run: Proposal, where: str = "", own_noise: bool = True) -> Iterator[Decision]:
    """CHECKs on the sensors of a run that stay at a value; `where` names the run among several.

    The noises of the proposal are this run's if it has its `own_noise`.
    """
    for sensor in run.sensors:
        times, values = sensor.present
        subject = f"column {sensor.raw}{where}"
        told = [end for end in ends_of(values) if _is_end(end, run.command, times, values)]
        for end in told:
            reason = (
                f"first at {times[end.first]:.6g} s; --missing {end.value:.10g} leaves them out"
            )
            yield Decision(subject, end.words(sensor.unit_word), reason, check=True, lasting=True)
        noise = run.noises[sensor.label] if own_noise else noise_of(sensor)
        for first, last in noise.stuck:
            if values[first] not in {end.value for end in told}:
                taken = f"{last - first} readings in a row are exactly {values[first]:.10g} "
                taken += f"{sensor.unit_word}: is the sensor stuck?"
                reason = f"from {times[first]:.6g} to {times[last - 1]:.6g} s; others have noise"
                yield Decision(subject, taken, reason, check=True, lasting=True)


def _is_end(end: End, command: Signal | None, times: Floats, values: Floats) -> bool:
    """True if the noise says so, or the command goes on there; without one, a sudden stop."""
    beyond = None if command is None else _beyond(end, command, times, values)
    if beyond is None:
        return end.certain or end.sharp
    excess, residual = beyond
    far = _CLEAR * float(np.abs(residual).max()) + _ROUNDED * float(np.ptp(values))
    return excess > far or (end.certain and excess > float(np.sqrt(np.mean(residual**2))))


def _beyond(
    end: End, command: Signal, times: Floats, values: Floats
) -> tuple[float, Floats] | None:
    """Median excess of the command over the end (sensor's unit), and the other residuals.

    None where they do not follow it.
    """
    others = ~end.at
    if np.count_nonzero(others) < 2:
        return None
    told = command.present
    found = agreement(*told, times[others], values[others], command.held)
    if found is None or not found.related:
        return None
    left = values - followed(found, *told, times, command.held)
    excess = float(np.median(left[end.at])) * (-1 if end.largest else 1)
    return excess, left[others]
