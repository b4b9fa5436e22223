"""The next experiment: it parts what can be parted, by as much as it says, and breaks nothing."""

import dataclasses

import numpy as np
import pytest

import mopro
from mopro.emulator import Emulator
from mopro.engine import Estimate, Named, Verdict
from mopro.engine.residuals.remainder import Remainder
from mopro.engine.verdict import Gap
from mopro.experiment.sawyer.design import propose
from mopro.experiment.sawyer.test_motions import (
    Bounds,
    heating_excitations,
    moving_excitations,
    text_of,
)
from mopro.experiment.sawyer.trials import Experiment, Reading, Trial
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant import limit_trip, measure, measured_at, switches_u
from mopro.recording import MemorySink
from mopro.source import Source

MACHINE = load_machine("chow1992")
LASER = Sensor("laser", POSITION, "position_1_in", 1000.0, 1, 2e-5)
THERMOCOUPLE = Sensor("thermocouple", TEMPERATURE, "temperature_C", 0.1, 1, 0.5)
PROGRAM = mopro.compile("UU012500/1\nVEL1 5.0\nACC1 0.1\nMRI1 1.0\nWX1\n")
BARE = Bounds.of(MACHINE, MACHINE.axis.moving_mass_kg)


def experiment(sensor, payload_kg=0.0, times=None):
    times = np.arange(5) / sensor.rate_hz if times is None else times
    reading = Reading(sensor, times, np.zeros(len(times)))
    trial = Trial("run.csv", PROGRAM, None, payload_kg, (reading,))
    return Experiment(Source("experiment.toml", ""), MACHINE, (trial,), ())


def ambiguous(one, others, sigmas=50.0, beside=()):
    """`one` and each of `others` as effect name to parameters: the verdict on them.

    What was found as well is in all of them, and `beside` says how well it is known.
    """
    name, values = next(iter(one.items()))
    rivals = {next(iter(other)): other for other in others}
    named = Named(
        name, "", {p: Estimate(v, "1", (v, v), False) for p, v in values.items()},
        [*rivals], dict.fromkeys(rivals, 0.0), rivals, 100.0, sigmas, True,
    )  # fmt: skip
    gap = Gap("in", 1.0, 1.0, 1.0, None)
    effects = (named, *beside)
    return Verdict("ambiguous", effects, (), (), (), gap, Remainder(False, None, 1.0), one)


def seen(program, effects, sensor, for_s=None, payload_kg=0.0):
    """The reading of `sensor` without noise, by the command's own emulator; and the run."""
    emulator = Emulator(MACHINE, payload_kg, rate_hz=1.0 if for_s else 4000.0, effects=effects)
    sink = MemorySink()
    run = emulator.run(program, sink, for_s)
    recording = sink.recording(emulator.header(program), run)
    return measure(recording, sensor, MACHINE, emulator.active)[1], run


def warmed(program, effects, sensor):
    """The reading of a thermometer in an hour without noise, by the heat balance alone."""
    emulator = Emulator(MACHINE, effects=effects)
    stamps = np.arange(3600.0 * sensor.rate_hz + 1) / sensor.rate_hz
    temperature_C = emulator.begin(emulator.plan(program, 3600.0)).temperature_C(stamps)
    columns = {"time_s": stamps, "temperature_C": temperature_C}
    return measured_at(columns, sensor, MACHINE, emulator.active, stamps)


def apart(one, other, sensor):
    """By how many σ, where the size of an effect and an offset tell nothing."""
    difference = (one - other) - (one - other).mean()
    shape = other - other.mean()
    return float(np.linalg.norm(difference - shape * (shape @ difference) / (shape @ shape))) / (
        sensor.sigma
    )


DRAG = {"viscous_drag": {"b": 2.0}}
# As late at constant speed as that drag makes the forcer lag: b v / (k v).
LATE = {"trigger_delay": {"t_d": 2.0 / MACHINE.axis.stiffness_N_m}}


def test_a_drag_and_a_delay_are_parted_by_as_much_as_is_said():
    proposal = propose(experiment(LASER), ambiguous(DRAG, [LATE]))
    promised = proposal.separations["trigger_delay"]
    assert promised >= 6.0
    program = mopro.compile(proposal.text)
    (nothing, _), (drag, _), (late, _) = (
        seen(program, effects, LASER) for effects in (None, DRAG, LATE)
    )
    count = min(map(len, (nothing, drag, late)))
    measured = apart((drag - nothing)[:count], (late - nothing)[:count], LASER)
    assert promised == pytest.approx(measured, rel=0.15)
    assert f"trigger_delay by {promised:.3g} σ" in proposal.text.splitlines()[0]


