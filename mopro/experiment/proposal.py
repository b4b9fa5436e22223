"""The experiment that would tell rivals apart.

Short pieces of motion that bring out different things (speed, acceleration, stroke,
resonance, a long wait) are each tried on the model under every rival; those that part the
rivals best are put together into one program.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.api import compile as compile_text
from mopro.diagnosis import Named, Settings, Verdict
from mopro.emulator.measured import POSITION, Sensor
from mopro.experiment.model import Experiment, Floats, Reading, Trial
from mopro.experiment.motor import Motor
from mopro.machine import Machine
from mopro.motion import plan
from mopro.units import INCH_M

# A rival is parted at five standard deviations; more of it is worth little.
_PARTED = 5.0
_MOST_PIECES = 8
_MOST_RIVALS = 8
_AFTER_S = 0.3
_REST_MS = 300
_LONGEST_IN = 15.0
_SHARE_OF_TRAVEL = 0.7
_SHARE_OF_FORCE = 0.35
_FASTEST_IN_S = 30.0


@dataclass(frozen=True)
class Piece:
    """One motion forth and back, in inches and seconds; `wait_ms` goes before and between."""

    what: str
    distance: float
    velocity: float
    acceleration: float
    parabolic: bool = False
    wait_ms: int = _REST_MS
    both_axes: bool = False

    def statements(self, axis: int) -> Iterator[str]:
        yield f"; {self.what}"
        axes = (axis, 3 - axis) if self.both_axes else (axis,)
        for n in axes:
            yield f"VEL{n} {self.velocity:.5f}"
            yield f"ACC{n} {self.acceleration / 1000:.5f}"
            yield f"PARA{n}{'+' if self.parabolic else '-'}"
        for way in (self.distance, -self.distance):
            yield f"WT{self.wait_ms}"
            yield from (f"MRI{n} {way:.4f}" for n in axes)
            yield from (f"WX{n}" for n in axes)
        yield f"WT{_REST_MS}"


@dataclass(frozen=True)
class Proposal:
    """A program to run, and by how many σ it separates each rival from what was named."""

    text: str
    summary: str
    separations: dict[str, float]


@dataclass(frozen=True)
class _Contest:
    """An effect, its settings and a rival's; `known` is the relative error of its size."""

    rival: str
    settings: Settings
    other: Settings
    known: float


def propose(experiment: Experiment, verdict: Verdict) -> Proposal | None:
    """The program that separates the named effects best from their rivals.

    None where there is no position sensor to see a motion with.
    """
    sensors = [r.sensor for t in experiment.trials for r in t.readings]
    sensor = next((s for s in sensors if s.quantity == POSITION), None)
    contests = [c for effect in verdict.effects for c in _contests(verdict, effect)]
    if sensor is None or not contests:
        return None
    payload_kg = experiment.trials[0].payload_kg
    pieces = _pieces(experiment.machine, payload_kg)
    parted = {p: _parted(experiment, sensor, payload_kg, [p], contests) for p in pieces}
    chosen: list[Piece] = []
    so_far = np.zeros(len(contests))
    while len(chosen) < _MOST_PIECES:
        # One that is repeated tells more each time.
        best = max(pieces, key=lambda p: _worth(so_far + parted[p] ** 2))
        if so_far.min() > _PARTED**2:
            break
        chosen.append(best)
        so_far = so_far + parted[best] ** 2
    return _proposal(experiment, sensor, payload_kg, chosen, contests)


def _contests(verdict: Verdict, effect: Named) -> list[_Contest]:
    known = 1 / max(effect.sigmas, 1.0)
    others = list(effect.alternatives.items())[:_MOST_RIVALS]
    return [_Contest(name, verdict.settings, settings, known) for name, settings in others]


def _worth(squares: Floats) -> float:
    """How well everything is parted: the first σ of each rival count most."""
    return float(np.sum(np.minimum(squares, _PARTED**2)) + 1e-3 * np.sum(np.log1p(squares)))


def _parted(
    experiment: Experiment,
    sensor: Sensor,
    payload_kg: float,
    pieces: Sequence[Piece],
    contests: Sequence[_Contest],
) -> Floats:
    """By how many σ the pieces separate the two sides of each contest.

    The size of an effect is as well known as the data so far tell it; a constant offset
    tells nothing.
    """
    motor = Motor(_imagined(experiment, sensor, payload_kg, pieces))
    seen: dict[str, Floats] = {}

    def prediction(settings: Settings) -> Floats:
        key = repr(sorted((n, sorted(v.items())) for n, v in settings.items()))
        if key not in seen:
            (values,) = motor(settings)
            seen[key] = (values - values.mean()) / sensor.sigma
        return seen[key]

    nothing = prediction({})
    return np.array(
        [
            _distance(prediction(c.settings) - nothing, prediction(c.other) - nothing, c.known)
            for c in contests
        ]
    )


