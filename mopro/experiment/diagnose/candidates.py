"""The emulator's effects as candidates of the diagnosis: what is fitted of each, and where from.

An effect states its parameters and their plausible ranges; here stands which of them a
measurement can tell, in which forms, and where a fit begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from mopro.diagnosis import Candidate, Parameter, Role
from mopro.effects import catalogue
from mopro.effects.resolve import values_by_effect
from mopro.experiment.diagnose import thermal
from mopro.experiment.diagnose.hold_current_search import EARLIEST_S, Rests
from mopro.experiment.diagnose.start_search import Seeker
from mopro.experiment.model import Experiment
from mopro.experiment.predict.forward_model import AXIS, RUN, Motor, angle_in
from mopro.instruments.sensor import POSITION, TEMPERATURE
from mopro.machine import Machine

# A range is fitted this far beyond what is plausible, so that its ends can be told.
_WIDER = 1.5
# Masses that are tried are so many times apart.
_HEAVIER = 1.12
# The most to expect of the teeth, as a share of the pull-out force.
_MOST_DETENT = 0.1
# Of the mains, that a sensor may show besides.
_HARMONICS = (2, 3)
# Where the middle of a bend is looked for.
_MIDDLES_TRIED = 7
# What a machine has already is tried this share of the range away from it.
_APART = 0.1


def candidates(motor: Motor) -> list[Candidate]:
    """What the experiment's sensors could show, in all forms."""
    experiment = motor.experiment
    quantities = {r.sensor.quantity for t in experiment.trials for r in t.readings}
    found: list[Candidate] = []
    if POSITION in quantities:
        found += _of_position(motor)
    if TEMPERATURE in quantities or experiment.tables:
        found += thermal.candidates(experiment.machine)
    if TEMPERATURE in quantities:
        found += _of_warming()
    stated = values_by_effect(experiment.machine, catalogue())
    found = [_from_the_machine(c, stated[c.name]) if c.name in stated else c for c in found]
    return [_with_tolerance(candidate, experiment.machine) for candidate in found]


def _of_position(motor: Motor) -> Iterator[Candidate]:
    experiment = motor.experiment
    yield from _forces(experiment)
    yield from _drive(Rests(motor))
    yield from _commands(motor)
    seen = {
        r.sensor.axis
        for t in experiment.trials
        for r in t.readings
        if r.sensor.quantity == POSITION
    }
    for candidate in _measurements(motor):
        yield candidate
        for axis in sorted(seen) if len(seen) > 1 else ():
            yield _on_one(candidate, axis)


def _on_one(candidate: Candidate, axis: int) -> Candidate:
    """The same on one axis alone, as each has a sensor of its own."""
    form = f"{candidate.form}, axis {axis}".removeprefix(", ")
    extends = f"{candidate.extends}, axis {axis}".removeprefix(", ")
    return replace(
        candidate,
        form=form,
        fixed={**candidate.fixed, AXIS: axis},
        extends=None if candidate.extends is None else extends,
    )


# -- stage D -----------------------------------------------------------------------


def _forces(experiment: Experiment) -> Iterator[Candidate]:
    machine = experiment.machine
    yield _one("payload_mass", "dm", 0.02, *_heavier(machine.axis.moving_mass_kg))
    yield _one("viscous_drag", "b", 3.0)
    yield _one("quadratic_drag", "c", 1.5)
    coulomb = _one("coulomb_friction", "Fc", 1.0, 3.0, 9.0, fixed={"delta": 5e-6})
    yield coulomb
    presliding = Parameter("delta", "m", 5e-7, 5e-5, (5e-6,), Role.SHAPE, plausible=(1e-6, 2e-5))
    yield replace(
        coulomb, parameters=(*coulomb.parameters, presliding), fixed={},
        form="presliding fitted", extends="",
    )  # fmt: skip
    spring = _one("umbilical_spring", "k_h", 10.0, fixed={"x_h": 0.0})
    yield spring
    free_end = Parameter("x_h", "m", -0.9, 0.9, (0.0,), Role.SHAPE, plausible=(-0.6, 0.6))
    yield replace(
        spring, parameters=(*spring.parameters, free_end), fixed={},
        form="free end fitted", extends="",
    )  # fmt: skip
    yield _one("constant_force", "F_b", 1.0)
    yield Candidate("electrical_damping", (_damping(machine.axis.damping_ratio),))
    yield _one("force_constant", "e", 0.003, -0.05, 0.09, -0.11, -0.17, 0.17)
    yield from _weakening(machine.heat.ambient_C)
    yield _detent(machine)


