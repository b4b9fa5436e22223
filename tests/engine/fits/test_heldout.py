"""Cross-validation: which samples are held out together, and what they tell."""

import dataclasses

import numpy as np
import pytest

from mopro.engine import Candidate, Parameter, Series
from mopro.engine.candidate import Role
from mopro.engine.fits import held_out, parts_of
from mopro.engine.residuals import Residuals
from mopro.engine.search.hypotheses import Hypotheses


def test_all_sensors_of_a_run_have_the_same_parts():
    parts = np.repeat([0, 1, 2], 20)
    one = Series("run", "force", "N", np.zeros(60), 1.0, folds=parts)
    other = Series("run", "speed", "m/s", np.zeros(60), 1.0, folds=parts[::-1])
    third = Series("next run", "force", "N", np.zeros(60), 1.0, folds=parts)
    masks = parts_of(Residuals(lambda _: [np.zeros(60)] * 3, [one, other, third]))
    assert len(masks) == 6
    together = [mask for mask in masks if mask[:120].any()]
    assert len(together) == 3
    assert all((mask[:60] == mask[60:120][::-1]).all() for mask in together)


@pytest.mark.parametrize("alike", [True, False])
def test_an_effect_in_a_single_move_is_predicted_from_the_rest_of_that_move(alike):
    """A ramp from 2.2 s to 2.6 s: the third move alone has information on its slope."""
    rng = np.random.default_rng(9)
    t = np.linspace(0.0, 3.0, 3000)
    grown = np.clip(t - 2.2, 0.0, 0.4)
    bent = np.where(t > 2.4, 2 * 0.2 - grown, grown)

    def model(settings):
        return [settings.get("growth", {"v": 0.0})["v"] * grown]

    values = (grown if alike else bent) + 0.01 * rng.standard_normal(len(t))
    series = Series("run", "probe", "V", values, 0.01, folds=np.minimum(t.astype(int), 2))
    residuals = Residuals(model, [series])
    growth = Candidate("growth", (Parameter("v", "V/s", -5.0, 5.0, (0.5,)),))
    hypotheses = Hypotheses(residuals, [growth])
    fit = hypotheses.fitted([growth], {"growth": {"v": 0.5}})
    held = held_out(
        residuals, hypotheses.evidence.noise, hypotheses.null, fit, {"growth": hypotheses.null}
    )
    assert held.supports("growth") is alike
    assert (held.after < 1.1) is alike


def test_parts_are_predicted_within_the_ranges_of_the_parameters():
    """Two of three moves tell a product of slope and zero only: the range of the zero ends it."""
    rng = np.random.default_rng(6)
    x = np.concatenate([20 + 0.0005 * rng.standard_normal(8000), np.full(4000, 24.0)])
    swing = np.sin(np.arange(len(x)))

    def model(settings):
        bend = settings.get("bend", {"slope": 0.0, "zero": 18.0})
        return [bend["slope"] * (x - bend["zero"]) * swing]

    (truth,) = model({"bend": {"slope": 0.02, "zero": 18.0}})
    values = truth + 0.01 * rng.standard_normal(len(x))
    series = Series("run", "probe", "V", values, 0.01, folds=np.repeat([0, 1, 2], 4000))
    residuals = Residuals(model, [series])
    slope, zero = Parameter("slope", "V/K", 0.0, 1.0), Parameter("zero", "K", 17.0, 19.0)
    bend = Candidate("bend", (slope, dataclasses.replace(zero, role=Role.SHAPE)))
    hypotheses = Hypotheses(residuals, [bend])
    fit = hypotheses.fitted([bend], {"bend": {"slope": 0.01, "zero": 18.5}})
    held = held_out(
        residuals, hypotheses.evidence.noise, hypotheses.null, fit, {"bend": hypotheses.null}
    )
    # A step that leaves the ranges predicts the last move worse than no effect does.
    assert held.after < held.before
    assert held.supports("bend")


