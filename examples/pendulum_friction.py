"""Friction of a free pendulum: what stops it, when viscous damping is in the model already?

python examples/pendulum_friction.py FOLDER, with the measured set
`single_pendulum_bearing_friction`. The base model is th'' = -w2 sin(th) - b th'.
"""

import math
import sys
from pathlib import Path

import numpy as np
from common import columns, cross_test, diagnose, effect, getter, moves
from numba import njit

from mopro.diagnosis import Parameter, Series

# Fifty swings magnify a change: differences are taken over a millionth of the ranges.
FINE = {"difference": 1e-6}
EFFECTS = [
    effect("dry friction", "Fc", "rad/s^2", 0, 3, 0.003, 0.03, **FINE),
    effect("quadratic drag", "d", "1/rad", 0, 1, 1e-4, 1e-3, **FINE),
    effect("cubic damping", "b3", "s/rad^2", 0, 0.1, 1e-5, 1e-4, **FINE),
    effect("stiffness", "k3", "1/s^2", -20, 20, 0.01, **FINE),
    effect("bias torque", "g", "rad/s^2", -2, 2, 0.01, **FINE),
]
MODEL = (
    Parameter("w2", "1/s^2", 50, 80, (62.0, 64.0, 66.0), **FINE),
    Parameter("b", "1/s", 0, 1, (0.05,), **FINE),
)
DOCUMENTED = {"dry friction Fc": "0.152 from the large, 0.165 from the small swing"}


@njit(cache=True)
def swing(t, th, om, w2, b, fc, d, b3, k3, g):
    """Angles (rad) at the times `t`, in steps of 1 ms or less; dry friction may hold the arm."""
    angles = np.full(len(t), th)
    for i in range(1, len(t)):
        steps = math.ceil((t[i] - t[i - 1]) / 1e-3 - 1e-6)
        h = (t[i] - t[i - 1]) / steps
        for _ in range(steps):
            damping = b * om + d * om * abs(om) + b3 * om**3
            om += h * (g - w2 * math.sin(th) - k3 * th**3 - damping)
            om = math.copysign(max(abs(om) - h * fc, 0.0), om)
            th += h * om
        angles[i] = th
    return angles


def experiment(folder, file, part=(0, 1), kept=None):
    """Model and data of a part of a swing; `kept`: settings of which only the start is free."""
    t, th = columns(next(folder.glob(f"{file}*.csv")), "time_s", "angle_from_hanging_rad")
    own = (part[0] * t[-1] <= t) & (t <= part[1] * t[-1])

    def simulate(settings):
        start = {**(kept or {}).get("base", {}), **settings.get("base", {})}
        of = getter({**(kept or settings), "base": start})
        base = (of("base", name) for name in ("th0", "om0", "w2", "b"))
        others = (of(e.name, e.parameters[0].name) for e in EFFECTS)
        return [swing(t, *base, *others)[own]]

    return simulate, [Series(file, "encoder", "rad", th[own], None, t[own], moves(t[own]))]


def free_start(data):
    """Angle and speed that a swing begins with, as free numbers of the model."""
    th, t = data[0].values, data[0].time_s
    speed = np.polyfit(t[:9] - t[0], th[:9], 1)[0]
    angle = Parameter("th0", "rad", -2, 2, (th[0],), **FINE)
    return angle, Parameter("om0", "rad/s", -9, 9, (speed,), **FINE)


def main(folder):
    large, small = experiment(folder, "large", (0, 2 / 3)), experiment(folder, "small")
    found = diagnose(
        "large swing, first two thirds", large, EFFECTS, (*free_start(large[1]), *MODEL), DOCUMENTED
    )
    cross_test(found, experiment(folder, "large", (2 / 3, 1)))
    for title, kept in (("base model", found.base_before), ("verdict", found.settings)):
        again = experiment(folder, "small", kept=kept)
        diagnose(f"small swing by the {title} of the large", again, [], free_start(again[1]))
    diagnose("small swing", small, EFFECTS, (*free_start(small[1]), *MODEL), DOCUMENTED)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
