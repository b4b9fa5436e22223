"""Heat that reaches a second heater, and a sensor that lags, on a temperature control lab.

python examples/heater_coupling.py FOLDER, with the measured set `tclab_heater_coupling_lag`.
In the base model each heater stands alone: dT/dt = a Q - U (T - T_start). One step is fitted.
"""

import math
import sys
from pathlib import Path

import numpy as np
from common import columns, cross_test, diagnose, effect, getter, moves
from numba import njit

from mopro.diagnosis import Parameter, Series

MODEL = Parameter("a", "C/s/%", 0, 0.1, (0.005,)), Parameter("U", "1/s", 1e-4, 0.1, (0.006,))
EFFECTS = [
    effect("coupling", "k", "1/s", 0, 0.1, 1e-3),
    effect("sensor lag", "tau", "s", 0, 200, 5.0),
    effect("radiation", "r", "1/s", 0, 0.1, 1e-3),
    effect("free convection", "c", "1/s/C^0.25", 0, 0.1, 1e-3),
    effect("crosstalk", "x", "1", 0, 1, 0.05),
    effect("heater delay", "d", "s", 0, 100, 5.0),
    effect("sensor drift", "s", "C/s", -0.05, 0.05, 1e-3),
]
SURROUNDINGS = [
    effect("power", "p", "1", -0.6, 0.6, 0.03),
    effect("loss", "l", "1", -0.6, 0.6, 0.03),
    effect("colder room", "dT", "C", -15, 15, 1.0),
]
DOCUMENTED = {"coupling k": 0.0024, "sensor lag tau": 18, "radiation r": "negligible"}


@njit(cache=True)
def heat(t, power, start, base, k, tau, r, c, x, loss, dT):
    """Readings (C above the start, in K) of two sensors, each on a block of its own."""
    readings, block, rate = np.zeros((2, len(t))), np.zeros(2), np.zeros(2)
    for i in range(1, len(t)):
        h = t[i] - t[i - 1]
        for j in range(2):
            over = block[j] + dT
            lost = base * over + c * over * abs(over) ** 0.25
            lost += r * ((start + block[j]) ** 4 - (start - dT) ** 4) / (4 * start**3)
            heated = power[i - 1] * (x if j else 1.0)
            rate[j] = heated - (1 + loss) * lost + k * (block[1 - j] - block[j])
        block += h * rate
        share = 1 - math.exp(-h / tau) if tau > 0 else 1.0
        readings[:, i] = readings[:, i - 1] + share * (block - readings[:, i - 1])
    return readings


def experiment(folder, file, fitted=None):
    """Model and data of both sensors in one run; `fitted`: settings of a verdict to stand on."""
    names = ("sensor1_temperature_C", "sensor2_temperature_C", "heater1_command_percent")
    t, *sensors, duty = columns(folder / f"{file}.csv", "time_s", *names)

    def simulate(settings):
        of = getter({**(fitted or {}), **settings})
        power = of("base", "a") * (1 + of("power", "p")) * duty
        power = np.interp(t - of("heater delay", "d"), t, power, left=0.0)
        own = (of(e.name, e.parameters[0].name) for e in (*EFFECTS[:5], *SURROUNDINGS[1:]))
        rises = heat(t, power, sensors[0][0] + 273.15, of("base", "U"), *own)
        drift = of("sensor drift", "s") * t
        return [own[0] + rise + drift for own, rise in zip(sensors, rises, strict=True)]

    fixed = np.zeros((len(t), 0))  # a sensor has no offset: it is read from the start
    names = ("sensor 1", "sensor 2")
    runs = zip(names, sensors, strict=True)
    return simulate, [Series(file, n, "C", own, None, t, moves(t), fixed) for n, own in runs]


def main(folder):
    verdict = diagnose("step", experiment(folder, "tclab_step_test"), EFFECTS, MODEL, DOCUMENTED)
    for file in sorted(path.stem for path in folder.glob("*.csv")):
        if file != "tclab_step_test":
            cross_test(verdict, experiment(folder, file))
        if "sin_2_50" in file:  # on other days, in other surroundings
            again = experiment(folder, file, verdict.settings)
            diagnose(f"{file}, beside that", again, SURROUNDINGS)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