def test_what_stands_beside_a_family_may_make_up_for_what_parts_it():
    """A mass that is hardly known makes up for much of what a drag does and a delay does not."""
    mass, heavier = ({"payload_mass": {"dm": dm}} for dm in (0.2, 0.201))
    beside = Named(
        "payload_mass", "", {"dm": Estimate(0.2, "kg", (-0.8, 1.2), False)}, [], {}, {},
        100.0, 50.0, True,
    )  # fmt: skip
    verdict = ambiguous({**DRAG, **mass}, [{**LATE, **mass}], beside=(beside,))
    proposal = propose(experiment(LASER), verdict)
    promised = proposal.separations["trigger_delay"]
    program = mopro.compile(proposal.text)
    runs = [
        seen(program, effects, LASER)[0]
        for effects in (None, {**DRAG, **mass}, {**LATE, **mass}, {**DRAG, **heavier})
    ]
    count = min(map(len, runs))
    nothing, drag, late, more = (run[:count] - run[:count].mean() for run in runs)
    shapes = np.stack([late - nothing, more - drag], axis=1)
    free = np.linalg.lstsq(shapes, drag - late)[0]
    parted = float(np.linalg.norm(drag - late - shapes @ free)) / LASER.sigma
    assert promised == pytest.approx(parted, rel=0.15)


def test_what_no_motion_can_part_gets_no_program():
    late = {"start_delay": {"d": 0.002, "every_move": 0.0}}
    assert propose(experiment(LASER), ambiguous(late, [{"trigger_delay": {"t_d": 0.002}}])) is None


def test_twins_do_not_keep_the_others_from_being_parted():
    twin = {"start_delay": {"d": LATE["trigger_delay"]["t_d"], "every_move": 0.0}}
    verdict = ambiguous(LATE, [DRAG, twin])
    proposal = propose(experiment(LASER), verdict)
    assert proposal.separations["viscous_drag"] >= 6.0
    assert proposal.separations["start_delay"] < 0.5
    assert "it does not distinguish start_delay" in proposal.summary


def test_two_rivals_that_stay_alike_are_told():
    twin = {"start_delay": {"d": LATE["trigger_delay"]["t_d"], "every_move": 0.0}}
    proposal = propose(experiment(LASER), ambiguous(DRAG, [LATE, twin]))
    assert min(proposal.separations.values()) >= 6.0
    assert proposal.pairs["trigger_delay", "start_delay"] < 0.5
    assert proposal.summary.endswith("; it does not distinguish trigger_delay from start_delay")


def test_rivals_are_parted_from_each_other_as_well():
    """The effect named first need not be the true one: alternatives are also compared in pairs."""
    lag = {"current_loop_lag": {"tau": 5e-4}}
    late, slow = {"trigger_delay": {"t_d": 2e-4}}, {"sensor_bandwidth": {"f_c": 1 / 2e-4 / 6.2832}}
    proposal = propose(experiment(LASER), ambiguous(lag, [late, slow]))
    assert set(proposal.separations) == {"trigger_delay", "sensor_bandwidth"}
    program = mopro.compile(proposal.text)
    nothing, *sides = (seen(program, effects, LASER)[0] for effects in (None, late, slow))
    count = min(map(len, (nothing, *sides)))
    measured = apart(*((side - nothing)[:count] for side in sides), LASER)
    assert measured > 6.0
    assert proposal.pairs["trigger_delay", "sensor_bandwidth"] == pytest.approx(measured, rel=0.15)


def test_it_lasts_no_longer_than_it_must_and_never_beyond_a_minute_and_a_half():
    """The better the sensor, the shorter; at its limit as long as a person waits."""
    lasting = {}
    for noise in (2e-5, 4e-5, 2e-4):
        sensor = dataclasses.replace(LASER, noise_rms=noise)
        proposal = propose(experiment(sensor), ambiguous(DRAG, [LATE]))
        lasting[noise] = mopro.emulate(mopro.compile(proposal.text)).columns["time_s"][-1]
    assert lasting[2e-5] <= lasting[4e-5] <= lasting[2e-4] <= 91.0