def _distance(one: Floats, other: Floats, known: float) -> float:
    """The least |one - (1 + α) other|, α being known to be 0 within `known`."""
    strength = float(other @ other)
    alpha = float(other @ (one - other)) / (strength + 1 / known**2)
    apart = one - (1 + alpha) * other
    return math.sqrt(float(apart @ apart) + (alpha / known) ** 2)


def _imagined(
    experiment: Experiment, sensor: Sensor, payload_kg: float, pieces: Sequence[Piece]
) -> Experiment:
    """The experiment that the pieces would be, its data still to come."""
    program = compile_text(_text(experiment.machine, sensor.axis, pieces), "next.CMD")
    end_s = plan(program).duration_s + _AFTER_S
    times = np.arange(math.floor(end_s * sensor.rate_hz)) / sensor.rate_hz
    reading = Reading(sensor, times, np.zeros(len(times)))
    trial = Trial("next.csv", program, None, payload_kg, (reading,))
    return replace(experiment, trials=(trial,), tables=())


def _text(machine: Machine, axis: int, pieces: Sequence[Piece]) -> str:
    per_inch = round(float(INCH_M) / machine.microstep_m)
    lines = [f"UU{per_inch:06d}/1"]
    for piece in pieces:
        lines += piece.statements(axis)
    return "\n".join(lines) + "\n"


def _pieces(machine: Machine, payload_kg: float) -> list[Piece]:
    """Motions within travel, speed and force, the bare motor's resonance among them."""
    inch = float(INCH_M)
    shortest_way = min(high - low for low, high in machine.travel_u().values())
    stroke = min(_LONGEST_IN, _SHARE_OF_TRAVEL * shortest_way * machine.microstep_m / inch)
    force = _SHARE_OF_FORCE * machine.axis.pull_out_force_N
    hardest = force / (machine.axis.moving_mass_kg + payload_kg) / inch
    natural_hz = math.sqrt(
        machine.axis.stiffness_N_m / (machine.axis.moving_mass_kg + payload_kg)
    ) / (2 * math.pi)
    resonant = machine.axis.pitch_m / inch * natural_hz
    middling, gentle = min(200.0, hardest), min(50.0, hardest)
    mid = stroke / 2
    speeds = (2.0, 6.0, 15.0, _FASTEST_IN_S)
    return [
        *(Piece(f"speed {v:g} in/s", min(mid, 2 * v), v, middling) for v in speeds),
        *(
            Piece(f"acceleration {a:.0f} in/s2", mid, 25.0, a)
            for a in (gentle, hardest / 2, hardest)
        ),
        *(Piece(f"stroke {s:.3g} in", s, 15.0, middling) for s in (1.0, stroke)),
        *(
            Piece(f"slow scan {v:.3g} in/s, resonance of order {h}", 1.5, v, gentle)
            for h in (1, 2, 4)
            for v in (resonant / h,)
        ),
        Piece("parabolic ramps", stroke, _FASTEST_IN_S, hardest, parabolic=True),
        Piece("a long wait", mid, 15.0, middling, wait_ms=10_000),
        Piece("both axes", mid, 15.0, middling, both_axes=True),
    ]


def _proposal(
    experiment: Experiment,
    sensor: Sensor,
    payload_kg: float,
    chosen: Sequence[Piece],
    contests: Sequence[_Contest],
) -> Proposal:
    parted = _parted(experiment, sensor, payload_kg, chosen, contests)
    separations: dict[str, float] = {}
    for contest, apart in zip(contests, parted.tolist(), strict=True):
        separations[contest.rival] = min(apart, separations.get(contest.rival, math.inf))
    words = ", ".join(f"{name} by {apart:.3g} σ" for name, apart in separations.items())
    summary = f"with {payload_kg:g} kg it should separate {words}"
    return Proposal(_commented(experiment, sensor, summary, chosen), summary, separations)


def _commented(
    experiment: Experiment, sensor: Sensor, summary: str, chosen: Sequence[Piece]
) -> str:
    head = f"; {summary}\n; {_way(chosen)}\n"
    return head + _text(experiment.machine, sensor.axis, chosen)


def _way(chosen: Sequence[Piece]) -> str:
    longest = max(piece.distance for piece in chosen)
    return f"Goes forth and back by up to {longest:.3g} in from where it starts."
