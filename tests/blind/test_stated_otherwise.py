"""Cases with short recordings, a wrong noise stated, or a machine off within its tolerance."""

import json
from dataclasses import replace

import numpy as np
import pytest

from helpers.one_run import LASER, of
from mopro.blind.cases.benchmark_machine import read_machine
from mopro.blind.cases.case import draw_case
from mopro.blind.cases.grids import TOLERANCES, case_specs
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS, THERMAL
from mopro.blind.cases.make import make, write
from mopro.blind.cases.spec import COARSE, ENCODER, LVDT, THERMOCOUPLE, CaseSpec
from mopro.blind.reference.motor import THESIS
from mopro.blind.scoring.judge import judge
from mopro.blind.scoring.score import Score
from mopro.effects import catalogue
from mopro.engine.candidate import Role
from mopro.errors import DataError
from mopro.experiment import load_experiment
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.instruments.quantity import TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine


def number_of(grid, fits):
    return next(f"{i:03d}" for i, s in enumerate(case_specs(grid, 1), 1) if fits(s))


def made(grid, fits, folder, **how):
    """The folder and the answer of the first case that fits."""
    number, _ = make(1, grid, folder, frozenset([number_of(grid, fits)]), **how)
    return folder / number, json.loads((folder / "answers.json").read_text())["cases"][number]


@pytest.fixture(scope="module")
def view():
    """A run that a laser, one on the other axis and a thermocouple read."""
    experiment = of(np.zeros(200))
    (trial,) = experiment.trials
    (reading,) = trial.readings
    other = replace(LASER, name="other", column="position_2_in", axis=2)
    warm = Sensor("tc", TEMPERATURE, "temperature_C", 2.0, noise_rms=0.1)
    readings = tuple(replace(reading, sensor=s) for s in (LASER, other, warm))
    return ForwardModel(replace(experiment, trials=(replace(trial, readings=readings),)))


class TestConstants:
    def test_the_grid(self):
        specs = case_specs("constants", 1)
        assert len(specs) == 200
        assert all(s.constants and s.runs == 1 for s in specs)
        assert {s.sensor for s in specs} == {LVDT, THERMOCOUPLE}
        assert {name for s in specs for name, _ in s.effects} == {*COARSE, *THERMAL}

    @pytest.mark.parametrize("name", HIDDEN_EFFECTS)
    def test_what_is_plausible_is_what_the_catalogue_says(self, name):
        """Of numbers that are no size, angle or measure; mains are of 50 or 60 Hz alone."""
        known = {
            p.name: p.plausible
            for p in catalogue()[name].parameters
            if p.response is Role.SHAPE
            and p.plausible[0] < p.plausible[1]
            and not (p.whole or p.unit_of or p.dimension == "frequency")
        }
        assert known == HIDDEN_EFFECTS[name].assumed
        assert [*known] == [*HIDDEN_EFFECTS[name].assumed]

    @pytest.mark.parametrize("name", HIDDEN_EFFECTS)
    def test_what_the_diagnosis_frees_is_drawn_over_its_range(self, name, view):
        freed = {
            p.name: p.plausible or (p.low, p.high)
            for form in catalogue()[name].candidates(view)
            for p in form.parameters
            if p.role is Role.CONSTANT
        }
        g, effect = np.random.default_rng(1), HIDDEN_EFFECTS[name]
        assert {*freed} <= {*effect.assumed}
        draws = [effect.with_constants(g, effect.draw(g, THESIS)) for _ in range(200)]
        for constant, (low, high) in freed.items():
            values = [drawn(0.5)[constant] for drawn in draws]
            assert low <= min(values) < low + 0.1 * (high - low)
            assert high - 0.1 * (high - low) < max(values) <= high

    def test_a_case_s_constant_is_the_one_that_its_machine_has(self):
        spec = CaseSpec("short", THERMOCOUPLE, (("platen_conduction", "clear"),), runs=1,
                        style="cycles", run_s=300.0, constants=True)  # fmt: skip
        case = draw_case(1, "001", spec)
        own = case.effects["platen_conduction"]
        assert own["T_p"] != case.nominal.air_C
        at_air = {**own, "T_p": case.nominal.air_C}
        shown = case.noiseless()
        assert shown.total_sigma({"platen_conduction": at_air}) != pytest.approx(case.total_sigma)


