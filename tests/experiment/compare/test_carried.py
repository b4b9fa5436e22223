"""Which numbers of a machine's file hold on runs that it was not fitted to."""

import json

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import follows, write
from mopro.engine import Estimate, Parameter, Role
from mopro.experiment.carried import CARRIED, DIFFERS, NOT_TOLD, _word

EXPERIMENT = follows(0.01, "run.csv")
MACHINE = """\
kind = "kinematic"
name = "slide"
[effects.backlash]
w = { value = 0.5, unit = "mm" }
[effects.delay]
d = { value = 0.08, unit = "s" }
"""
HEAD = 'kind = "kinematic"\nname = "slide"\n'
T = np.arange(0, 40, 0.02)
MOVING = np.interp(T, np.linspace(0, 40, 12), np.random.default_rng(5).uniform(-20, 20, 12))


def told_of(folder, columns, numbers, experiment=EXPERIMENT):
    """Each number of the machine file `numbers` and what `compare` says of it, on these columns."""
    write(folder / "run.csv", columns)
    (folder / "unseen.toml").write_text(experiment, "utf-8")
    (folder / "slide.toml").write_text(numbers, "utf-8")
    done = run_here(folder, "compare", "unseen.toml", "--apply", "slide.toml", "--json")
    answer = json.loads(done.stdout, parse_constant=pytest.fail)
    return {f"{own['effect']}.{own['parameter']}": own for own in answer["carried_over"]}


def applied(folder, target, delay_s, play_mm, numbers=MACHINE):
    """As `told_of`, on a slide with this delay and play."""
    late = np.interp(T - delay_s, T, target)
    place, read = late[0], np.empty_like(late)
    for i, to in enumerate(late):
        read[i] = place = min(max(place, to - play_mm / 2), to + play_mm / 2)
    noise = 0.01 * np.random.default_rng(2).standard_normal(len(T))
    return told_of(folder, {"time_s": T, "target_mm": target, "position_mm": read + noise}, numbers)


@pytest.mark.parametrize(
    ("delay_s", "play_mm", "words"),
    [(0.08, 0.5, (CARRIED, CARRIED)), (0.08, 0.3, (CARRIED, DIFFERS)),
     (0.05, 0.5, (DIFFERS, CARRIED))],
)  # fmt: skip
def test_a_number_carries_over_where_the_run_has_the_same(tmp_path, delay_s, play_mm, words):
    told = applied(tmp_path, MOVING, delay_s, play_mm)
    assert (told["delay.d"]["carried"], told["backlash.w"]["carried"]) == words
    for name, true in (("delay.d", delay_s), ("backlash.w", play_mm)):
        low, high = told[name]["ci95"]
        assert low <= true <= high
        assert told[name]["here"] == pytest.approx(true, rel=0.05)


def test_a_run_at_rest_tells_of_nothing(tmp_path):
    told = applied(tmp_path, np.full_like(T, 3.0), 0.08, 0.5)
    assert {own["carried"] for own in told.values()} == {NOT_TOLD}


def test_the_terminal_says_it_in_a_table(tmp_path):
    applied(tmp_path, MOVING, 0.08, 0.3)
    done = run_here(tmp_path, "compare", "unseen.toml", "--apply", "slide.toml")
    lines = [line for line in done.stdout.splitlines() if line.startswith(("delay.d", "backlash."))]
    assert [line.rstrip().split("   ")[-1].strip() for line in lines] == [DIFFERS, CARRIED]


@pytest.mark.parametrize(("home_mm", "told"), [(0.0, False), (2.0, True)])
def test_a_wave_whose_phase_is_another_is_told_to_be_worse(tmp_path, home_mm, told):
    """The error of a resolver stays with its own zero, which homing anew moved by half a turn."""
    noise = 0.01 * np.random.default_rng(3).standard_normal(len(T))
    read = MOVING + 0.05 * np.sin(2 * np.pi * (MOVING + home_mm) / 4) + noise
    file = HEAD + '[effects.periodic_error]\nP = { value = 4.0, unit = "mm" }\ns = 0.05\nc = 0.0\n'
    told_of(tmp_path, {"time_s": T, "target_mm": MOVING, "position_mm": read}, file)
    done = run_here(tmp_path, "compare", "unseen.toml", "--apply", "slide.toml")
    assert ("worse than before the repair: is a zero or a phase another" in done.stderr) == told


def test_a_file_without_effects_has_nothing_to_carry_over(tmp_path):
    assert applied(tmp_path, MOVING, 0.08, 0.5, 'kind = "kinematic"\nname = "slide"\n') == {}


def test_a_part_that_is_nearly_off_carries_over_beside_the_others(tmp_path):
    """Of a wave that is a pure sine the cosine is known, to be none."""
    noise = 0.01 * np.random.default_rng(3).standard_normal(len(T))
    read = MOVING + 0.05 * np.sin(2 * np.pi * MOVING / 4) + noise
    file = (
        HEAD
        + """[effects.periodic_error]
P = { value = 4.0, unit = "mm" }
s = { value = 0.05, unit = "mm" }
c = { value = 1e-5, unit = "mm" }
"""
    )
    told = told_of(tmp_path, {"time_s": T, "target_mm": MOVING, "position_mm": read}, file)
    assert {own["carried"] for own in told.values()} == {CARRIED}


def test_what_these_data_do_not_bound_has_no_ends(tmp_path):
    """A load of two sizes tells no compliance from its hardening."""
    load = np.where(T % 4 < 2, 2.0, -2.0)
    noise = 0.01 * np.random.default_rng(3).standard_normal(len(T))
    file = (
        HEAD
        + """[effects.compliance]
c = { value = 0.01, unit = "mm/N" }
[effects.hardening]
c3 = { value = 1e-3, unit = "mm/N3" }
"""
    )
    experiment = EXPERIMENT.replace("[[sensor]]", 'load = { column = "load_N" }\n[[sensor]]', 1)
    columns = {"time_s": T, "target_mm": MOVING, "load_N": load,
               "position_mm": MOVING + 0.01 * load + 1e-3 * load**3 + noise}  # fmt: skip
    told = told_of(tmp_path, columns, file, experiment)
    assert {own["carried"] for own in told.values()} == {NOT_TOLD}
    assert [own["ci95"] for own in told.values()] == [[None, None]] * 2


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_an_angle_is_the_same_a_turn_on(turns):
    phase = Parameter("phi", "rad", -7.0, 7.0, role=Role.PHASE)
    here = Estimate(-3.14, "rad", (-3.195, -3.084), False)
    assert _word(3.12 + 2 * np.pi * turns, here, phase) == CARRIED
    assert _word(3.0 + 2 * np.pi * turns, here, phase) == DIFFERS


def test_every_number_of_the_file_is_told(tmp_path):
    """Also one that no run of this size can have."""
    told = applied(tmp_path, MOVING, 0.08, 0.5, MACHINE.replace("0.5, unit", "1e7, unit"))
    assert set(told) == {"backlash.w", "delay.d"}
    assert told["backlash.w"]["carried"] != CARRIED
