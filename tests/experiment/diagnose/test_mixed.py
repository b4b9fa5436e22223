"""Experiments of several quantities, machines that have effects already, coarse converters."""

import dataclasses

import numpy as np
import pytest

import mopro
from helpers.diagnosis import diagnose
from helpers.thermal_table import MACHINE, table
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import FINE, ForwardModel
from mopro.experiment.sawyer.steady import rises
from mopro.experiment.sawyer.system import thinned_experiment
from mopro.experiment.sawyer.trials import Experiment, Reading, Trial
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine.file import read_machine
from mopro.motion import plan
from mopro.source import Source

PROGRAM = mopro.compile(
    "UU012500/1\nVEL2 20\nACC2 0.2\nPARA2-\n" + "MRI2 2.0\nWX2\nWT800\nMRI2 -2.0\nWX2\nWT800\n"
)
LASER = Sensor("laser", POSITION, "position_2_in", 1000.0, 2, 2e-5)
THERMOCOUPLE = Sensor("thermocouple", TEMPERATURE, "temperature_C", 50.0, 1, 0.05)


def measured(truth, sensors, machine=MACHINE, tables=(), seed=0):
    """One run with `truth` in it, seen by `sensors` with seeded noise and their converters."""
    rng = np.random.default_rng(seed)
    end_s = plan(PROGRAM).duration_s
    stamps = [np.arange(int(end_s * sensor.rate_hz)) / sensor.rate_hz for sensor in sensors]
    blank = [Reading(s, t, np.zeros(len(t))) for s, t in zip(sensors, stamps, strict=True)]
    trial = Trial("run.csv", PROGRAM, None, 0.0, tuple(blank))
    bare = Experiment(Source("experiment.toml", ""), machine, (trial,), tables)
    readings = tuple(
        dataclasses.replace(r, values=stored(clean, r.sensor, rng))
        for r, clean in zip(blank, ForwardModel(bare, FINE)(truth), strict=True)
    )
    return dataclasses.replace(bare, trials=(dataclasses.replace(trial, readings=readings),))


def stored(clean, sensor, rng):
    noisy = clean + sensor.noise_rms * rng.standard_normal(len(clean))
    return np.round(noisy / sensor.adc_step) * sensor.adc_step if sensor.adc_step else noisy


def steady(seed=0):
    """The source's motions at the theory's own temperatures."""
    own = rises(table(), MACHINE, {})
    return table(own + np.random.default_rng(seed).standard_normal(len(own)))


class TestPositionTemperatureAndTable:
    @pytest.mark.parametrize(
        "truth", [{}, {"viscous_drag": {"b": 8.0}}, {"hum": {"A": 4e-6, "f": 50.0, "phi": 1.0}}]
    )
    def test_are_judged_together(self, truth):
        verdict = diagnose(measured(truth, (LASER, THERMOCOUPLE), tables=(steady(),))).verdict
        families = [{e.name, *e.indistinguishable_from} for e in verdict.effects]
        assert len(families) == len(truth)
        assert all(any(name in family for family in families) for name in truth)
        assert not verdict.remainder.significant

    def test_a_jump_of_temperature_is_no_lost_step(self):
        """The thermocouple's axis does not even move."""
        data = measured({}, (LASER, THERMOCOUPLE))
        (trial,) = data.trials
        laser, warm = trial.readings
        jumped = warm.values + 0.508 * (warm.time_s > 1.0)
        warm = dataclasses.replace(warm, values=jumped)
        data = dataclasses.replace(
            data, trials=(dataclasses.replace(trial, readings=(laser, warm)),)
        )
        verdict = diagnose(data).verdict
        assert verdict.verdict == "unexplained"
        assert "lost_steps" not in {e.name for e in verdict.effects}
        assert "0.5" in verdict.remainder.description
        assert " C " in verdict.remainder.description


def machine_with(*sections):
    return read_machine(Source("mine.toml", MACHINE.source.text + "\n" + "\n".join(sections)))


def stated(value, unit):
    return f'{{ value = {value}, unit = "{unit}", origin = "measured" }}'


