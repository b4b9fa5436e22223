"""Effects between the true position and the reading of an instrument."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from mopro.effects.effect import Domain, Effect, Floats, Parameter, Scene, View, angle_in, phase
from mopro.effects.starts import Values, residual_m, strongest_lines
from mopro.engine.candidate import Candidate, FindStarts, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.engine.play import follow
from mopro.engine.spectrum import sinusoid
from mopro.engine.tolerances import CLOCK, GAIN
from mopro.instruments.quantity import Quantity


class PitchScale(Effect):
    """The platen's pitch is not what it is said to be.

    x' = x (1 + e); e is a ratio. Source: assumed.
    """

    name = "pitch_scale"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    parameters = (Parameter("e", "1", "ratio", 2e-4, (-5e-4, 5e-4), -0.1, 0.1, "relative excess"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 1e-4))


_STEEL_1_K = 11.35e-6


class PlatenExpansion(Effect):
    """The platen expands with its temperature.

    x' = x (1 + alpha ΔT), ΔT = dT + share (T - T_air): dT in K is the platen's rise above
    the temperature at which it was made, `share` its share of the forcer's rise (1 is the
    worst case of chapter 3.1.2); alpha in 1/K. Source: eq. 3.29, 3.53, 3.54.
    """

    name = "platen_expansion"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    parameters = (
        Parameter(
            "dT", "K", "temperature difference", 20.0, (0.0, 40.0), -100.0, 100.0, "warmer by"
        ),
        Parameter("share", "1", "ratio", 0.0, (0.0, 1.0), 0.0, 1.0, "of the forcer's rise"),
        Parameter(
            "alpha", "1/K", "expansion", _STEEL_1_K, (9.9e-6, 12.8e-6), 0.0, 1e-4,
            "expansion of steel", null=_STEEL_1_K,
        ),
    )  # fmt: skip

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        warmer = p[0] + p[1] * (scene.temperature_C - scene.air_C)
        grown: Floats = x * (1 + p[2] * warmer)
        return grown

    @property
    def needs_temperature(self) -> bool:
        return True

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("dT", 10.0), fixed={"share": 0.0, "alpha": _STEEL_1_K})
        with_it = {"dT": 0.0, "alpha": _STEEL_1_K}
        yield self.form(self.fitted("share", 0.5), form="with the forcer", fixed=with_it)


class SensorGain(Effect):
    """The sensor's gain is off.

    x' = x (1 + g); g is a ratio. Source: appendix D; figures assumed.
    """

    name = "sensor_gain"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    of_sensor = GAIN
    parameters = (Parameter("g", "1", "ratio", 2e-3, (-0.01, 0.01), -0.5, 0.5, "excess"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("g", 1e-3))


class SensorOffset(Effect):
    """The sensor's zero is off.

    x' = x + o, in m. Source: assumed.
    """

    name = "sensor_offset"
    domain = Domain.MEASUREMENT
    reservation = "an offset belongs to the sensor's zero"
    constant_offset = "o"
    parameters = (Parameter("o", "m", "length", 1e-4, (-1e-3, 1e-3), -1.0, 1.0, "offset"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0]

    def forms(self, view: View) -> Iterator[Candidate]:
        """None: an offset of each run is fitted always."""
        yield from ()


class CrossAxisCoupling(Effect):
    """The sensor is not square to the other axis.

    y' = y + gamma x with x the other axis; gamma in rad. Source: assumed.
    """

    name = "cross_axis_coupling"
    domain = Domain.MEASUREMENT
    acts_last = True
    parameters = (Parameter("gamma", "rad", "angle", 3e-4, (-1e-3, 1e-3), -0.1, 0.1, "angle"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0] * scene.other_m

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("gamma", 2e-4))


class Backlash(Effect):
    """The sensor's coupling has play.

    x' = x - B/2 sgn(direction of the last motion), B in m: after a reversal the axis
    crosses the play before the sensor follows; it starts in the middle. Source: assumed.
    """

    name = "backlash"
    domain = Domain.MEASUREMENT
    parameters = (Parameter("B", "m", "length", 2e-5, (1e-6, 1e-4), 0.0, 0.01, "reversal step"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return follow(x, p[0] / 2)

    def forms(self, view: View) -> Iterator[Candidate]:
        # The response is not smooth: fewer oscillations cross a larger play.
        yield self.form(replace(self.fitted("B", 3e-6, 3e-5), difference=1e-5))


_CORNER = Fitted(
    "f_c", "Hz", 33.0, 1e7, (150.0, 500.0), plausible=(50.0, 2e4), inverse=True, null=math.inf
)


class SensorBandwidth(Effect):
    """The sensor follows with a first-order lag.

    x' + (1/(2π f_c)) dx'/dt = x, f_c in Hz. Source: carrier filters of DC-LVDTs;
    figures assumed.
    """

    name = "sensor_bandwidth"
    domain = Domain.MEASUREMENT
    families = ("delay",)
    parameters = (
        Parameter("f_c", "Hz", "frequency", 200.0, (50.0, 1000.0), 0.01, 1e9, "corner", null=1e9),
    )

    def bandwidth_s(self, quantity: Quantity, *p: float) -> float:
        return 1 / (2 * math.pi * p[0]) if quantity.sees_place else 0.0

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(_CORNER)


class TriggerDelay(Effect):
    """The data begin late against the program's clock.

    x'(t) = x(t - t_d), t_d in s. Source: assumed.
    """

    name = "trigger_delay"
    domain = Domain.MEASUREMENT
    families = ("delay",)
    parameters = (Parameter("t_d", "s", "time", 2e-3, (0.0, 0.01), -1.0, 1.0, "delay"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s - p[0]

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("t_d", 1e-3))


class SampleClock(Effect):
    """The sampling clock runs slow, so that samples are taken later than labelled.

    x'(t) = x(t (1 + e)); e is a ratio. Source: assumed.
    """

    name = "sample_clock"
    domain = Domain.MEASUREMENT
    families = ("clock",)
    of_sensor = CLOCK
    parameters = (Parameter("e", "1", "ratio", 5e-4, (-5e-3, 5e-3), -0.1, 0.1, "relative excess"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 3e-4))


_LVDT_HALF_RANGE_M = 0.254
# Number of starts for the middle of the cubic.
_MIDDLES_TRIED = 7


class SensorNonlinearity(Effect):
    """The sensor is nonlinear towards the ends of its range.

    x' = x + 2 half (c3 u³ + c5 u⁵), u = (x - mid)/half: c3 and c5 are shares of the full
    range 2 half, mid and half in m. Source: appendix D.1, "at the ends of the core
    travel, the linearity decreases"; 0.25 % of the range.
    """

    name = "sensor_nonlinearity"
    domain = Domain.MEASUREMENT
    parameters = (
        Parameter("c3", "1", "ratio", 2.5e-3, (-0.01, 0.01), -0.5, 0.5, "cubic, of full range"),
        Parameter("c5", "1", "ratio", 0.0, (-0.01, 0.01), -0.5, 0.5, "quintic, of full range"),
        Parameter("mid", "m", "length", 0.0, (-0.3, 0.3), -2.0, 2.0, "middle of the range"),
        Parameter(
            "half", "m", "length", _LVDT_HALF_RANGE_M, (0.01, 1.0), 1e-4, 10.0, "half the range",
            null=_LVDT_HALF_RANGE_M, unit_of=("c3", "c5"),
        ),
    )  # fmt: skip

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        c3, c5, mid, half = p
        u = (x - mid) / half
        square = u * u
        bent: Floats = x + 2 * half * u * square * (c3 + c5 * square)
        return bent

    def forms(self, view: View) -> Iterator[Candidate]:
        """Polynomials about the middle of the travel, or about a fitted one."""
        low, high = view.travel_m()
        middle, half = (low + high) / 2, _LVDT_HALF_RANGE_M
        cubic = replace(self.fitted("c3", 1e-3), low=-0.1, high=0.1, plausible=(-0.05, 0.05))
        quintic = replace(cubic, name="c5")
        yield self.form(cubic, form="cubic", fixed={"c5": 0.0, "mid": middle, "half": half})
        yield self.form(
            cubic, quintic, form="cubic and quintic", fixed={"mid": middle, "half": half},
            extends="cubic", flexible=True,
        )  # fmt: skip
        # Travel to one side of the sensor's middle shows little nonlinearity about its own middle.
        places = tuple(np.linspace(low - half / 2, high + half / 2, _MIDDLES_TRIED).tolist())
        mid = Fitted("mid", "m", low - half, high + half, places, Role.SHAPE, null=middle)
        elsewhere = self.form(
            cubic, mid, form="cubic, middle fitted", fixed={"c5": 0.0, "half": half},
            extends="cubic", can_enter_first=True, flexible=True,
        )  # fmt: skip
        yield elsewhere
        yield replace(
            elsewhere, parameters=(cubic, quintic, mid), fixed={"half": half},
            form="cubic and quintic, middle fitted", extends=elsewhere.form,
        )  # fmt: skip


_PERIODS_TRIED = 3
_FINEST_PERIOD_M = 1e-4
_PERIOD = Fitted(
    "lambda", "m", 8e-5, 0.15, role=Role.SHAPE, inverse=True, difference=1e-6, plausible=(1e-4, 0.1)
)


class PeriodicError(Effect):
    """A cyclic error of the teeth or of the sensor's scale.

    x' = x + A sin(2πx/lambda + phi); A and lambda in m, phi in rad. Source: assumed.
    """

    name = "periodic_error"
    domain = Domain.MEASUREMENT
    parameters = (
        Parameter("A", "m", "length", 5e-6, (1e-6, 1e-4), 0.0, 0.01, "amplitude"),
        Parameter(
            "lambda", "m", "length", 1.016e-3, (1e-4, 0.1), 1e-6, 10.0, "period", null=1.016e-3
        ),
        Parameter(
            "phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase", role=Role.PHASE
        ),
    )

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        ripple: Floats = x + p[0] * np.sin(2 * math.pi * x / p[1] + p[2])
        return ripple

    def forms(self, view: View) -> Iterator[Candidate]:
        amplitude = Fitted("A", "m", 0.0, 1e-2)
        yield self.form(
            amplitude,
            _PERIOD,
            phase("phi"),
            flexible=True,
            find_starts=lambda fit: _lines(view, fit),
        )


def _lines(view: View, fit: ResidualView) -> Iterator[Values]:
    """Starting values from the strongest spectral lines over position."""
    for sine, cosine, period in strongest_lines(view, fit, _FINEST_PERIOD_M, _PERIODS_TRIED):
        yield {
            "A": math.hypot(sine, cosine),
            "lambda": period,
            "phi": math.atan2(cosine, sine),
        }


_MAINS_HZ = (50.0, 60.0)
# Orders of the harmonics of the mains that a sensor may show as well.
_HARMONICS = (2, 3)
_AMPLITUDE = Fitted("A", "m", 0.0, 1e-2)


def _angle(name: str, meaning: str) -> Parameter:
    bounds = (-math.pi, math.pi), -7.0, 7.0
    return Parameter(name, "rad", "angle", 0.0, *bounds, meaning, per_run=True, role=Role.PHASE)


class Hum(Effect):
    """The mains frequency and its harmonics appear in the sensor's signal.

    x' = x + Σ A_n sin(2π n f t + phi_n): A in m for the mains frequency f (Hz), A2 and A3
    in m for its second (a rectifier's) and its third harmonic (a transformer's). On the
    thesis's LVDT 1 mV is 25.4 µm. Source: assumed.
    """

    name = "hum"
    domain = Domain.MEASUREMENT
    parameters = (
        Parameter("A", "m", "length", 1e-4, (2.54e-5, 5.08e-4), 0.0, 0.1, "amplitude"),
        Parameter("f", "Hz", "frequency", 60.0, (50.0, 60.0), 1.0, 1000.0, "mains", null=60.0),
        _angle("phi", "phase"),
        Parameter("A3", "m", "length", 0.0, (0.0, 2e-4), 0.0, 0.1, "third harmonic's amplitude"),
        _angle("phi3", "its phase"),
        Parameter("A2", "m", "length", 0.0, (0.0, 2e-4), 0.0, 0.1, "second harmonic's amplitude"),
        _angle("phi2", "its phase"),
    )

    def electronics(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        amplitude, mains, phi, third, phi3, second, phi2 = p
        angle = 2 * math.pi * mains * time_s
        noisy: Floats = x + amplitude * np.sin(angle + phi)
        for n, size, turn in ((2, second, phi2), (3, third, phi3)):
            if size:  # most hum has neither, and a sine takes long
                noisy += size * np.sin(n * angle + turn)
        return noisy

    def forms(self, view: View) -> Iterator[Candidate]:
        """50 and 60 Hz alone, with both harmonics and with each of them."""
        runs = [run.name for run in view.runs]
        lines = {n: _line(f"A{n}", f"phi{n}", runs) for n in _HARMONICS}
        main = _line("A", "phi", runs)
        for mains, harmonics in product(_MAINS_HZ, ((), _HARMONICS, *combinations(_HARMONICS, 1))):
            zeros = {f"A{n}": 0.0 for n in _HARMONICS if n not in harmonics}
            yield self.form(
                *main, *(p for n in harmonics for p in lines[n]),
                form=f"{' and '.join(f'{n * mains:g}' for n in (1, *harmonics))} Hz",
                fixed={"f": mains, **zeros}, extends=f"{mains:g} Hz" if harmonics else None,
                can_enter_first=harmonics == _HARMONICS,
                find_starts=_search(view, mains, harmonics),
            )  # fmt: skip


def _line(amplitude: str, angle: str, runs: Sequence[str]) -> tuple[Fitted, ...]:
    """The fitted amplitude of a line, and its angle in each of the runs of these names."""
    angles = (phase(angle_in(i, angle), run=name) for i, name in enumerate(runs))
    return replace(_AMPLITUDE, name=amplitude), *angles


def _search(view: View, mains_hz: float, harmonics: Sequence[int]) -> FindStarts:
    """Search for the spectral line of `mains_hz` in time, and those of its `harmonics`."""

    def find_lines(fit: ResidualView) -> Iterator[Values]:
        values = _line_in_time(view, fit, mains_hz, "A", "phi")
        for n in harmonics:
            values |= _line_in_time(view, fit, n * mains_hz, f"A{n}", f"phi{n}")
        yield values

    return find_lines


def _line_in_time(
    view: View, fit: ResidualView, hz: float, amplitude: str, angle: str
) -> dict[str, float]:
    """Amplitude (m) of the line over all runs, and its angle (rad) in each."""
    lines = dict.fromkeys(range(len(view.runs)), 0j)
    sizes = []
    for row, (run, reading) in view.positions().items():
        sine, cosine = sinusoid(2 * math.pi * hz * reading.time_s, residual_m(view, fit, row))
        lines[run] += complex(sine, cosine)
        sizes.append(math.hypot(sine, cosine))
    angles = {angle_in(run, angle): cmath.phase(line) for run, line in lines.items()}
    return {amplitude: float(np.sqrt(np.mean(np.square(sizes)))), **angles}
