"""Files of the laboratory, read back; and files of other origin."""

import itertools

import numpy as np
import pytest

from mopro.errors import DataError
from mopro.instruments import (
    Lvdt,
    Thermocouple,
    block_velocity,
    read_lvdt,
    read_thermocouple,
    write_lvdt,
    write_thermocouple,
)

IN = 0.0254


def test_the_converter_is_that_of_the_thesis():
    lvdt = Lvdt()
    assert lvdt.step_V == pytest.approx(4.883e-3, abs=5e-7)
    assert lvdt.times_s()[-1] == pytest.approx(959 / 800)
    volts = Lvdt(linearity=0.0).volts(np.array([-10, 0, 5, 20, -20]) * IN)
    assert volts == pytest.approx([-10, 0, 5, 2047 * 20 / 4096, -10], abs=lvdt.step_V / 2)


def test_linearity_is_a_share_of_the_full_range_at_the_ends():
    straight, bent = (Lvdt(linearity=k).volts(np.array([9.0, 0.0]) * IN) for k in (0.0, 0.0025))
    assert bent[0] - straight[0] == pytest.approx(0.0025 * 20 * 0.9**3, abs=0.005)
    assert bent[1] == straight[1]


def test_ripple_is_25_millivolts_and_repeats_with_its_seed():
    lvdt = Lvdt()
    first, again, other = (
        lvdt.volts(np.zeros(960), np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first.std() == pytest.approx(0.025, rel=0.1)


def test_lvdt_files_read_back_to_the_step(tmp_path):
    lvdt = Lvdt(middle_m=7.5 * IN, linearity=0.0)
    position = np.linspace(0, 15 * IN, 960)
    volts = lvdt.volts(position)
    write_lvdt(tmp_path / "LVDT20.DAT", volts)
    text = (tmp_path / "LVDT20.DAT").read_bytes()
    assert text.startswith(b"-7.5")
    assert text.count(b"\r\n") == 960
    back = read_lvdt(tmp_path / "LVDT20.DAT")
    assert np.rint(back / lvdt.step_V) == pytest.approx(np.rint(volts / lvdt.step_V))
    step_m = lvdt.step_V / 10 * 10 * IN
    assert np.abs(lvdt.position_m(back) - position).max() < 0.51 * step_m


def test_thermocouple_files_read_back(tmp_path):
    chain = Thermocouple()
    times = chain.times_s(3600.0)
    assert (times[119], times[120], times[121]) == (119, 120, 135)
    assert len(chain.times_s(1e6)) == 1921
    true = 24.87 + 30 * (1 - np.exp(-times / 900))
    stored = chain.stored_C(true)
    assert stored * 10.24 == pytest.approx(np.rint(stored * 10.24), abs=1e-9)
    write_thermocouple(tmp_path / "TEST12.DAT", stored, times)
    temperature, when = read_thermocouple(tmp_path / "TEST12.DAT")
    assert np.abs(temperature - true).max() <= 0.5 / 10.24 + 1e-6
    assert when == pytest.approx(times)


def test_the_forty_sample_average_shows_even_motion_and_blunts_corners():
    t = np.arange(960) / 800
    times, speed = block_velocity(0.3 * t, 800.0)
    assert len(speed) == 23
    assert speed == pytest.approx(0.3, rel=1e-9)
    # An average over 40 samples is centred 19.5 samples in; two of them bracket the time.
    assert times[0] == pytest.approx(39.5 / 800)
    ramp = np.maximum(0.0, t - 0.5)
    _, corner = block_velocity(ramp, 800.0)
    assert 0 < corner[9] < 1
    assert corner[8] == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nan", "LVDT.DAT:11:1: not a finite number"),
        ("1.5 2.5", "LVDT.DAT:11:1: 2 columns, expected 1"),
        ("10.5", "LVDT.DAT:11:1: 10.5 V is out of range"),
        ("one", "LVDT.DAT:11:1: 'one' is no number"),
        ("7" * 500, "LVDT.DAT:11:1: a line of more than 199 characters"),
    ],
)
def test_bad_lines_are_named(tmp_path, line, message):
    path = tmp_path / "LVDT.DAT"
    path.write_text("\n".join([" 1.25 "] * 10 + [line] + [" 1.25 "] * 949))
    with pytest.raises(DataError) as caught:
        read_lvdt(path)
    assert message in str(caught.value)


def test_truncated_and_endless_files(tmp_path):
    short = tmp_path / "SHORT.DAT"
    short.write_text(" 1.25 \r\n" * 500)
    with pytest.raises(DataError, match="500 samples, expected 960"):
        read_lvdt(short)
    assert len(read_lvdt(short, samples=None)) == 500
    short.write_text("")
    with pytest.raises(DataError, match="truncated"):
        read_lvdt(short, samples=None)


def test_a_file_without_end_is_read_no_further_than_it_may_go(tmp_path, monkeypatch):
    """10⁸ lines, simulated by a file object that never ends."""
    served = itertools.count()

    class Endless:
        def readline(self, most):
            next(served)
            return " 1.25 \n"

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    monkeypatch.setattr("builtins.open", lambda *_, **__: Endless())
    with pytest.raises(DataError, match="961:1: more than 960 samples"):
        read_lvdt("ENDLESS.DAT")
    assert next(served) == 961


def test_temperatures_out_of_range_and_time_that_stands(tmp_path):
    path = tmp_path / "T.DAT"
    path.write_text(" 25.0  0 \n 201  1 \n")
    with pytest.raises(DataError, match=r"T\.DAT:2:1: 201 °C is out of range"):
        read_thermocouple(path)
    path.write_text(" 25.0  0 \n 25  0 \n")
    with pytest.raises(DataError, match=r"T\.DAT:2:1: the time does not go on"):
        read_thermocouple(path)


def test_a_file_that_is_not_there():
    with pytest.raises(DataError, match="cannot be read"):
        read_lvdt("/nowhere/LVDT.DAT")