class TestAMachineThatHasEffects:
    def offered(self, machine, name, form=""):
        motor = ForwardModel(measured({}, (LASER, THERMOCOUPLE), machine))
        (found,) = (c for c in candidates(motor) if (c.name, c.form) == (name, form))
        return found

    def test_is_changed_from_what_it_has_in_si(self):
        lag = f"[effects.current_loop_lag]\ntau = {stated(120, 'us')}"
        (tau,) = self.offered(machine_with(lag), "current_loop_lag").parameters
        assert tau.null == pytest.approx(1.2e-4)

    @pytest.mark.parametrize(
        ("section", "name"),
        [
            ("[effects.viscous_drag]\nb = 3.0", "viscous_drag"),
            ("[effects.resistance_tempco]\nalpha = 0.00393", "resistance_tempco"),
            ("[effects.radiation]\neps = 0.3", "radiation"),
            ("[effects.viscous_drag]\nb = 100.0", "viscous_drag"),
        ],
    )
    def test_is_tried_at_other_values(self, section, name):
        (parameter,) = self.offered(machine_with(section), name).parameters
        assert parameter.null not in parameter.starts
        assert all(
            parameter.low <= s <= parameter.high for s in (*parameter.starts, parameter.null)
        )

    def test_keeps_what_is_not_fitted(self):
        conduction = (
            f"[effects.platen_conduction]\nG = {stated(2, 'W/K')}\ng = {stated(4.5, 'W/(m K)')}"
        )
        one = self.offered(machine_with(conduction), "platen_conduction", "G")
        assert one.fixed["g"] == 4.5
        assert [p.null for p in one.parameters] == [2.0]

    @pytest.mark.parametrize("ratio", [0.0, 0.2])
    def test_may_be_damped_by_any_ratio(self, ratio):
        text = MACHINE.source.text.replace("value = 0.03,", f"value = {ratio},")
        (zeta,) = self.offered(
            read_machine(Source("m.toml", text)), "electrical_damping"
        ).parameters
        assert zeta.null == ratio
        assert zeta.low <= ratio < zeta.high
        assert ratio not in zeta.starts

    def test_with_a_value_at_its_start_is_diagnosed(self):
        machine = machine_with("[effects.viscous_drag]\nb = 3.0")
        verdict = diagnose(measured({"viscous_drag": {"b": 9.0}}, (LASER,), machine)).verdict
        (effect,) = verdict.effects
        low, high = effect.parameters["b"].ci95
        assert (effect.name, low < 9.0 < high) == ("viscous_drag", True)

    def test_has_its_tolerance_about_its_own_number_wherever_an_effect_moved_that(self):
        text = MACHINE.source.text.replace("value = 111.0,", "value = 111.0, tolerance = 0.5,")
        text += "\n[effects.force_constant]\ne = -0.09\n"
        (e,) = self.offered(read_machine(Source("m.toml", text)), "force_constant").parameters
        assert (e.null, e.tolerated) == (-0.09, (-0.5, 0.5))
        assert e.low < -0.5 < 0.5 < e.high
        assert e.beyond(0.49) == 0


class TestAConverterCoarserThanTheNoise:
    @pytest.mark.parametrize("noise", [0.0, 2e-5, 4e-5])
    def test_hides_no_disagreement_in_its_rounding(self, noise):
        encoder = dataclasses.replace(LASER, noise_rms=noise, adc_step=1e-4)
        verdict = diagnose(measured({}, (encoder,), seed=1)).verdict
        assert (verdict.verdict, verdict.effects) == ("none", ())

    def test_still_shows_an_effect(self):
        encoder = dataclasses.replace(LASER, noise_rms=0.0, adc_step=1e-4)
        verdict = diagnose(measured({"viscous_drag": {"b": 12.0}}, (encoder,))).verdict
        (effect,) = verdict.effects
        assert "viscous_drag" in (effect.name, *effect.indistinguishable_from)
        assert not verdict.remainder.significant

    def test_tells_one_thing_once(self):
        encoder = dataclasses.replace(LASER, noise_rms=0.0, adc_step=1e-4)
        data = measured({}, (encoder,))
        (whole,), (kept,) = data.trials[0].readings, thinned_experiment(data).trials[0].readings
        assert len(kept.values) < 0.7 * len(whole.values)
        assert kept.time_s[-1] == whole.time_s[-1]
        assert np.isin(kept.time_s, whole.time_s).all()
        assert kept.sensor.sigma == pytest.approx(1e-4 / np.sqrt(6))

    @pytest.mark.parametrize("stated", [5e-6, 3e-5])
    def test_is_read_whole_where_the_noise_is_more_than_stated(self, stated):
        """Of noise of one step, the stretches between changes would be chosen by the noise."""
        data = measured({}, (dataclasses.replace(LASER, noise_rms=1e-4, adc_step=1e-4),))
        (trial,) = data.trials
        readings = tuple(
            dataclasses.replace(r, sensor=dataclasses.replace(r.sensor, noise_rms=stated))
            for r in trial.readings
        )
        data = dataclasses.replace(data, trials=(dataclasses.replace(trial, readings=readings),))
        assert thinned_experiment(data) == data

    def test_with_noise_enough_is_read_whole(self):
        encoder = dataclasses.replace(LASER, noise_rms=5e-5, adc_step=1e-4)
        data = measured({}, (encoder,))
        assert thinned_experiment(data) == data