@pytest.mark.parametrize("payload_kg", [0.0, 2.268])
def test_no_motion_stalls_even_with_a_fifth_less_force(payload_kg):
    bounds = Bounds.of(MACHINE, MACHINE.axis.moving_mass_kg + payload_kg)
    motions = [motion for motion in moving_excitations(bounds) if motion.wait_ms < 1000]
    program = mopro.compile(text_of(MACHINE, 1, motions))
    weak = {"force_constant": {"e": -0.2}}
    _, run = seen(program, weak, LASER, payload_kg=payload_kg)
    assert not run.stalled
    assert min(move.stall_margin for move in run.moves) > 0.05
    assert all(move.lost_pitches == 0 for move in run.moves)


def test_no_rival_loses_its_tooth_in_what_is_proposed():
    """A controller that moves on every ten milliseconds pulls in jerks, the harder the faster."""
    tick = {"profile_tick": {"T": 0.01, "interpolate": 1.0}}
    lvdt = Sensor("lvdt", POSITION, "position_1_in", 800.0, 1, 0.025)
    proposal = propose(experiment(lvdt), ambiguous({"trigger_delay": {"t_d": 0.01}}, [tick]))
    assert proposal.separations["profile_tick"] > 6.0
    _, run = seen(mopro.compile(proposal.text), tick, lvdt)
    assert not run.stalled
    assert min(move.stall_margin for move in run.moves) > 0.0


def test_motions_stay_within_the_travel_on_both_axes():
    for motion in (*moving_excitations(BARE), *heating_excitations(BARE)):
        schedule = plan(mopro.compile(text_of(MACHINE, 1, [motion])), for_s=30.0)
        switches = switches_u(schedule, MACHINE.travel_u())
        assert limit_trip(schedule, switches) is None, motion.what


STROKED = {"platen_conduction": {"G": 0.0, "g": 20.0, "T_p": MACHINE.heat.ambient_C}}
FLOW = {"convection_scale": {"e": 0.5}}


def test_a_thermometer_gets_a_motion_for_ever_that_is_not_too_hot():
    proposal = propose(experiment(THERMOCOUPLE), ambiguous(STROKED, [FLOW]))
    program = mopro.compile(proposal.text)
    assert program.loops_forever
    assert proposal.separations["convection_scale"] > 2.0
    assert "for 60 min" in proposal.text.splitlines()[1]
    warm, _ = seen(program, STROKED, THERMOCOUPLE, for_s=3600.0)
    assert MACHINE.heat.ambient_C + 5 < warm.max() < MACHINE.heat.rated_C


def test_a_logger_that_grew_slow_is_taken_to_do_so_again():
    """Every second for ten minutes, then every quarter of one: 800 readings in an hour."""
    every_second = dataclasses.replace(THERMOCOUPLE, rate_hz=1.0)
    slower = np.concatenate([np.arange(0.0, 600.0), np.arange(600.0, 900.0, 15.0)])
    lag, flow = {"thermocouple_lag": {"tau": 20.0}}, {"convection_scale": {"e": -0.02}}
    proposal = propose(experiment(every_second, times=slower), ambiguous(lag, [flow], 3.0))
    program = mopro.compile(proposal.text)
    nothing, *sides = (warmed(program, effects, every_second) for effects in (None, lag, flow))
    read = np.concatenate([np.arange(0, 600), np.arange(600, 3600, 15)])
    measured = apart(*((side - nothing)[read] for side in sides), every_second)
    assert proposal.separations["convection_scale"] == pytest.approx(measured, rel=0.15)


@pytest.mark.parametrize("payload_kg", [0.0, 1.0, 2.3])
def test_ways_are_whole_microsteps(payload_kg):
    """Half a microstep is rounded this way or that, which shows in the time a move takes."""
    bounds = Bounds.of(MACHINE, MACHINE.axis.moving_mass_kg + payload_kg)
    program = mopro.compile(text_of(MACHINE, 1, moving_excitations(bounds)))
    per_inch = 12500
    ways = [float(word) for line in str(program.source.text).splitlines()
            if line.startswith("MRI1") for word in line.split()[1:]]  # fmt: skip
    assert len(ways) > 20
    assert np.abs(np.remainder(np.array(ways) * per_inch + 0.5, 1.0) - 0.5).max() < 0.02
