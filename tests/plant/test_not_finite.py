"""A run that leaves the finite numbers fails with its line and cause, never with exit 0."""

import dataclasses
import re
from importlib import resources

import numpy as np
import pytest

import mopro
from mopro.errors import MoproError
from mopro.machine import load_machine
from mopro.plant import simulate

TEXT = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()
PROGRAM = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 0.5\nWX1\n"
STIFF = re.sub(r"(phase_current = { value = )[^,]+", r"\g<1>0.001", TEXT).replace(
    "[platen]", 'model = "full"\n\n[platen]'
)


def machine(**axis):
    nominal = load_machine("chow1992")
    return dataclasses.replace(nominal, axis=dataclasses.replace(nominal.axis, **axis))


@pytest.mark.parametrize("compiled", [False, True])
def test_a_motion_that_diverges_fails_at_its_line(compiled):
    with pytest.raises(MoproError) as caught:
        mopro.emulate(mopro.compile(PROGRAM), machine(moving_mass_kg=1e-9), compiled=compiled)
    told = caught.value.render().splitlines()
    assert re.fullmatch(
        r"<text>:4:1: the motion of axis 1 is not finite from 0.\d+ s on: .*\[not-finite\]", told[0]
    )
    assert "mass" in told[-1]


def test_the_run_exits_with_1_and_names_the_cause(mopro, tmp_path):
    (tmp_path / "m.toml").write_text(STIFF)
    ran = mopro("run", "P.CMD", "--emulate", "--machine", "m.toml", "--out", "o.csv", text=PROGRAM)
    assert ran.returncode == 1
    assert ran.stderr.startswith("P.CMD:4:1: the motion of axis 1 is not finite")
    assert "voltage_saturation" in ran.stderr
    assert not (tmp_path / "o.csv").exists()


def test_check_tries_the_machine_out(mopro, tmp_path):
    (tmp_path / "m.toml").write_text(STIFF)
    checked = mopro("machine", "check", "m.toml")
    assert checked.returncode == 1
    assert "a trial move of one pitch fails" in checked.stderr
    assert "[unstable]" in checked.stderr


def test_a_mass_of_nothing_is_refused_with_the_effect(mopro, tmp_path):
    light = re.sub(r"(moving_mass = { value = )[^,]+", r"\g<1>2.0", TEXT)
    (tmp_path / "m.toml").write_text(f"{light}\n[effects.payload_mass]\ndm = -2.0\n")
    checked = mopro("machine", "check", "m.toml")
    assert checked.returncode == 1
    assert "has a mass of 0 kg" in checked.stderr
    assert "[effects.payload_mass]" in checked.stderr


def test_a_temperature_that_grows_beyond_bounds_is_refused(mopro, tmp_path):
    small = re.sub(r"(specific_heat = { value = )[^,]+", r"\g<1>1e-6", TEXT)
    (tmp_path / "m.toml").write_text(f"{small}\n[effects.radiation]\n")
    checked = mopro("machine", "check", "m.toml")
    ran = mopro("run", "P.CMD", "--emulate", "--machine", "m.toml", "--out", "o.csv", text=PROGRAM)
    assert (checked.returncode, ran.returncode) == (1, 1)
    assert "temperature" in checked.stderr
    assert "temperature" in ran.stderr


def test_the_nominal_machine_passes(mopro):
    assert mopro("machine", "check", "chow1992").returncode == 0


def test_a_column_that_is_not_finite_fails_the_run():
    """Whatever makes it so: here a resistance that no machine file may state."""
    nominal = load_machine("chow1992")
    drive = dataclasses.replace(nominal.drive, coil_resistance_ohm=float("inf"))
    with pytest.raises(MoproError, match="temperature_C is not finite"):
        mopro.emulate(mopro.compile(PROGRAM), dataclasses.replace(nominal, drive=drive))


def test_a_caller_without_outcomes_gets_nan_from_both_kernels():
    """The diagnosis tries values that do not work out, and judges the prediction itself."""
    program = mopro.compile(PROGRAM)
    unstable = machine(moving_mass_kg=1e-9)
    from mopro.plant import plan_with_effects

    schedule = plan_with_effects(program, unstable, ())
    times = np.linspace(0.0, 0.1, 11)
    for compiled in (False, True):
        simulation = simulate(schedule, unstable, (), compiled=compiled)
        with np.errstate(invalid="ignore", over="ignore"):
            assert np.isnan(simulation.positions_m(1, times, 0.1)[-1])