def _heavier(mass_kg: float) -> Iterator[float]:
    """Payloads to try beside a mass, to the end of the plausible range.

    A ring's frequency goes with both masses and forces: a signature taken too far off is out
    of phase with what it is to show.
    """
    _, most = catalogue()["payload_mass"].parameter("dm").plausible
    total_kg = _HEAVIER * mass_kg
    while total_kg < mass_kg + most:
        yield total_kg - mass_kg
        total_kg *= _HEAVIER
    yield most


def _detent(machine: Machine) -> Candidate:
    """Shares of the pull-out force, small ones and large ones, as a ring bends under it.

    Where the teeth pass at their own frequency the answer is no mirror image half a turn on.
    """
    most = _MOST_DETENT * machine.axis.pull_out_force_N
    own = _own("detent_force", "Fd", most / 4, 0.75 * most)
    highest = min(_WIDER * most, catalogue()["detent_force"].parameter("Fd").high)
    force = replace(own, high=highest, plausible=(0.0, most))
    return Candidate(
        "detent_force", (force, _angle("phi", 0.0, math.pi)), fixed={"pitch": machine.axis.pitch_m}
    )


def _damping(ratio: float) -> Parameter:
    """Tried at half and twice what the machine has; a machine with much may have more."""
    own = _own("electrical_damping", "zeta", *((ratio / 2, 2 * ratio) if ratio else (0.01, 0.05)))
    low, high = own.plausible or (own.low, own.high)
    return replace(
        own, low=0.0, high=max(own.high, 2 * _WIDER * ratio), null=ratio,
        plausible=(low, max(high, 2 * ratio)),
    )  # fmt: skip


def _weakening(air_C: float) -> Iterator[Candidate]:
    """Magnets weaken from the air's temperature on, or from where they were measured."""
    own = _one("force_constant_temperature", "alpha", 5e-4, fixed={"T0": air_C})
    yield own
    for measured_C in catalogue()["force_constant_temperature"].parameter("T0").plausible:
        yield replace(own, form=f"measured at {measured_C:g} C", fixed={"T0": measured_C})


def _drive(rests: Rests) -> Iterator[Candidate]:
    yield _one("phase_gain_imbalance", "eps", 0.03)
    yield _one("quadrature_error", "phi", 0.02)
    offsets = [_own("phase_current_offset", name, 0.01) for name in ("o_a", "o_b")]
    yield Candidate("phase_current_offset", tuple(offsets))
    yield _one("current_third_harmonic", "s", 0.01)
    # A shorter lag is a mere delay.
    lag = replace(_own("current_loop_lag", "tau", 5e-5, 3e-4), low=1e-5)
    yield Candidate("current_loop_lag", (lag,))
    supply = Parameter(
        "Vb", "V", 25.0, 225.0, (40.0, 50.0, 90.0), Role.SHAPE,
        plausible=(40.0, 150.0), inverse=True,
    )  # fmt: skip
    yield Candidate("voltage_saturation", (supply,))
    held = Parameter("h", "1", 0.1, 1.0, (0.5,), null=1.0, plausible=(0.3, 1.0))
    # A thousandth of the range is half a period of the ring.
    after = Parameter(
        "t_h", "s", EARLIEST_S, 6.0, (0.05, 0.2, 0.7, 2.0), Role.SHAPE, difference=1e-5
    )
    yield Candidate("hold_current_reduction", (held, after), find_starts=rests.lower_current)


# -- stage C -----------------------------------------------------------------------