def supported(share, sigmas, seed, freedom=1):
    """True if held-out parts support an effect of so many sigma, one part with a `share` of it.

    `freedom`: amplitudes of the effect, of which the first one is there; the others show in the
    last part.
    """
    rng = np.random.default_rng(seed)
    parts = np.repeat(np.arange(5), 200)
    shapes = rng.standard_normal((freedom, 1000))
    shapes[1:, parts < 4] *= 0.1
    for part in range(5):
        wanted = share if part == 2 else (1 - share) / 4
        shapes[0, parts == part] *= np.sqrt(wanted) / np.linalg.norm(shapes[0, parts == part])

    def model(settings):
        own = settings.get("bend", {f"a{n}": 0.0 for n in range(freedom)})
        return [np.array([own[f"a{n}"] for n in range(freedom)]) @ shapes]

    values = sigmas * shapes[0] + rng.standard_normal(1000)
    residuals = Residuals(model, [Series("run", "probe", "V", values, 1.0, folds=parts)])
    numbers = tuple(Parameter(f"a{n}", "V", -60.0, 60.0, (5.0,)) for n in range(freedom))
    bend = Candidate("bend", numbers)
    hypotheses = Hypotheses(residuals, [bend])
    fit = hypotheses.fitted([bend], {"bend": {p.name: 5.0 for p in numbers}})
    held = held_out(
        residuals, hypotheses.evidence.noise, hypotheses.null, fit, {"bend": hypotheses.null}
    )
    return held.supports("bend")


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 0.95, 0.99, 0.999])
def test_a_part_that_alone_tells_of_an_effect_has_no_veto(share):
    assert sum(supported(share, 12.0, seed) for seed in range(20)) >= 17


@pytest.mark.parametrize("share", [0.2, 0.8, 0.99])
def test_parts_do_not_support_what_is_not_there(share):
    assert sum(supported(share, 0.0, seed) for seed in range(40)) <= 8
    assert sum(supported(share, 0.0, seed, freedom=3) for seed in range(20)) <= 1


def of_runs(*sizes, shown=None):
    """What runs held out tell of a wave of these sizes, the first run four times as long.

    `shown`: the share of the wave that each run shows at all.
    """
    shown = shown or [1.0] * len(sizes)
    rng = np.random.default_rng(4)
    lengths = [800] + [200] * (len(sizes) - 1)
    waves = [
        share * np.sin(np.arange(length) / 7) for share, length in zip(shown, lengths, strict=True)
    ]

    def model(settings):
        size = settings.get("wave", {"a": 0.0})["a"]
        return [size * wave for wave in waves]

    data = [
        Series(
            f"run {nth}", "probe", "V", size * wave + 0.1 * rng.standard_normal(len(wave)), 0.1,
            folds=np.arange(len(wave)) // 100,
        )
        for nth, (size, wave) in enumerate(zip(sizes, waves, strict=True))
    ]  # fmt: skip
    residuals = Residuals(model, data)
    wave = Candidate("wave", (Parameter("a", "V", -9.0, 9.0, (1.0,)),))
    hypotheses = Hypotheses(residuals, [wave])
    fit = hypotheses.fitted([wave], {"wave": {"a": 1.0}})
    return held_out(
        residuals, hypotheses.evidence.noise, hypotheses.null, fit, {"wave": hypotheses.null}
    )


def test_an_accident_of_one_run_is_not_borne_out_by_its_own_parts():
    """Parts of the longer run predict each other, and the other run the contrary."""
    held = of_runs(1.0, -0.9)
    assert not held.supports("wave")
    assert held.on == "other runs"


def test_what_is_in_all_runs_is_borne_out_by_each_of_them():
    assert of_runs(1.0, 1.0).supports("wave")
    assert of_runs(1.0).on == "within one run"


def test_what_a_single_run_shows_is_borne_out_within_that_run():
    held = of_runs(1.0, 1.0, shown=[1.0, 0.0])
    assert held.supports("wave")
    assert held.on == "within one run"


@pytest.mark.parametrize(
    ("shown_in", "supports"), [((0,), False), ((2,), False), ((0, 1, 2), True)]
)
def test_a_wave_that_one_run_shows_is_not_one_of_the_machine(shown_in, supports):
    """Three runs that all could show a wave of 0.4 s: one that a single run has is its own."""
    rng = np.random.default_rng(11)
    t = np.arange(2000) / 500
    angle = 2 * np.pi * t / 0.4

    def model(settings):
        own = settings.get("wave", {"s": 0.0, "p": 0.4})
        return [own["s"] * np.sin(2 * np.pi * t / own["p"])] * 3

    data = [
        Series(
            f"run {i}", "probe", "V", (i in shown_in) * np.sin(angle) + rng.normal(size=2000), 1.0
        )
        for i in range(3)
    ]
    period = Parameter("p", "s", 0.1, 1.0, role=Role.SHAPE)
    wave = Candidate(
        "wave", (period, Parameter("s", "V", -3.0, 3.0)), flexible=True, of_run_time=True
    )
    hypotheses = Hypotheses(Residuals(model, data), [wave])
    fit = hypotheses.fitted([wave], {"wave": {"s": 0.4, "p": 0.4}})
    held = held_out(
        hypotheses.residuals, hypotheses.evidence.noise, hypotheses.null, fit,
        {"wave": hypotheses.null},
    )  # fmt: skip
    assert held.on == "other runs"
    assert held.supports("wave") is supports
