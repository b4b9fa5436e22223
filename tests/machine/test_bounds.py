"""`machine check` refuses every machine that a run cannot do, with the reason."""

import math
import re
from importlib import resources

import numpy as np
import pytest

import mopro
from mopro.errors import ModelError, RunError
from mopro.machine import model
from mopro.machine.file import read_machine
from mopro.plant import MAX_STEP_S
from mopro.source import Source

TEXT = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()
KEYS = re.findall(r"^(\w+) = \{ value", TEXT, re.MULTILINE)
EXTREMES = ("1e-320", "1e-300", "1e-30", "1e-9", "1e-6", "1e6", "1e9", "1e30", "1e300", "1e308")
PROGRAM = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 0.5\nWX1\n"


def stated(key, value):
    return re.sub(rf"^({key} = {{ value = )[^,]+,", rf"\g<1>{value},", TEXT, flags=re.MULTILINE)


def findings(text):
    with pytest.raises(ModelError) as caught:
        read_machine(Source("m.toml", text))
    return caught.value


@pytest.mark.parametrize("key", KEYS)
def test_what_is_read_can_be_run(key):
    """A machine at an extreme is refused by its file, or its run has finite numbers only."""
    for value in EXTREMES:
        try:
            machine = read_machine(Source("m.toml", stated(key, value)))
        except ModelError:
            continue
        recording = mopro.emulate(mopro.compile(PROGRAM), machine, rate_hz=200.0)
        for name, column in recording.columns.items():
            assert np.isfinite(column).all(), (value, name)


@pytest.mark.parametrize("key", ["coil_resistance", "coil_inductance", "supply", "phase_current"])
def test_a_full_drive_at_an_extreme_runs_or_is_said_to_be_unstable(key):
    """Of the drive's own numbers both happen: the run is finite, or an error at its line."""
    ends = set()
    for value in ("1e-320", "1e-9", "1e-3", "1e3", "1e9", "1e308"):
        text = stated(key, value).replace("[drive]\n", '[drive]\nmodel = "full"\n')
        try:
            machine = read_machine(Source("m.toml", text))
            recording = mopro.emulate(mopro.compile(PROGRAM), machine, rate_hz=200.0)
        except (ModelError, RunError) as error:
            ends |= {d.rule for d in error.diagnostics}
            continue
        ends.add("finite")
        for name, column in recording.columns.items():
            assert np.isfinite(column).all(), (value, name)
    assert "finite" in ends
    assert ends <= {"finite", "not-finite", "bad-value"}


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("moving_mass", "1e-12", "moving_mass must be from 1e-09 to 1e+09 kg"),
        ("pull_out_force", "1e12", "pull_out_force must be from 1e-09 to 1e+09 N"),
        ("pitch", "1e-320", "pitch must be from 1e-09 to 1e+09 m"),
        ("phase_current", "1e300", "phase_current must be from 1e-09 to 1e+09 A"),
        ("coil_resistance", "1e308", "coil_resistance must be from 1e-09 to 1e+09 ohm"),
        ("ambient", "-300", "ambient must be from -273.15 to 10000 C"),
    ],
)
def test_a_number_beyond_its_bounds_is_refused_at_its_line(key, value, expected):
    error = findings(stated(key, value))
    assert error.source.line(error.diagnostics[0].span.line).startswith(f"{key} =")
    assert expected in str(error)


def test_a_motion_too_fast_for_the_steps_of_the_emulator_is_refused():
    error = findings(stated("moving_mass", "1e-6"))
    assert [d.rule for d in error.diagnostics] == ["too-fast"]
    # sqrt(2π/1.016 mm * 111 N / 1 mg) / 2π
    assert "moving_mass give a natural frequency of 1.319e+05 Hz" in str(error)


def test_the_fastest_motion_is_one_that_the_steps_resolve():
    """RK4 is stable up to 2.78 per step on the real axis and 2.83 on the imaginary one."""
    assert model.FASTEST_1_S * MAX_STEP_S <= 2.0
    wave, force = 2 * math.pi / 1.016e-3, 111.0
    slowest_kg = wave * force / model.FASTEST_1_S**2
    with pytest.raises(ModelError, match="too-fast"):
        read_machine(Source("m", stated("moving_mass", f"{slowest_kg * 0.9}")))
    machine = read_machine(Source("m", stated("moving_mass", f"{slowest_kg * 1.2}")))
    recording = mopro.emulate(mopro.compile(PROGRAM), machine)
    assert not recording.run.stalled


def test_a_forcer_larger_than_its_platen_is_refused():
    error = findings(stated("length", "1e-6"))
    assert [(d.rule, error.source.line(d.span.line)[:6]) for d in error.diagnostics] == [
        ("no-travel", "length")
    ]


def test_check_refuses_and_run_refuses_alike(mopro, tmp_path):
    (tmp_path / "m.toml").write_text(stated("moving_mass", "1e-12"))
    checked = mopro("machine", "check", "m.toml")
    ran = mopro("run", "P.CMD", "--emulate", "--machine", "m.toml", "--out", "o.csv", text=PROGRAM)
    assert (checked.returncode, ran.returncode) == (1, 2)
    assert checked.stderr == ran.stderr
    assert "m.toml:10:" in ran.stderr