def _commands(motor: Motor) -> Iterator[Candidate]:
    """A logged command has no program that a controller could take in another way."""
    yield _one("controller_clock", "e", 3e-4)
    seek = Seeker(motor)
    tick = Parameter(
        "T", "s", 1e-4, 0.015, role=Role.SHAPE, plausible=(2.5e-4, 0.0125), difference=1e-6
    )
    for form, interpolate in (("interpolated", 1.0), ("held", 0.0)):
        yield Candidate(
            "profile_tick", (tick,), form, {"interpolate": interpolate},
            find_starts=seek.interpolated_tick if interpolate else seek.held_tick,
        )  # fmt: skip
    if any(trial.program is None for trial in motor.experiment.trials):
        return
    yield _one("acceleration_scale", "e", 0.02, -0.1, 0.1, -0.35, 0.4)
    yield _one("velocity_scale", "e", 1e-3, -0.01, 0.015)
    delay = _own("start_delay", "d", 1e-3, 8e-3)
    yield Candidate("start_delay", (delay,), "once", {"every_move": 0.0})
    yield Candidate("start_delay", (delay,), "each move", {"every_move": 1.0})
    numbers = [
        Parameter(name, "1", -1e9, 1e9, role=Role.SEARCHED) for name in ("n", "move", "at", RUN)
    ]
    yield Candidate("lost_steps", tuple(numbers), flexible=True, find_starts=seek.lost_steps)


# -- stage M -----------------------------------------------------------------------


def _measurements(motor: Motor) -> Iterator[Candidate]:
    steel = catalogue()["platen_expansion"].parameter("alpha").default
    yield _one("pitch_scale", "e", 1e-4)
    yield _one("platen_expansion", "dT", 10.0, fixed={"share": 0.0, "alpha": steel})
    yield replace(
        _one("platen_expansion", "share", 0.5, fixed={"dT": 0.0, "alpha": steel}),
        form="with the forcer",
    )
    yield _one("sensor_gain", "g", 1e-3)
    yield _one("cross_axis_coupling", "gamma", 2e-4)
    # Each further micrometre has fewer rings to take its slack up in.
    yield Candidate("backlash", (replace(_own("backlash", "B", 3e-6, 3e-5), difference=1e-5),))
    corner = Parameter(
        "f_c", "Hz", 33.0, 1e7, (150.0, 500.0), plausible=(50.0, 2e4), inverse=True, null=math.inf
    )
    yield Candidate("sensor_bandwidth", (corner,))
    yield _one("trigger_delay", "t_d", 1e-3)
    yield _one("sample_clock", "e", 3e-4)
    yield from _bends(motor)
    yield from _lines(motor)


def _bends(motor: Motor) -> Iterator[Candidate]:
    """Shares of the range that the effect states, about the middle of the way or another place."""
    low, high = motor.way_m()
    middle, half = (low + high) / 2, catalogue()["sensor_nonlinearity"].parameter("half").default
    fixed = {"c5": 0.0, "mid": middle, "half": half}
    cubic = replace(_own("sensor_nonlinearity", "c3", 1e-3), low=-0.1, high=0.1)
    cubic = replace(cubic, plausible=(-0.05, 0.05))
    yield Candidate("sensor_nonlinearity", (cubic,), "cubic", fixed)
    quintic = replace(cubic, name="c5")
    yield Candidate(
        "sensor_nonlinearity", (cubic, quintic), "cubic and quintic",
        {"mid": middle, "half": half}, extends="cubic", flexible=True,
    )  # fmt: skip
    # A way that lies to one side of the sensor's middle shows little of a bend about its own.
    places = tuple(np.linspace(low - half / 2, high + half / 2, _MIDDLES_TRIED).tolist())
    mid = Parameter("mid", "m", low - half, high + half, places, Role.SHAPE, null=middle)
    elsewhere = Candidate(
        "sensor_nonlinearity", (cubic, mid), "cubic, middle fitted",
        {"c5": 0.0, "half": half}, extends="cubic", can_enter_first=True, flexible=True,
    )  # fmt: skip
    yield elsewhere
    yield replace(
        elsewhere, parameters=(cubic, quintic, mid), fixed={"half": half},
        form="cubic and quintic, middle fitted", extends=elsewhere.form,
    )  # fmt: skip


