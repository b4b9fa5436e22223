"""Readings of a converter coarser than the noise: its rounding is neither noise nor a wave."""

import numpy as np
import pytest

from helpers.stated import DRIVE, DRIVEN, driven, write
from mopro.experiment.opened import open_experiment

RNG = np.random.default_rng
STEP = 0.0015
TEXT = """\
machine = "kinematic"
[inputs]
command = {{ column = "target_rad" }}
[[sensor]]
name = "encoder"
quantity = "angle"
column = "angle_rad"
adc_step = 0.0015
noise_rms = {noise}
"""


def slow(seed):
    """Times (s) and targets (rad) of a motion that takes many samples from count to count."""
    t = np.arange(0, 40, 0.02)
    return t, np.interp(t, np.linspace(0, 40, 9), RNG(seed).uniform(-0.08, 0.08, 9))


def stops(seed):
    """As `slow`, six places and a rest at each."""
    t, places = np.arange(0, 60, 0.05), np.repeat(RNG(seed).uniform(-0.3, 0.3, 6), 2)
    return t, np.interp(t, np.sort(np.r_[10 * np.arange(6), 10 * np.arange(6) + 9.5]), places)


def to_and_fro():
    t = np.arange(0, 60, 0.05)
    return t, 0.06 * (2 * np.abs(t / 15 % 2 - 1) - 1)


def verdict_of(folder, noise, moved=lambda t, x: x, runs=1, seed=1):
    motions = [slow(seed + nth) for nth in range(runs)]
    return verdict_on(folder, noise, motions, [moved] * runs, seed)


def verdict_on(folder, noise, motions, moved, seed):
    text = TEXT.format(noise=noise)
    for nth, ((t, x), own) in enumerate(zip(motions, moved, strict=True)):
        read = STEP * np.rint((own(t, x) + 1e-4 * RNG(seed + nth).standard_normal(len(t))) / STEP)
        write(folder / f"{nth}.csv", {"time_s": t, "target_rad": x, "angle_rad": read})
        text += f'[[run]]\ndata = "{nth}.csv"\n'
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return open_experiment(folder / "experiment.toml").conclude().verdict


@pytest.mark.parametrize("noise", ['"unknown"', "1e-4"])
@pytest.mark.parametrize("seed", [1, 2])
def test_rounding_is_no_disagreement(tmp_path, noise, seed):
    verdict = verdict_of(tmp_path, noise, seed=seed)
    assert (verdict.verdict, verdict.effects, verdict.drafts) == ("none", (), ())


def late(t, x):
    return np.interp(t - 0.08, t, x)


@pytest.mark.parametrize("noise", ['"unknown"', "1e-4"])
def test_what_is_there_is_named_alone(tmp_path, noise):
    verdict = verdict_of(tmp_path, noise, late, runs=2)
    (effect,) = verdict.effects
    assert "delay" in (effect.name, *effect.indistinguishable_from)


def loose(t, x):
    """Behind a play of ten counts."""
    found, place = np.empty_like(x), x[0]
    for i, target in enumerate(x):
        found[i] = place = min(max(place, target - 5 * STEP), target + 5 * STEP)
    return found


@pytest.mark.parametrize(("counts", "seed"), [(0.7, 1), (1.4, 2), (2.8, 1)])
def test_a_wave_in_the_time_of_one_run_is_none_of_the_machine(tmp_path, counts, seed):
    """The other run rests most of the time, where its readings count once: it shows no wave."""

    def waving(t, x):
        return loose(t, x) + counts * STEP * np.sin(2 * np.pi * t / 0.9)

    motions = [stops(seed), to_and_fro()]
    verdict = verdict_on(tmp_path, '"unknown"', motions, [loose, waving], seed)
    assert [effect.name for effect in verdict.effects if effect.run is None] == ["backlash"]


def test_no_period_below_two_counts_is_named(tmp_path):
    verdict = verdict_of(tmp_path, "1e-3", seed=3)
    periods = [e.parameters["P"].value for e in verdict.effects if "P" in e.parameters]
    assert all(period >= 2 * STEP for period in periods)


def test_no_draft_is_of_a_period_below_two_counts(tmp_path):
    """A ripple of half a count, as the dither of a coarse converter may look by chance."""
    verdict = verdict_of(
        tmp_path, "1e-4", lambda t, x: x + 0.4 * STEP * np.sin(2 * np.pi * x / (STEP / 2)), seed=1
    )
    assert not [draft for draft in verdict.drafts if draft.of == "x mod"]
    assert "with a period of 0.0007" not in str(verdict.remainder.description)


@pytest.mark.parametrize("noise", ['"unknown"', "0.1"])
@pytest.mark.parametrize("cogging", [0.8, 0.0])
def test_cogging_is_named_with_its_period_under_a_coarse_encoder(tmp_path, noise, cogging):
    """It moves the axis by ten steps."""
    step, columns = 1.2, driven(5.0, seed=3, cogging=cogging, pitch=0.06, noise=0.1)
    columns["position_mm"] = step * np.rint(columns["position_mm"] / step)
    write(tmp_path / "run.csv", columns)
    (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
    stated = f"adc_step = {step}\nnoise_rms = {noise}"
    text = DRIVEN.replace("noise_rms = 0.2", stated)
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    if not cogging:
        assert (verdict.verdict, verdict.effects) == ("none", ())
        return
    (effect,) = verdict.effects
    low, high = effect.parameters["P"].ci95
    assert (verdict.verdict, effect.name) == ("named", "cogging")
    assert low < 0.06 < high < 1.01 * low
