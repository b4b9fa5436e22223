"""Slips in writing a motion, recognised by what they lead to."""

from __future__ import annotations

# No motor of this kind reaches its velocity in less time.
_SHORTEST_RAMP_S = 5e-3
_MS_PER_S = 1000


def per_millisecond(acceleration: float, velocity: float, axis: int, unit: str) -> str | None:
    """Hint for an acceleration that was probably meant per second, else None.

    `acceleration` (in `unit`/s²) and `velocity` (in `unit`/s) are those of a move that stalls.
    """
    if velocity >= acceleration * _SHORTEST_RAMP_S:
        return None
    written = acceleration / _MS_PER_S
    return (
        f"ACC is in {unit}/s per millisecond: for {written:g} {unit}/s² write "
        f"`ACC{axis} {written / _MS_PER_S:g}`"
    )