class TestShort:
    def test_the_grid(self):
        specs = case_specs("short", 1)
        assert len(specs) == 200
        assert {s.runs for s in specs} == {1}
        assert {s.sensor for s in specs} == {LVDT, ENCODER, THERMOCOUPLE}
        assert 40 <= sum(s.cut for s in specs) <= 80
        assert 25 <= sum(s.style == "one speed" for s in specs) <= 65

    def test_a_recording_is_cut_off_and_says_so(self, tmp_path):
        folder, _ = made("short", lambda s: s.cut and s.style == "strokes", tmp_path)
        assert "partial = true" in (folder / "experiment.toml").read_text()
        (trial,) = load_experiment(folder / "experiment.toml").trials
        assert trial.partial

    def test_a_whole_one_does_not(self, tmp_path):
        folder, _ = made("short", lambda s: not s.cut and s.sensor == LVDT, tmp_path)
        assert "partial" not in (folder / "experiment.toml").read_text()

    def test_the_table(self):
        hum = {"name": "hum", "parameters": {"A": 1.0}, "total_sigma": 9.0}
        answer = {"group": "short", "sensor": "lvdt", "strange": None, "offsets": [0.0]}
        answer["effects"] = [hum]
        others = [["backlash"], ["hum"]]
        replies = [
            {"verdict": "named", "effects": [{"name": "hum"}]},
            {"verdict": "ambiguous", "effects": [{"name": "backlash"}], "alternatives": others},
            {"verdict": "ambiguous", "effects": [{"name": "backlash"}], "alternatives": [["x"]]},
            {"verdict": "unexplained", "effects": []},
        ]
        cases = [judge(f"{i:03d}", answer, reply) for i, reply in enumerate(replies)]
        rows = Score(tuple(cases), (), "short").rows()
        assert [r.reached for r in rows[:3]] == [
            "25.0% (1 of 4)", "50.0% (2 of 4)", "25.0% (1 of 4)",
        ]  # fmt: skip
        assert [r.target for r in rows[:3]] == ["≤ 1.5%", "≥ 95%", "≤ 3%"]


class TestNoise:
    @pytest.mark.parametrize("factor", [0.3, 3.0])
    def test_the_stated_noise_is_wrong_by_the_factor(self, factor, tmp_path):
        def fits(spec):
            return spec.noise_factor == factor and spec.sensor == ENCODER and not spec.effects

        folder, answer = made("noise", fits, tmp_path)
        assert answer["noise_factor"] == factor
        assert f"noise_rms = {2e-4 * factor:.6g}\n" in (folder / "experiment.toml").read_text()
        data = np.genfromtxt(folder / "run1.csv", delimiter=",", names=True)
        rest = data["position_1_in"][-100:]
        assert rest.std() == pytest.approx(2e-4, rel=0.4)

    def test_a_gap_is_told_in_the_true_noise(self):
        """That of the laser is 2e-5 in, of which the experiment states 0.3."""
        laser = {"name": "laser", "quantity": "position", "axis": 1, "column": "position_1_in",
                 "unit": 0.0254, "rate_hz": 2000.0, "noise_rms": 2e-5, "adc_step": 0.0}  # fmt: skip
        answer = {"group": "none", "sensor": "laser", "effects": [], "strange": None}
        answer |= {"offsets": [0.0], "instruments": [laser], "noise_factor": 0.3}
        gap = {"before_rms": 4e-5, "after_rms": 2e-5, "noise_rms": 0.6e-5}
        judged = judge("001", answer, {"verdict": "none", "effects": [], "gap": gap})
        assert (judged.gap_before, judged.gap_after) == pytest.approx((2.0, 1.0))


class TestBase:
    def test_numbers_are_off_by_a_tenth_and_the_file_states_its_tolerance(self, tmp_path):
        machine = read_machine("chow1992", TOLERANCES["base"])
        folder, answer = made("base", lambda s: not s.effects, tmp_path, machine=machine)
        for name in machine.tolerated:
            off = answer["machine"][name] / getattr(THESIS, name) - 1
            assert abs(off) == pytest.approx(0.1)
        stated = load_machine(str(folder / "machine.toml"))
        assert stated.provenance["axis.pull_out_force"].tolerance == pytest.approx(0.15)
        assert stated.axis == load_machine("chow1992").axis

    def test_signs_are_drawn(self):
        spec = CaseSpec("none", ENCODER, runs=1, run_s=1.0, base=True)
        cases = [draw_case(1, f"{i:03d}", spec, tolerated=("force_N",)) for i in range(1, 9)]
        forces = {round(c.nominal.force_N, 6) for c in cases}
        assert forces == {round(111.0 * 0.9, 6), round(111.0 * 1.1, 6)}
        plain = draw_case(1, "001", replace(spec, base=False), tolerated=("force_N",))
        assert plain.nominal == THESIS

    def test_a_tolerance_that_is_there_is_replaced(self, tmp_path):
        once = read_machine("chow1992", 0.3)
        (tmp_path / "own.toml").write_bytes(once.text)
        again = read_machine(str(tmp_path / "own.toml"), 0.15)
        assert again.text == read_machine("chow1992", 0.15).text

    def test_a_number_in_another_form_is_refused(self, tmp_path):
        text = read_machine("chow1992", 0.3).text.decode()
        file = tmp_path / "own.toml"
        file.write_text(text.replace("pull_out_force", '"pull_out_force"', 1))
        with pytest.raises(DataError, match="pull_out_force"):
            read_machine(str(file), 0.15)


def test_other_cases_say_nothing_more(tmp_path):
    spec = CaseSpec("none", ENCODER, runs=1, run_s=1.0)
    case = draw_case(1, "001", spec)
    write(case, tmp_path, np.random.default_rng(1))
    extra = {"without", "foreign", "noise_factor", "partial"}
    assert not extra & set(case.answer())
    assert "partial" not in (tmp_path / "experiment.toml").read_text()
