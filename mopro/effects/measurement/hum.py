"""Mains hum in a sensor's signal."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from mopro.effects.base import Domain, Effect, Floats, Parameter, View, angle_in, phase
from mopro.effects.search import Values, residual_m
from mopro.engine.candidate import Candidate, FindStarts, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.engine.spectrum import sinusoid

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
            off = {f"A{n}": 0.0 for n in _HARMONICS if n not in harmonics}
            yield self.form(
                *main, *(p for n in harmonics for p in lines[n]),
                form=f"{' and '.join(f'{n * mains:g}' for n in (1, *harmonics))} Hz",
                fixed={"f": mains, **off}, extends=f"{mains:g} Hz" if harmonics else None,
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
