"""Quantities of a machine by the keys of its file, and machines that differ in one."""

import pytest

from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.source import Source

CHOW = load_machine("chow1992")
EXTENDS = 'name = "mine"\nextends = "chow1992"\n'


def place(key, machine=CHOW):
    return {each.name: each for each in machine.places()}[key]


def test_a_changed_machine_is_the_one_of_such_a_file():
    text = EXTENDS + (
        '[axis]\nmoving_mass = { value = 3.0, unit = "kg", origin = "assumed", place = "" }\n'
    )
    stated = read_machine(Source("m.toml", text))
    changed = place("axis.moving_mass").changed(CHOW, 3.0)
    assert (changed.axis, changed.drive, changed.heat) == (stated.axis, stated.drive, stated.heat)
    assert place("axis.moving_mass").of(changed) == 3.0


def test_a_place_knows_its_bounds_and_choices():
    assert place("axis.moving_mass").fault(2.0) is None
    assert "from 1e-09 to 1e+09 kg" in place("axis.moving_mass").fault(0.0)
    assert place("drive.model").choices == ("ideal", "full")
    assert (place("drive.model").unit, place("heat.ambient").unit) == ("", "C")


def test_what_no_run_can_be_done_on_is_told():
    assert CHOW.fault() is None
    assert "too fast" in place("axis.pull_out_force").changed(CHOW, 1e9).fault()
    assert "no travel" in place("platen.width").changed(CHOW, 0.01).fault()


def test_a_parameter_of_an_effect_leaves_the_others_as_stated():
    text = EXTENDS + "[effects.platen_conduction]\nG = 5.0\nT_p = 30.0\naxes = [1]\n"
    machine = read_machine(Source("m.toml", text)).with_parameter("platen_conduction", "G", 7.0)
    (active,) = active_effects(machine, catalogue_of(machine))
    assert active.as_json()["parameters"] == {"G": 7.0, "g": 0.0, "T_p": 30.0}
    assert active.axes == (1,)


@pytest.mark.parametrize("unstated", ["viscous_drag"])
def test_an_effect_that_the_machine_lacks_is_switched_on(unstated):
    machine = CHOW.with_parameter(unstated, "b", 4.0)
    (active,) = active_effects(machine, catalogue_of(machine))
    assert (active.name, active.values) == (unstated, (4.0,))
