"""The noise report against synthetic noise of known level, memory, hum and step."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from mopro.noise import TooShort, report
from mopro.noise.report import _level
from mopro.noise.spectral import Line, without_lines

RATE_HZ = 400.0
LEVEL = 0.02
COUNT = 3000
SEEDS = 40


def autoregression(rng, correlation, level=LEVEL, count=COUNT):
    innovation = level * np.sqrt(1 - correlation**2) * rng.normal(size=count + 1000)
    return lfilter([1.0], [1.0, -correlation], innovation)[1000:]


def flicker(rng, corner_hz, white, count=1 << 14):
    """White noise below whose corner the density grows as 1/f."""
    frequencies = np.fft.rfftfreq(count, 1 / RATE_HZ)
    gain = np.sqrt(1 + corner_hz / np.maximum(frequencies, frequencies[1]))
    return np.fft.irfft(np.fft.rfft(white * rng.normal(size=count)) * gain, count)


def with_move(noise, step=0.0):
    """The noise on a signal that stands, moves by 5 and stands again."""
    place = np.interp(np.arange(len(noise)), [len(noise) // 3, len(noise) // 3 + 100], [0.0, 5.0])
    signal = place + noise
    return np.rint(signal / step) * step if step else signal


def of(values):
    return report(np.arange(len(values)) / RATE_HZ, values)


def covered(make):
    """Share of the seeds whose 95 % interval has the level, and the mean of the levels."""
    found = [of(with_move(*make(np.random.default_rng(seed)))).rms for seed in range(SEEDS)]
    share = np.mean([e.low <= LEVEL <= e.high for e in found])
    return share, np.mean([e.value for e in found])


@pytest.mark.parametrize(
    "make",
    [
        lambda rng: (LEVEL * rng.normal(size=COUNT),),
        lambda rng: (autoregression(rng, 0.8),),
        lambda rng: (LEVEL * rng.normal(size=COUNT), LEVEL),
        lambda rng: (LEVEL * rng.normal(size=COUNT), 2.5 * LEVEL),
    ],
    ids=["white", "ar1", "step as large", "step larger"],
)
def test_the_interval_has_the_level(make):
    share, mean = covered(make)
    assert share >= 0.85  # of 40 seeds at 95 %, fewer than 34 have a chance of 0.003
    assert mean == pytest.approx(LEVEL, rel=0.02)


def test_standstill_is_what_lies_before_and_after_the_move():
    rng = np.random.default_rng(1)
    noise = of(with_move(LEVEL * rng.normal(size=COUNT)))
    (a, b), (c, d) = noise.stretches
    assert a == 0
    assert 900 <= b <= 1000
    assert 1100 <= c <= 1200
    assert d >= 2950


@pytest.mark.parametrize("correlation", [0.5, 0.9])
def test_a_memory_of_one_step_is_found_with_its_correlation(correlation):
    memory = of(autoregression(np.random.default_rng(2), correlation)).memory
    assert memory.kind == "ar1"
    assert abs(memory.correlation - correlation) < 2 * memory.correlation_ci
    assert memory.correlation_ci < 0.05


def test_white_noise_has_no_memory_nor_hum():
    for seed in range(SEEDS):
        noise = of(LEVEL * np.random.default_rng(seed).normal(size=COUNT))
        assert noise.memory.kind == "white"
        assert noise.lines == noise.outliers == noise.stuck == ()
        assert noise.step == 0


def test_a_rise_towards_low_frequencies_has_its_corner_and_slope():
    corners = []
    for seed in range(10):
        memory = of(flicker(np.random.default_rng(seed), 10.0, LEVEL)).memory
        assert memory.kind == "flicker"
        assert memory.white_rms == pytest.approx(LEVEL, rel=0.05)
        assert abs(memory.slope + 1) < 2 * memory.slope_ci
        corners.append(memory.corner_ci_hz[0] <= 10.0 <= memory.corner_ci_hz[1])
    assert sum(corners) >= 8


def test_hum_has_its_frequency_and_amplitude():
    rng = np.random.default_rng(3)
    time_s = np.arange(COUNT) / RATE_HZ
    noise = of(LEVEL * rng.normal(size=COUNT) + 0.01 * np.sin(2 * np.pi * 50.1 * time_s + 1))
    (line,) = noise.lines
    assert abs(line.frequency_hz - 50.1) < 2 * line.frequency_ci_hz < 0.1
    assert abs(line.amplitude - 0.01) < 1.5 * line.amplitude_ci < 0.005
    assert noise.rms.value == pytest.approx(LEVEL, rel=0.05)


def test_mains_that_is_sampled_too_slowly_is_called_that():
    rng = np.random.default_rng(4)
    time_s = np.arange(4000) / 80.0
    values = 0.01 * np.sin(2 * np.pi * 50.0 * time_s) + 0.005 * rng.normal(size=4000)
    (line,) = report(time_s, values).lines
    assert line.frequency_hz == pytest.approx(30.0, abs=0.01)
    assert line.mains_hz == 50.0


@pytest.mark.parametrize("correlation", [0.5, 0.9, 0.99])
def test_memory_is_not_taken_for_hum(correlation):
    found = [
        of(autoregression(np.random.default_rng(seed), correlation)).lines for seed in range(SEEDS)
    ]
    assert sum(map(len, found)) <= 1


def test_a_converter_step_is_found_from_values_that_were_printed_rounded():
    rng = np.random.default_rng(5)
    counts = np.rint(rng.normal(size=2000) * 1.5)
    noise = of(np.round(21.0 + 0.3226 * counts, 2))
    assert noise.step == pytest.approx(0.3226, rel=2e-3)
    assert noise.adc_step == noise.step


def test_noise_below_the_step_is_told_as_hidden():
    values = np.concatenate((np.zeros(300), np.arange(100.0), np.full(300, 99.0)))
    noise = of(values)
    assert noise.step == 1.0
    assert noise.hidden
    assert noise.stuck == ()


def test_outliers_are_found_and_left_out():
    rng = np.random.default_rng(6)
    values = LEVEL * rng.normal(size=COUNT)
    values[[100, 2000]] += 40 * LEVEL
    noise = of(values)
    assert set(noise.outliers) == {100, 2000}
    assert noise.rms.low < LEVEL < noise.rms.high


def test_a_value_that_is_stuck_is_found():
    rng = np.random.default_rng(7)
    values = LEVEL * rng.normal(size=COUNT)
    values[1000:1060] = values[1000]
    noise = of(values)
    assert noise.stuck == ((1000, 1060),)
    assert noise.rms.low < LEVEL < noise.rms.high


def test_a_held_value_counts_once():
    rng = np.random.default_rng(8)
    noise = of(np.repeat(LEVEL * rng.normal(size=1000), 5))
    assert noise.held == 5
    assert noise.readings <= 1000
    assert noise.memory.kind == "white"
    assert noise.rms.low < LEVEL < noise.rms.high


def test_irregular_times_give_a_level_and_no_spectrum():
    rng = np.random.default_rng(9)
    time_s = np.cumsum(rng.exponential(0.01, COUNT))
    noise = report(time_s, LEVEL * rng.normal(size=COUNT))
    assert not noise.regular
    assert noise.memory is None
    assert noise.rms.low < LEVEL < noise.rms.high


def test_a_signal_that_never_stands_is_refused():
    time_s = np.arange(2000) / RATE_HZ
    for values in (3.0 * time_s, 10 * np.sin(time_s)):
        with pytest.raises(TooShort):
            report(time_s, values + 1e-4 * np.random.default_rng(0).normal(size=2000))
    with pytest.raises(TooShort, match="does not change"):
        report(time_s, np.ones(2000))


def test_a_wander_as_long_as_the_record_is_told():
    time_s = np.arange(COUNT) / RATE_HZ
    for correlation, wanders in ((0.997, True), (0.9, False)):
        values = autoregression(np.random.default_rng(10), correlation)
        assert report(time_s, values, whole=True).wanders is wanders


def test_short_standstills_are_fitted_without_a_warning():
    """Their lowest frequency is above where the search for a memory begins."""
    rng = np.random.default_rng(3)
    level = np.repeat(np.arange(12.0), 30) + LEVEL * rng.normal(size=360)
    found = of(level).rms
    assert found.value == pytest.approx(LEVEL, rel=0.3)


def test_the_lines_of_each_stretch_take_freedom_from_the_size_of_the_noise():
    """Ten stretches of 64 readings, less three lines each: 70 of 640 degrees of freedom."""
    lines = [Line(hz, 0.1, 1.0, 0.1, 1000.0) for hz in (50.0, 120.0, 310.0, 7.0)]
    squares = []
    for seed in range(60):
        stretches = np.random.default_rng(seed).standard_normal((10, 64))
        quiet = [without_lines(own, lines, 1000.0) for own in stretches]
        squares.append(_level(quiet, lines, None, 0.0).value ** 2)
    # The line of 7 Hz is slower than a stretch lasts.
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * math.sqrt(2 / 570 / 60))
