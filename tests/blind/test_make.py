"""Cases as an outsider finds them: the same from the same seed, and no answer among them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from mopro.blind.cases import hidden_effects as hidden
from mopro.blind.cases.case import draw_case
from mopro.blind.cases.grids import case_specs
from mopro.blind.cases.hidden_sizes import NoiselessRuns, class_of
from mopro.blind.cases.make import make, write
from mopro.blind.cases.spec import LASER, CaseSpec, case_instruments
from mopro.blind.reference.listing import timeline
from mopro.blind.reference.motor import THESIS
from mopro.instruments import read_thermocouple

ONE = CaseSpec("single", LASER, (("viscous_drag", "clear"),), runs=1, run_s=1.0)


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """Four cases of the smoke grid."""
    folder = tmp_path_factory.mktemp("ground")
    *numbers, seal = make(3, "smoke", folder, frozenset(chosen()))
    return folder, numbers, seal


def chosen():
    """One of each kind that is quickly made."""
    wanted = {"none": 1, "pair": 1, "off catalogue": 1, "single": 1}
    found = []
    for i, spec in enumerate(case_specs("smoke", 3), start=1):
        if wanted.get(spec.group) and spec.style == "strokes":
            wanted[spec.group] -= 1
            found.append(f"{i:03d}")
    return found


def test_the_same_seed_gives_the_same_files(ground, tmp_path):
    folder, numbers, seal = ground
    *again, same = make(3, "smoke", tmp_path, frozenset(numbers))
    assert again == numbers
    assert same == seal
    for path in folder.rglob("*.*"):
        assert (tmp_path / path.relative_to(folder)).read_bytes() == path.read_bytes()


def test_another_seed_gives_other_data(tmp_path):
    *_, one = make(1, "smoke", tmp_path / "one", frozenset(["008"]))
    *_, other = make(2, "smoke", tmp_path / "other", frozenset(["008"]))
    assert one != other


def test_nothing_in_a_case_tells_what_is_hidden(ground):
    folder, numbers, _ = ground
    answers = json.loads((folder / "answers.json").read_text())["cases"]
    for number in numbers:
        names = {p.name for p in (folder / number).iterdir()}
        assert names == set(answers[number]["files"])
        texts = [p.read_text() for p in (folder / number).iterdir() if p.suffix != ".csv"]
        told = "\n".join(texts)
        for name in (
            *hidden.HIDDEN_EFFECTS,
            "single",
            "pair",
            "off catalogue",
            "seed",
            "bump",
            "walk",
        ):
            assert name not in told
        values = [v for e in answers[number]["effects"] for v in e["parameters"].values()]
        for value in values:
            if value not in (0.0, 1.0, 2.0, 50.0, 60.0):
                assert not re.search(rf"(?<![\d.]){re.escape(f'{value:.6g}')}(?!\d)", told)


def test_the_read_machine_cases_tell_nothing_of_their_kind():
    first, second = case_specs("full", 1), case_specs("full", 2)
    assert sorted(map(str, {s.group for s in first})) == sorted({s.group for s in second})
    assert [s.group for s in first] != [s.group for s in second]


def test_the_full_grid_has_what_the_issue_asks_for():
    grid = case_specs("full", 1)
    groups = [s.group for s in grid]
    assert len(grid) >= 200
    assert groups.count("none") >= 60
    assert groups.count("pair") >= 30
    assert groups.count("triple") >= 12
    assert groups.count("off catalogue") >= 16
    assert {name for s in grid for name, _ in s.effects} == set(hidden.STANDARD)
    for spec in grid:
        families = [hidden.HIDDEN_EFFECTS[name].family for name, _ in spec.effects]
        assert len(set(families)) == len(families)


def test_the_grid_s_effects_are_the_catalogue_s():
    from mopro.effects import catalogue

    parameters = {name: {p.name for p in e.parameters} for name, e in catalogue().items()}
    assert set(hidden.HIDDEN_EFFECTS) <= set(parameters)
    for entry in hidden.HIDDEN_EFFECTS.values():
        values = entry.draw(np.random.default_rng(1), THESIS)(0.5)
        assert set(values) <= parameters[entry.name], entry.name


@pytest.mark.parametrize("name", [n for n in hidden.HIDDEN_EFFECTS if n != "lost_steps"])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_all_strengths_lie_in_the_plausible_range(name, seed):
    from mopro.effects import catalogue

    entry = hidden.HIDDEN_EFFECTS[name]
    drawn_effect = entry.draw(np.random.default_rng(seed), THESIS)
    for strength in (entry.least, 0.5, 1.0):
        for parameter in catalogue()[name].parameters:
            value = drawn_effect(strength).get(parameter.name, parameter.default)
            low, high = parameter.plausible
            slack = 0.01 * max(abs(low), abs(high))
            assert low - slack <= value <= high + slack, parameter.name


def test_a_size_is_the_root_of_the_summed_squares():
    case = draw_case(1, "001", ONE)
    size = case.sizes["viscous_drag"]
    b = case.effects["viscous_drag"]["b"]
    noiseless = NoiselessRuns(case.runs, case.instruments)
    assert noiseless.total_sigma({"viscous_drag": {"b": b}}) == pytest.approx(size)
    assert noiseless.total_sigma({"viscous_drag": {"b": 2 * b}}) == pytest.approx(
        2 * size, rel=0.03
    )
    assert class_of(size) in ("clear", "strong")
    quieter = [replace(i, noise_rms=i.noise_rms / 2) for i in case.instruments]
    half = NoiselessRuns(case.runs, quieter).total_sigma(case.effects)
    assert half == pytest.approx(2 * size)


def test_an_offset_adds_nothing_to_a_size_but_its_own():
    case = draw_case(1, "001", ONE)
    noiseless = NoiselessRuns(case.runs, case.instruments)
    offset = {"sensor_offset": {"o": 1e-4}}
    both = noiseless.total_sigma(case.effects | offset)
    assert both == pytest.approx(noiseless.total_sigma(case.effects), rel=1e-6)
    assert noiseless.total_sigma(offset) > 100


def test_data_last_as_long_as_the_program(tmp_path):
    case = draw_case(2, "001", replace(ONE, group="none", effects=()))
    write(case, tmp_path, np.random.default_rng(1))
    data = np.genfromtxt(tmp_path / "run1.csv", delimiter=",", names=True)
    lasts = timeline((tmp_path / "run1.CMD").read_text()).duration_s
    assert data["time_s"][0] == 0.0
    assert data["time_s"][-1] == pytest.approx(lasts, abs=5e-4)
    assert data["position_1_in"].std() > 0.1


def test_a_thermocouple_s_data_are_a_raw_file_of_the_laboratory(tmp_path):
    warm = CaseSpec("none", "thermocouple", style="cycles", runs=1, run_s=700.0)
    case = draw_case(1, "001", warm)
    write(case, tmp_path, np.random.default_rng(1))
    temperature, time_s = read_thermocouple(tmp_path / "run1.DAT")
    assert time_s.tolist() == [*range(601), *range(615, 701, 15)]
    assert 24 < temperature[0] < 26
    assert temperature[-1] > temperature[0] + 10
    assert 'kind = "thermocouple"' in (tmp_path / "experiment.toml").read_text()


def test_noise_and_converter_are_the_stated_ones():
    laser, coarse = case_instruments(LASER, "strokes")[0], case_instruments("lvdt", "strokes")[0]
    assert laser.sigma == laser.noise_rms
    assert coarse.sigma == pytest.approx(np.hypot(0.025, 0.004883 / np.sqrt(12)))
