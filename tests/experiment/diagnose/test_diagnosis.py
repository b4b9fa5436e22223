"""The motor's catalogue through the engine: what a recording holds is named, and no more."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import lfilter

import mopro
from helpers.diagnosis import all_but, diagnose
from mopro.experiment.sawyer import forward_model as motor
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.repaired import machine_of, machine_text
from mopro.experiment.sawyer.trials import Experiment, LoggedCommand, Reading, Trial
from mopro.experiment.wording import sentence
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.motion import plan
from mopro.source import Source

MACHINE = load_machine("chow1992")
HEAD = "UU012500/1\nVEL1 {}\nACC1 {}\nPARA1{}\nWT50\n"
PROGRAMS = tuple(
    mopro.compile(HEAD.format(v, a, p) + "".join(f"MRI1 {w}\nWX1\nWT250\n" for w in ways))
    for v, a, p, ways in ((20, 0.2, "-", (4.0, -4.0)), (30, 0.4, "+", (5.0, -2.0, -3.0)))
)
# What a search found has no interval.
SEARCHED = ("n", "move", "at", "run")
FINE = Sensor("laser", POSITION, "position_1_in", 1000.0, 1, 2e-5)
SHARP = dataclasses.replace(FINE, noise_rms=4e-6)
COARSE = dataclasses.replace(FINE, name="coarse", noise_rms=5e-3)


def experiment(
    truth,
    seed=0,
    sensor=FINE,
    machine=MACHINE,
    offset=0.0,
    extra=lambda t, x: 0.0,
    phi=0.0,
    resolved=False,
):
    """Two runs with `truth` in them, seen with seeded AR(1) noise (white unless phi is given)."""
    rng = np.random.default_rng(seed)
    ends = [plan(program).duration_s + 0.2 for program in PROGRAMS]
    stamps = [np.arange(int(end * sensor.rate_hz)) / sensor.rate_hz for end in ends]
    blank = [trial(i, t, np.zeros(len(t)), sensor) for i, t in enumerate(stamps)]
    bare = Experiment(Source("experiment.toml", ""), machine, tuple(blank), ())
    seen = ForwardModel(bare, motor.FINE, resolved)(truth)
    trials = [
        trial(i, t, x + extra(t, x) + offset + sensor.noise_rms * ar1(phi, rng, len(t)), sensor)
        for i, (t, x) in enumerate(zip(stamps, seen, strict=True))
    ]
    return dataclasses.replace(bare, trials=tuple(trials))


def ar1(phi, rng, count):
    """Noise of variance 1, each sample phi times the one before and something new."""
    return lfilter([math.sqrt(1 - phi * phi)], [1.0, -phi], rng.standard_normal(count))


def trial(index, stamps, values, sensor):
    reading = Reading(sensor, stamps, values)
    return Trial(f"run{index}.csv", PROGRAMS[index], None, 0.0, (reading,))


# Whether microsteps show is asked about the answer, whatever was searched for it.
ALL_BUT_A_FEW = all_but("viscous_drag", "sensor_offset", "backlash")


def verdict(truth, **how):
    return diagnose(experiment(truth, **how)).verdict


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("payload_mass", {"dm": 0.1}),
        ("payload_mass", {"dm": 3.0}),
        ("coulomb_friction", {"Fc": 2.0, "delta": 5e-6}),
        ("umbilical_spring", {"k_h": 30.0, "x_h": 0.0}),
        ("detent_force", {"Fd": 4.0, "phi": 1.0, "pitch": 1.016e-3}),
        ("detent_force", {"Fd": 11.0, "phi": -3.0, "pitch": 1.016e-3}),
        ("voltage_saturation", {"Vb": 45.0}),
        ("current_loop_lag", {"tau": 1e-4}),
        ("acceleration_scale", {"e": -0.3}),
        ("start_delay", {"d": 4e-3, "every_move": 1.0}),
        ("lost_steps", {"n": 2.0, "move": 2.0, "at": 0.4, "run": 1.0}),
        ("lost_steps", {"n": 1.0, "move": 1.0, "at": 0.42, "run": -1.0}),
        ("backlash", {"B": 1e-5}),
        ("periodic_error", {"A": 3e-6, "lambda": 2.4e-3, "phi": 0.5}),
        ("sensor_bandwidth", {"f_c": 400.0}),
        ("hum", {"A": 4e-6, "f": 60.0, "phi": 1.0}),
    ],
)
def test_a_recording_that_holds_only_it_is_named(name, values):
    found = verdict({name: values})
    (effect,) = found.effects
    assert (found.verdict, effect.name) == ("named", name)
    assert effect.held_out
    assert found.gap.after_rms < 1.05 * FINE.noise_rms < found.gap.before_rms
    for key, estimate in effect.parameters.items():
        low, high = estimate.ci95
        truth = values.get(key, values.get("phi"))
        if key in SEARCHED:
            assert (estimate.value, math.isnan(low)) == (pytest.approx(truth, abs=0.03), True)
            continue
        assert low - (high - low) - 5e-3 <= truth <= high + (high - low) + 5e-3


@pytest.mark.parametrize(
    ("form", "harmonics"),
    [
        ("50 and 100 Hz", {"A2": 2e-6, "phi2": 0.5}),
        ("50 and 150 Hz", {"A3": 1e-6, "phi3": -2.0}),
        ("50 and 100 and 150 Hz", {"A2": 2e-6, "phi2": 0.5, "A3": 1e-6, "phi3": -2.0}),
    ],
)
def test_a_hum_has_the_harmonics_that_show(form, harmonics):
    truth = {"A": 4e-6, "f": 50.0, "phi": 1.0, **harmonics}
    (effect,) = verdict({"hum": truth}).effects
    assert (effect.name, effect.form) == ("hum", form)
    for name in ("A", "phi_1", *(n if n[0] == "A" else f"{n}_2" for n in harmonics)):
        low, high = effect.parameters[name].ci95
        assert low - (high - low) <= truth[name.split("_")[0]] <= high + (high - low)


@pytest.mark.parametrize(
    ("c3", "c5", "mid", "sensor"),
    [
        (-0.01, 0.0, -0.06, COARSE),
        (0.004, 0.0, 0.2, COARSE),
        (-0.01, 0.004, -0.03, FINE),
        (-1e-3, -4e-3, 0.18, FINE),
    ],
)
def test_a_bend_is_named_wherever_its_middle_is(c3, c5, mid, sensor):
    values = {"c3": c3, "c5": c5, "mid": mid, "half": 0.254}
    (effect,) = verdict({"sensor_nonlinearity": values}, sensor=sensor).effects
    assert effect.name == "sensor_nonlinearity"
    assert ("c5" in effect.parameters) == (c5 != 0)
    for key, estimate in effect.parameters.items():
        low, high = estimate.ci95
        assert low - (high - low) <= values[key] <= high + (high - low)


def test_a_recording_without_any_is_none():
    verdicts = [verdict({}, seed=seed).verdict for seed in range(3)]
    assert verdicts == ["none"] * 3


def test_two_effects_are_named_together():
    found = verdict({"viscous_drag": {"b": 4.0}, "trigger_delay": {"t_d": 1e-3}})
    families = [{e.name, *e.indistinguishable_from} for e in found.effects]
    assert len(families) == 2
    assert any("viscous_drag" in family for family in families)
    assert any("trigger_delay" in family for family in families)


def test_what_a_coarse_sensor_cannot_tell_apart_is_a_family():
    found = verdict({"trigger_delay": {"t_d": 2e-3}}, sensor=COARSE)
    (effect,) = found.effects
    family = {effect.name, *effect.indistinguishable_from}
    assert found.verdict == "ambiguous"
    assert {"trigger_delay", "start_delay"} <= family
    assert set(effect.alternatives) == set(effect.indistinguishable_from)


def test_what_a_coarse_sensor_cannot_see_is_said_to_be_below_its_resolution():
    found = verdict({}, sensor=COARSE)
    faint = {each.name: each for each in found.below_resolution}
    assert found.verdict == "none"
    assert "phase_gain_imbalance" in faint
    assert "acceleration_scale" not in faint
    assert all(each.expected_sigmas < each.needed_sigmas for each in faint.values())


def test_a_bump_is_unexplained_and_placed():
    found = verdict({}, extra=lambda t, x: 1e-4 * np.exp(-(((x - 2.0) / 0.2) ** 2)))
    assert found.verdict == "unexplained"
    assert "bump" in found.remainder.description
    assert not found.effects


def test_an_offset_of_all_runs_is_a_calibration_and_no_effect():
    alone = verdict({}, offset=0.01)
    beside = verdict({"sensor_gain": {"g": 1e-3}}, offset=0.01)
    assert (alone.verdict, alone.effects) == ("none", ())
    (zero,) = alone.sensors
    assert (zero.name, zero.form) == ("sensor_offset", FINE.name)
    low, high = zero.parameters["o"].ci95
    assert low < 0.01 < high
    assert alone.as_json()["calibration"][0]["sensor"] == FINE.name
    assert sentence(alone) == "None: with the zero of laser calibrated, simulation and data agree."
    assert "sensor_offset" not in {effect.name for effect in beside.effects}
    assert beside.sensors == ()


@pytest.mark.parametrize("measured_C", [18.0, 28.0])
def test_a_loss_per_kelvin_is_a_family_with_a_weaker_motor(measured_C):
    """In a short run the forcer is as warm as the air, so only α (T - T0) shows.

    Of equal explanations the one that is listed first is told.
    """
    truth = {"force_constant_temperature": {"alpha": 1e-3, "T0": measured_C}}
    (effect,) = verdict(truth, sensor=SHARP).effects
    assert effect.name == "force_constant"
    assert effect.indistinguishable_from == ["force_constant_temperature"]


def test_a_loss_per_kelvin_is_known_as_well_as_the_temperature_that_it_counts_from():
    truth = {"force_constant_temperature": {"alpha": 1e-3, "T0": 18.0}}
    asked = experiment(truth, sensor=SHARP)
    (effect,) = diagnose(asked, left_out={"force_constant"}).verdict.effects
    assert effect.name == "force_constant_temperature"
    low, high = effect.parameters["alpha"].ci95
    assert low < 1e-3 < high
    assert effect.parameters["T0"].ci95[0] == 15.0


@pytest.mark.parametrize("seed", range(3))
def test_slow_noise_of_the_stated_size_is_no_offset(seed):
    """The mean of a run scatters √((1 + φ) / (1 - φ)) = 6.2 times as far as that of white noise."""
    found = verdict({}, phi=0.95, seed=seed)
    assert (found.verdict, found.effects) == ("none", ())


def test_the_interval_of_an_offset_is_as_wide_as_slow_noise_asks_for():
    found = verdict({}, phi=0.95, offset=3e-5)
    (effect,) = (*found.effects, *found.sensors)
    low, high = effect.parameters["o"].ci95
    of_white = 2 * 1.96 * FINE.noise_rms / math.sqrt(3009)
    assert effect.name == "sensor_offset"
    # 1.5 half-widths: three standard deviations.
    assert abs(effect.parameters["o"].value - 3e-5) < 0.75 * (high - low)
    assert (high - low) / of_white == pytest.approx(math.sqrt(1.95 / 0.05), rel=0.4)


def test_the_interval_of_an_offset_is_that_of_the_noise_that_is_there():
    """It is white, and larger than stated."""
    quiet = dataclasses.replace(FINE, noise_rms=0.3 * FINE.noise_rms)
    data = experiment({}, offset=1e-4)
    restated = dataclasses.replace(
        data,
        trials=tuple(
            dataclasses.replace(t, readings=(dataclasses.replace(t.readings[0], sensor=quiet),))
            for t in data.trials
        ),
    )
    widths = []
    for tried in (data, restated):
        (effect,) = diagnose(tried).verdict.effects
        assert effect.name == "sensor_offset"
        low, high = effect.parameters["o"].ci95
        assert low < 1e-4 < high
        widths.append(high - low)
    assert widths[1] == pytest.approx(widths[0], rel=0.05)


@pytest.mark.parametrize(("force_N", "as_well"), [(3.0, True), (9.0, False)])
def test_a_small_offset_of_all_runs_may_as_well_be_a_tilt(force_N, as_well):
    """That holds the forcer F/K off its place, wherever it is."""
    found = verdict({}, offset=force_N / MACHINE.axis.stiffness_N_m / 0.0254)
    (offset,) = found.effects if as_well else found.sensors
    assert offset.name == "sensor_offset"
    assert offset.indistinguishable_from == (["constant_force"] if as_well else [])
    assert found.verdict == ("ambiguous" if as_well else "none")


def test_another_order_of_runs_in_other_units_does_not_change_the_verdict():
    truth = {"viscous_drag": {"b": 2.0}}
    data = experiment(truth)
    in_mm = dataclasses.replace(FINE, column="position_1_mm", noise_rms=25.4 * FINE.noise_rms)
    turned_metric = dataclasses.replace(
        data,
        trials=tuple(
            dataclasses.replace(
                each,
                readings=(Reading(in_mm, each.readings[0].time_s, 25.4 * each.readings[0].values),),
            )
            for each in data.trials[::-1]
        ),
    )
    plain, other = (diagnose(each).verdict for each in (data, turned_metric))
    assert [e.name for e in other.effects] == [e.name for e in plain.effects]
    assert other.effects[0].parameters["b"].value == pytest.approx(
        plain.effects[0].parameters["b"].value, rel=1e-3
    )


def test_a_logged_command_serves_where_there_is_no_program():
    data = experiment({"viscous_drag": {"b": 3.0}})
    motor = ForwardModel(data)
    logged = []
    for index, each in enumerate(data.trials):
        stamps = np.arange(0, each.duration_s, 1e-3)
        track = motor.schedule(index).tracks[1]
        way = np.array([track.state(t).position for t in stamps.tolist()]) * MACHINE.microstep_m
        command = LoggedCommand(stamps, {1: way})
        logged.append(dataclasses.replace(each, program=None, command=command))
    found = diagnose(dataclasses.replace(data, trials=tuple(logged))).verdict
    assert "viscous_drag" in {effect.name for effect in found.effects}


def test_an_effect_that_the_machine_has_already_is_measured_against_it():
    machine = MACHINE.with_effects({"viscous_drag": {"b": 5.0}})
    data = experiment({"viscous_drag": {"b": 5.0}}, machine=MACHINE)
    assert diagnose(dataclasses.replace(data, machine=machine)).verdict.verdict == "none"
    more = experiment({"viscous_drag": {"b": 8.0}}, machine=MACHINE)
    (effect,) = diagnose(dataclasses.replace(more, machine=machine)).verdict.effects
    assert effect.name == "viscous_drag"
    assert effect.parameters["b"].value == pytest.approx(8.0, rel=0.02)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_microsteps_do_not_show_by_taking_a_little_off_what_nothing_accounts_for(sign):
    """One sign of a random walk or the other seems to have some of them in it."""

    def walk(stamps, _):
        steps = np.random.default_rng(len(stamps)).standard_normal(len(stamps))
        return sign * 1e-4 * np.cumsum(steps)

    found = diagnose(experiment({}, sensor=SHARP, extra=walk), left_out=ALL_BUT_A_FEW)
    assert (found.verdict.verdict, found.resolved) == ("unexplained", False)


@pytest.mark.parametrize(("walk_in", "resolved"), [(0.0, True), (7e-8, False)])
def test_microsteps_show_unless_they_are_little_of_what_nothing_accounts_for(walk_in, resolved):
    """With them the rest would be unexplained as well, in twice the time."""

    def walk(stamps, _):
        return walk_in * np.cumsum(np.random.default_rng(5).standard_normal(len(stamps)))

    sharper = dataclasses.replace(FINE, noise_rms=1e-6)
    asked = experiment({}, sensor=sharper, extra=walk, resolved=True)
    found = diagnose(asked, left_out=ALL_BUT_A_FEW)
    assert found.resolved is resolved
    assert found.verdict.verdict == ("none" if resolved else "unexplained")


def tolerant(**tolerances):
    """The nominal machine, some of its numbers known to a share of them only."""
    text = MACHINE.source.text
    for key, share in tolerances.items():
        head = f"{key} = {{"
        assert text.count(head) == 1
        text = text.replace(head, f"{head} tolerance = {share},")
    return read_machine(Source("mine.toml", text))


# What changes how stiff or damped the axis is, or how it lags.
UNLIKE_CALIBRATED = all_but(
    "force_constant", "force_constant_temperature", "electrical_damping", "viscous_drag",
    "payload_mass", "detent_force", "constant_force", "umbilical_spring",
)  # fmt: skip


@pytest.mark.parametrize(("tolerance", "calibrated"), [(0.1, True), (0.01, False)])
def test_a_number_within_its_tolerance_is_calibrated_and_no_finding(tolerance, calibrated):
    machine = tolerant(pull_out_force=tolerance)
    tried = experiment({"force_constant": {"e": -0.05}}, seed=11, machine=machine)
    found = diagnose(tried, jobs=2, left_out=UNLIKE_CALIBRATED).verdict
    assert [e.name for e in found.fitted] == ["force_constant"]
    low, high = found.fitted[0].parameters["e"].ci95
    assert low < -0.05 < high
    assert (found.verdict == "none") is calibrated
    assert bool(found.calibration) is calibrated
    assert bool(found.effects) is not calibrated
    again = machine_of(tried.machine, machine_text(tried, found))
    (stated,) = again.effects
    assert stated.values["e"].number == pytest.approx(-0.05, abs=5e-3)
    assert again.provenance["axis.pull_out_force"].tolerance == tolerance


def test_an_effect_is_named_beside_what_is_calibrated():
    truth = {"electrical_damping": {"zeta": 0.027}, "viscous_drag": {"b": 8.0}}
    tried = experiment(truth, seed=12, machine=tolerant(pull_out_force=0.1, damping_ratio=0.3))
    found = diagnose(tried, left_out=UNLIKE_CALIBRATED).verdict
    assert found.verdict == "named"
    assert [e.name for e in found.effects] == ["viscous_drag"]
    assert "electrical_damping" in [e.name for e in found.calibration]
    assert not found.remainder.significant
