"""The step of a converter that readings show and the experiment does not state."""

from __future__ import annotations

from mopro.engine.series import Floats
from mopro.noise import step_of

# Readings in these are whole by their unit.
_COUNTED = ("count", "step")


def step_note(
    name: str, unit: str, values: Floats, stated: float, noise_rms: float | None
) -> str | None:
    """The note on a sensor whose readings (n,) are all multiples of a step that is not stated.

    None if a step is stated, if the unit is one, or if the noise is larger than it, which hides
    the rounding.
    """
    if unit in _COUNTED:
        return None
    step = 0.0 if stated else step_of(values)
    if not step or (noise_rms is not None and noise_rms >= step):
        return None
    words = f"every reading is a multiple of {step:.6g} {unit}"
    return f"{name}: {words}: state adc_step = {step:.6g}"
