"""Changes that leave the physics as it is, on a tiny experiment: bench/invariance.py in small."""

import math

import numpy as np
import pytest

from helpers.invariance.changes import CHANGES, Skipped
from helpers.invariance.compared import (
    NAMES,
    NUMBERS,
    REFUSED,
    WORD,
    Answer,
    Number,
    answered,
    differences,
)
from helpers.invariance.copied import Copied
from helpers.stated import drive_folder, write

NOISE_MM = 0.02
SLIDE = f"""\
machine = "kinematic"

[inputs]
command = {{ column = "target_mm" }}

[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = {NOISE_MM}

[[run]]
data = "one.csv"

[[run]]
data = "two.csv"
"""


def slide(folder, delay_s=0.06):
    """Two runs of a slide that comes late, with a rest in the middle; the experiment's file."""
    rng = np.random.default_rng(5)
    t = np.arange(0, 6, 0.03)

    def command(at):
        first = 2 * math.pi / 2.9 * np.clip(at, 0, 2.9)
        second = 2 * math.pi / 2.8 * np.clip(at - 3.2, 0, None)
        return 1.5 * (1 - np.cos(first)) + 1.2 * (1 - np.cos(second))

    for name, sense in (("one", 1.0), ("two", -0.7)):
        reading = sense * command(t - delay_s) + NOISE_MM * rng.standard_normal(len(t))
        write(
            folder / f"{name}.csv",
            {"time_s": t, "target_mm": sense * command(t), "position_mm": reading},
        )
    (folder / "experiment.toml").write_text(SLIDE, "utf-8")
    return folder / "experiment.toml"


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    return slide(tmp_path_factory.mktemp("slide"))


@pytest.fixture(scope="module")
def answer(experiment):
    return answered(experiment)


def changed(path, change, seed=1):
    return CHANGES[change](Copied.of(path), np.random.default_rng(seed))


def test_the_answer_on_the_tiny_experiment_is_what_was_done(answer):
    assert (answer.word, answer.names) == ("named", {"delay"})
    assert answer.numbers["delay", "d"].value == pytest.approx(0.06, abs=1e-3)


@pytest.mark.parametrize("change", CHANGES)
def test_it_does_not_change_under_what_leaves_the_physics(experiment, answer, tmp_path, change):
    other = answered(changed(experiment, change).write(tmp_path / "changed"))
    assert differences(answer, other, change) == {}


def test_a_clock_that_begins_elsewhere_turns_no_drift_into_another(experiment, tmp_path):
    drifting = Copied.of(experiment).altered()
    drifting.stated["sensor"][0]["zero"] = 0
    drifting = drifting.with_tables(
        lambda table: table.with_column("position_mm", lambda o: o + 0.02 * table.columns["time_s"])
    )
    path = drifting.write(tmp_path / "drifting")
    other = answered(changed(path, "time").write(tmp_path / "later"))
    assert differences(answered(path), other, "time") == {}
    assert other.names == {"delay", "drift"}


def test_a_copy_that_is_not_changed_says_the_same(experiment, tmp_path):
    before = Copied.of(experiment)
    after = Copied.of(before.write(tmp_path / "copy"))
    assert after.stated == before.stated
    for name, table in before.tables.items():
        for column, values in table.columns.items():
            np.testing.assert_array_equal(after.tables[name].columns[column], values)


def test_what_each_change_does_to_the_data(experiment):
    before = Copied.of(experiment)
    one = before.tables["one.csv"].columns
    tables = {name: changed(experiment, name).tables["one.csv"].columns for name in CHANGES}

    moved = np.abs(tables["rounded"]["position_mm"] - one["position_mm"])
    assert 0 < moved.max() < NOISE_MM / 4
    assert len(tables["halved"]["time_s"]) == len(one["time_s"]) / 2
    assert tables["unit"]["position_mm"] * 25.4 == pytest.approx(one["position_mm"])
    assert tables["unit"]["time_s"] / 1e3 == pytest.approx(one["time_s"])
    assert np.ptp(tables["time"]["time_s"] - one["time_s"]) == pytest.approx(0, abs=1e-9)
    follows = one["position_mm"] - one["target_mm"]
    assert tables["place"]["position_mm"][0] > one["position_mm"][0] + 1
    assert tables["place"]["position_mm"] - tables["place"]["target_mm"] == pytest.approx(follows)
    assert tables["sign"]["position_mm"] == pytest.approx(-one["position_mm"])
    assert tables["sign"]["target_mm"] == pytest.approx(-one["target_mm"])


def test_what_each_change_does_to_the_file(experiment):
    def runs(change):
        return changed(experiment, change).runs

    unit = changed(experiment, "unit").stated
    assert unit["sensor"][0]["unit"] == unit["inputs"]["command"]["unit"] == "in"
    assert unit["sensor"][0]["noise_rms"] == pytest.approx(NOISE_MM / 25.4)
    assert [run["data"] for run in runs("order")] == ["two.csv", "one.csv"]
    assert [run["data"] for run in runs("twice")] == ["one.csv", "two.csv", "again_one.csv"]
    first, second, _ = runs("cut")
    assert first["data"] == second["data"] == "one.csv"
    assert first["part"][1] == second["part"][0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("order", "one run"),
        ("time", "of the time"),
        ("sign", "effects of its own"),
        ("place", "zero is stated"),
        ("halved", "changes between"),
    ],
)
def test_a_change_that_does_not_hold_is_skipped(tmp_path, change, why):
    path = drive_folder(tmp_path, dry=0.5) or tmp_path / "experiment.toml"
    own = '\n[[effect]]\nname = "own"\nenters = "force"\nformula = "k * t"\nk = { unit = "N/s" }\n'
    text = (tmp_path / "experiment.toml").read_text("utf-8")
    path.write_text(text.replace("noise_rms", "zero = 0\nnoise_rms") + own, "utf-8")
    with pytest.raises(Skipped, match=why):
        changed(path, change)


def told(word="named", names=("lag",), as_well=(), low=1.0, high=2.0, number=("lag", "tau")):
    value = Number((low + high) / 2, low, high)
    return Answer(word, frozenset(names), frozenset(map(frozenset, as_well)), {number: value}, {})


@pytest.mark.parametrize(
    ("other", "kinds"),
    [
        (told(), set()),
        (told(names=["delay"]), {NAMES}),
        (told(names=["delay"], as_well=[["lag"]], word="ambiguous"), {WORD}),
        (told(low=1.4, high=1.9), set()),
        (told(low=2.4, high=2.9), {NUMBERS}),
        (told(low=2.4, high=math.inf), set()),
        (Answer("refused: no"), {REFUSED}),
    ],
)
def test_what_differs_between_two_answers(other, kinds):
    assert differences(told(), other, "unit").keys() == kinds


def test_numbers_turn_with_the_axis_and_share_with_the_phase():
    assert differences(told(), told(low=-2.0, high=-1.0), "sign") == {}
    assert differences(told(), told(low=-2.0, high=-1.0), "unit").keys() == {NUMBERS}
    wave, moved = (
        Answer("named", frozenset(["wave"]), frozenset(), {
            ("wave", "s"): Number(s, s - 0.1, s + 0.1), ("wave", "c"): Number(c, c - 0.1, c + 0.1),
        }, {}) for s, c in ((3.0, 4.0), (5.0, 0.0))
    )  # fmt: skip
    assert differences(wave, moved, "place") == {}
    assert differences(wave, moved, "order").keys() == {NUMBERS}