def _lines(motor: Motor) -> Iterator[Candidate]:
    seek = Seeker(motor)
    period = Parameter(
        "lambda", "m", 8e-5, 0.15, role=Role.SHAPE, inverse=True, difference=1e-6,
        plausible=(1e-4, 0.1),
    )  # fmt: skip
    amplitude = Parameter("A", "m", 0.0, 1e-2)
    yield Candidate(
        "periodic_error", (amplitude, period, _angle("phi")), flexible=True, find_starts=seek.period
    )
    runs = range(len(motor.experiment.trials))
    lines = {
        n: (replace(amplitude, name=f"A{n}"), *(_angle(angle_in(run, f"phi{n}")) for run in runs))
        for n in _HARMONICS
    }
    main = (amplitude, *(_angle(angle_in(run)) for run in runs))
    for mains, harmonics in product((50.0, 60.0), ((), _HARMONICS, *combinations(_HARMONICS, 1))):
        off = {f"A{n}": 0.0 for n in _HARMONICS if n not in harmonics}
        yield Candidate(
            "hum", (*main, *(p for n in harmonics for p in lines[n])),
            f"{' and '.join(f'{n * mains:g}' for n in (1, *harmonics))} Hz",
            {"f": mains, **off}, extends=f"{mains:g} Hz" if harmonics else None,
            can_enter_first=harmonics == _HARMONICS, find_starts=seek.hum(mains, harmonics),
        )  # fmt: skip


# -- stage T -----------------------------------------------------------------------


def _of_warming() -> Iterator[Candidate]:
    """What shows on the way to a steady state only."""
    yield _one("ambient_drift", "r", 1e-4)
    yield _one("thermocouple_lag", "tau", 10.0)


# -- parameters --------------------------------------------------------------------


def _one(
    name: str, parameter: str, *starts: float, fixed: Mapping[str, float] | None = None
) -> Candidate:
    return Candidate(name, (_own(name, parameter, *starts),), fixed=fixed or {})


def _own(name: str, parameter: str, *starts: float) -> Parameter:
    """The effect's parameter, in a range somewhat wider than the plausible one."""
    stated = catalogue()[name].parameter(parameter)
    low, high = stated.plausible
    low = low if low < 0 else 0.0
    wider = (_WIDER * low, _WIDER * high)
    return Parameter(
        parameter, stated.unit, max(wider[0], stated.low), min(wider[1], stated.high),
        starts, plausible=(low, high),
    )  # fmt: skip


def _angle(name: str, *starts: float) -> Parameter:
    return Parameter(name, "rad", -math.pi, math.pi, starts, Role.PHASE)


def _from_the_machine(candidate: Candidate, own: Mapping[str, float]) -> Candidate:
    """An effect that the machine has already, with `own` values, is off where it has those.

    What is no form's, and is not fitted, is as the machine has it.
    """
    fixed = {name: own.get(name, value) for name, value in candidate.fixed.items()}
    parameters = tuple(
        _about(p, own[p.name]) if p.role is Role.AMPLITUDE and p.name in own else p
        for p in candidate.parameters
    )
    return replace(
        candidate, parameters=parameters, fixed=candidate.fixed if candidate.form else fixed
    )


def _about(parameter: Parameter, null: float) -> Parameter:
    """`parameter`, off at `null`, and tried at other values."""
    low, high = parameter.low, parameter.high
    moved = replace(parameter, null=null, low=min(low, null), high=max(high, null))
    place = moved.scaled(null)
    away = moved.value(place + (_APART if place < 1 - _APART else -_APART))
    starts = dict.fromkeys(away if start == null else start for start in parameter.starts)
    return replace(moved, starts=tuple(starts))


def _with_tolerance(candidate: Candidate, machine: Machine) -> Candidate:
    """An effect that may correct a number which the machine file states with a tolerance.

    The tolerance stays about what the file states, wherever an effect in it has moved that.
    """
    ratio = machine.axis.damping_ratio
    key, middle, scale = {
        "force_constant": ("axis.pull_out_force", 0.0, 1.0),
        "electrical_damping": ("axis.damping_ratio", ratio, ratio),
    }.get(candidate.name, ("", 0.0, 0.0))
    source = machine.provenance.get(key)
    reach = scale * source.tolerance if source else 0.0
    if not reach:
        return candidate
    (own,) = candidate.parameters
    stated = catalogue()[candidate.name].parameter(own.name)
    low, high = own.plausible or (own.low, own.high)
    tolerant = replace(
        own,
        low=max(min(own.low, middle - _WIDER * reach), stated.low),
        high=min(max(own.high, middle + _WIDER * reach), stated.high),
        plausible=(min(low, middle - reach), max(high, middle + reach)),
        tolerated=(middle - reach, middle + reach),
    )
    return replace(candidate, parameters=(tolerant,))
