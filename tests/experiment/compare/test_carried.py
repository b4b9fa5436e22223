"""Which numbers of a machine's file hold on runs that it was not fitted to."""

import json

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import write
from mopro.experiment.carried import CARRIED, DIFFERS, NOT_TOLD

EXPERIMENT = """\
machine = "kinematic"
[inputs]
command = { column = "target_mm" }
[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = 0.01
[[run]]
data = "run.csv"
"""
MACHINE = """\
kind = "kinematic"
name = "slide"
[effects.backlash]
w = { value = 0.5, unit = "mm" }
[effects.delay]
d = { value = 0.08, unit = "s" }
"""
T = np.arange(0, 40, 0.02)
MOVING = np.interp(T, np.linspace(0, 40, 12), np.random.default_rng(5).uniform(-20, 20, 12))


def applied(folder, target, delay_s, play_mm, numbers=MACHINE):
    """Each number of the file and what `compare` says of it, on a slide with these numbers."""
    late = np.interp(T - delay_s, T, target)
    place, read = late[0], np.empty_like(late)
    for i, to in enumerate(late):
        read[i] = place = min(max(place, to - play_mm / 2), to + play_mm / 2)
    noise = 0.01 * np.random.default_rng(2).standard_normal(len(T))
    write(folder / "run.csv", {"time_s": T, "target_mm": target, "position_mm": read + noise})
    (folder / "unseen.toml").write_text(EXPERIMENT, "utf-8")
    (folder / "slide.toml").write_text(numbers, "utf-8")
    done = run_here(folder, "compare", "unseen.toml", "--apply", "slide.toml", "--json")
    return {
        f"{own['effect']}.{own['parameter']}": own
        for own in json.loads(done.stdout)["carried_over"]
    }


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


def test_a_file_without_effects_has_nothing_to_carry_over(tmp_path):
    assert applied(tmp_path, MOVING, 0.08, 0.5, 'kind = "kinematic"\nname = "slide"\n') == {}
