"""Pictures of effects: the change of a reading when one is switched on at its default size."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import mopro
from mopro.effects import Active, catalogue
from mopro.effects.registry import own_effects
from mopro.effects.resolve import active_effects
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.plant import Stepping, measured_at, plan_with_effects, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

# Strokes at two speeds both ways, with the other axis away from its middle.
STROKES = """UU012500/1
VEL0 15.0
ACC0 0.1
MRI2 3.0
WX2
MRI1 4.0
WX1
WT200
MRI1 -4.0
WX1
WT200
VEL1 5.0
MRI1 1.0
WX1
WT600
MRI1 1.0
WX1
WT100
"""
HEATING = """UU012500/1
VEL0 15.0
ACC0 0.2
:A
MRI1 8.0
WX1
MRI1 -8.0
WX1
JUMP A
"""
HEATED_S = 2400.0
_RATE_HZ = 2000.0
_LASER = Sensor("laser", POSITION, "position_1_um", _RATE_HZ)
_THERMOCOUPLE = Sensor("thermocouple", TEMPERATURE, "temperature_C", 0.1)
# A change below these is none that a picture could show (µm, K).
_LEAST_UM, _LEAST_K = 0.05, 1e-3
_MOST_POINTS = 500
# As a diagnosis simulates: within 0.1 µm.
_STEPPING = Stepping(2.5e-4, 5e-5)


class Signatures:
    """The nominal readings, and what an effect adds to them."""

    def __init__(self) -> None:
        self.machine = mopro.load_machine("chow1992")
        self.strokes = mopro.compile(STROKES, "strokes.CMD")
        self.heating = mopro.compile(HEATING, "heating.CMD")
        self._position = self._positions(())
        self._temperature = self._temperatures(())

    def of(self, name: str) -> tuple[Floats, Floats, str]:
        """Times, change of the reading, and its label for an effect at its default size."""
        effect = catalogue()[name]
        values = {p.name: p.default for p in effect.parameters}
        active = active_effects(self.machine.with_effects({name: values}), catalogue())
        added = _change(self._position, self._positions(active))
        if np.abs(added[1]).max() > _LEAST_UM:
            return *added, "position (µm)"
        added = _change(self._temperature, self._temperatures(active))
        return added[0] / 60.0, added[1], "temperature (K)"

    def _positions(self, active: tuple[Active, ...]) -> tuple[Floats, Floats]:
        schedule = plan_with_effects(self.strokes, self.machine, active, None)
        stamps = np.arange(int(schedule.duration_s * _RATE_HZ)) / _RATE_HZ
        simulation = simulate(
            schedule, self.machine, active, _STEPPING, resolved=False, trips=False
        )
        columns = simulation.advance(stamps, float(stamps[-1]))
        return stamps, measured_at(columns, _LASER, self.machine, active, stamps)

    def _temperatures(self, active: tuple[Active, ...]) -> tuple[Floats, Floats]:
        schedule = plan_with_effects(self.heating, self.machine, active, HEATED_S)
        simulation = simulate(schedule, self.machine, active, resolved=False, trips=False)
        grid = np.arange(0.0, HEATED_S, 1.0)
        columns = {"time_s": grid, "temperature_C": simulation.temperature_C(grid)}
        stamps = grid[::10]
        return stamps, measured_at(columns, _THERMOCOUPLE, self.machine, active, stamps)


def _change(off: tuple[Floats, Floats], on: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    count = min(len(off[0]), len(on[0]))
    return off[0][:count], on[1][:count] - off[1][:count]


def pictures() -> Iterator[tuple[str, str, str]]:
    """The name of each effect with a visible change, its picture as SVG, and its caption."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    signatures = Signatures()
    with rc_context({"svg.fonttype": "none", "font.family": "sans-serif", "font.size": 8}):
        for name in own_effects():
            times, change, label = signatures.of(name)
            if np.abs(change).max() < _LEAST_K:
                continue
            figure = Figure(figsize=(6.5, 1.7))
            _draw(figure, times, change, label)
            image = io.BytesIO()
            figure.savefig(image, format="svg", metadata={"Date": None})
            yield name, image.getvalue().decode(), _caption(name, label)


def _draw(figure: Figure, times: Floats, change: Floats, label: str) -> None:
    from mopro.recording.envelope import Band
    from mopro.recording.figure import BLUE

    panel = figure.add_axes((0.11, 0.25, 0.88, 0.7))
    area = Band.of(times, change).coarse(_MOST_POINTS)
    if area.folded:
        panel.fill_between(area.time_s, area.low, area.high, color=BLUE, alpha=0.3, linewidth=0)
    panel.plot(area.time_s, (area.low + area.high) / 2, color=BLUE, linewidth=0.9)
    panel.set_ylabel(label)
    panel.set_xlabel("time (min)" if "K" in label else "time (s)")
    panel.grid(alpha=0.3)


def _caption(name: str, label: str) -> str:
    parameters = ", ".join(
        f"{p.name} = {p.default:g}" + ("" if p.unit == "1" else f" {p.unit}")
        for p in catalogue()[name].parameters
        if p.default
    )
    motion = "40 minutes of strokes of 8 in" if "K" in label else "strokes of 4, -4, 1 and 1 in"
    return f"Change of the {label.split()[0]} by {name} ({parameters}), over {motion}"
