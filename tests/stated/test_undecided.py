"""What one motion cannot tell is told as such, with the motion that would; made, it does."""

import math

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, driven, follows, write
from mopro.experiment.opened import open_experiment
from mopro.experiment.stated.other_motions import Motion, moved, other_motions

HEAD = follows(0.005)
TIMES = np.arange(0, 60, 0.05)
MOTIONS = {
    "sine": 5 - 5 * np.cos(2 * math.pi * 0.1 * TIMES),
    "there and back": 10 - np.abs(10 - 2 * TIMES % 20),
    "one way": np.clip(0.7 * (TIMES - 2), 0, 39),
    "varied": np.interp(
        TIMES, [0, 6, 9, 17, 22, 24, 37, 41, 52, 60], [0, 20, -3, 4, 4, -25, 19, 2, 30, -9]
    ),
}


def delayed(t, x):
    return np.interp(t - 0.03, t, x)


def lagging(t, x, tau=0.03):
    """A lag of the first order of straight lines between the rows, line by line."""
    behind, found = x[0], [x[0]]
    for step, begin, end in zip(np.diff(t), x[:-1], x[1:], strict=True):
        slope = (end - begin) / step
        behind = end - slope * tau + (behind - begin + slope * tau) * math.exp(-step / tau)
        found.append(behind)
    return np.array(found)


def with_play(t, x, width=0.12):
    place, found = x[0], []
    for target in x:
        place = min(max(place, target - width / 2), target + width / 2)
        found.append(place)
    return np.array(found)


def stretched(t, x):
    return 1.001 * x


HIDDEN = {"lag": lagging, "delay": delayed, "backlash": with_play, "scale": stretched}


def add_run(folder, t, x, law, seed):
    """Another run of the experiment in a folder; its file."""
    nth = len(list(folder.glob("*.csv")))
    read = law(t, x) + 0.005 * np.random.default_rng(seed).standard_normal(len(t))
    write(folder / f"{nth}.csv", {"time_s": t, "target_mm": x, "position_mm": read})
    file = folder / "experiment.toml"
    text = file.read_text(encoding="utf-8") if nth else HEAD
    file.write_text(f'{text}[[run]]\ndata = "{nth}.csv"\n', encoding="utf-8")
    return file


def concluded(folder, motion, name, seed=1):
    law = HIDDEN.get(name, lambda t, x: x)
    return open_experiment(add_run(folder, TIMES, MOTIONS[motion], law, seed)).conclude()


def names_of(verdict):
    return {effect.name for effect in verdict.effects}


def played(text):
    """Times and places of a proposed command."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "time_s,target_mm"
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]]).T


@pytest.mark.parametrize(
    ("motion", "name", "rival"),
    [
        ("sine", "lag", "delay"),
        ("sine", "delay", "lag"),
        ("there and back", "backlash", "lag"),
        ("one way", "delay", "lag"),
        ("one way", "scale", "drift"),
    ],
)
def test_a_proposed_run_parts_what_one_motion_leaves_open(tmp_path, motion, name, rival):
    conclusion = concluded(tmp_path, motion, name)
    assert conclusion.verdict.verdict == "ambiguous"
    family = names_of(conclusion.verdict).union(*conclusion.verdict.alternatives)
    assert {name, rival} <= family
    proposal = conclusion.next_experiment
    t, x = played(proposal.text)
    assert MOTIONS[motion].min() - 1e-9 <= x.min() <= x.max() <= MOTIONS[motion].max() + 1e-9
    assert f"{t[-1] - t[0]:.4g} s" in proposal.summary
    verdict = open_experiment(add_run(tmp_path, t, x, HIDDEN[name], 2)).conclude().verdict
    assert (verdict.verdict, names_of(verdict)) == ("named", {name})


@pytest.mark.parametrize("name", HIDDEN)
def test_a_varied_motion_leaves_nothing_open(tmp_path, name):
    conclusion = concluded(tmp_path, "varied", name)
    assert (conclusion.verdict.verdict, names_of(conclusion.verdict)) == ("named", {name})
    assert not conclusion.verdict.alternatives
    assert conclusion.next_experiment is None


@pytest.mark.parametrize("motion", MOTIONS)
def test_nothing_hidden_is_none_whatever_the_motion(tmp_path, motion):
    assert concluded(tmp_path, motion, "nothing").verdict.verdict == "none"


def test_what_other_motions_tell_is_ambiguous_however_much_evidence_is_here(tmp_path):
    """A delay of one slow frequency is a lag to a tenth of the noise."""
    conclusion = concluded(tmp_path, "sine", "delay")
    (effect,) = conclusion.verdict.effects
    assert effect.rivals["lag"] > 10
    (line,) = conclusion.glance.cannot_tell
    assert line.startswith("delay from lag (ΔEBIC +")
    assert "; a run twice as fast differs by " in line
    assert conclusion.as_json()["glance"]["cannot_tell"] == [line]


def test_friction_by_load_at_one_load_is_told_with_another_load(tmp_path):
    text = DRIVEN.replace("[[sensor]]", 'load = { column = "load_N" }\n[[sensor]]')
    effect = '[[effect]]\nname = "by load"\nenters = "friction"\nformula = "mu * load"\n'
    machine = f'{DRIVE}{effect}mu = {{ unit = "1" }}\n'
    (tmp_path / "machine.toml").write_text(machine, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    columns = driven(dry=0.5)
    write(tmp_path / "run.csv", {**columns, "load_N": np.full(len(columns["time_s"]), 10.0)})
    done, out = tmp_path / "next.csv", tmp_path / "wrong.CMD"
    said = run_here(tmp_path, "reconcile", "experiment.toml", "--next", done)
    assert "a run with twice the load differs by" in said.stdout
    assert "more lines: --next writes all" in said.stdout
    rows = done.read_text(encoding="utf-8").splitlines()
    assert rows[2] == "time_s,force_N,load_N"
    assert {row.split(",")[2] for row in rows[3:]} == {"20"}
    refused = run_here(tmp_path, "reconcile", "experiment.toml", "--next", out)
    assert refused.returncode == 2
    assert ".csv here" in refused.stderr
    assert not out.exists()


# -- motions ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("one")
    file = add_run(folder, TIMES, MOTIONS["one way"], stretched, 1)
    return open_experiment(file).system.model


def test_other_motions_are_the_log_s_own_slower_faster_shorter_and_reversed(model):
    (run,) = model.experiment.trials
    made = {motion.words: moved(model, motion, run) for motion in other_motions(model)}
    length, reach = 59.95, 1e-3 * np.ptp(MOTIONS["one way"])
    sizes = {
        words: (np.ptp(own.time_s) / length, np.ptp(own.inputs["command"]) / reach)
        for words, own in made.items()
    }
    assert sizes["half as fast"] == pytest.approx((2, 1), rel=1e-3)
    assert sizes["twice as fast"] == pytest.approx((0.5, 1), rel=2e-3)
    assert sizes["with half the stroke"] == pytest.approx((1, 0.5))
    assert sizes["with twice the stroke, in twice the time"] == pytest.approx((2, 2), rel=1e-3)
    assert sizes["with a quarter of the stroke, 4 times forth and back"] == pytest.approx(
        (2, 0.25), rel=1e-3
    )
    assert sizes["at rest"] == (1, 0)
    mirrored = made["the other way about"].inputs["command"]
    assert mirrored == pytest.approx(run.inputs["command"].max() - run.inputs["command"])
    assert all(len(own.readings[0].values) == len(own.time_s) for own in made.values())


def test_forth_and_back_goes_through_the_same_places(model):
    (run,) = model.experiment.trials
    both = moved(model, Motion("", times=1), run).inputs["command"]
    assert both[: len(TIMES)] == pytest.approx(run.inputs["command"])
    assert both == pytest.approx(both[::-1], abs=1e-9)
