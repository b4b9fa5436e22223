"""Columns of the sizes of a term: what forms share is what each of them has by itself."""

import dataclasses

import numpy as np
import pytest

from mopro.formula.angles import Angles
from mopro.formula.columns import Columns, Sampled
from mopro.formula.evaluate import evaluate, over_grid
from mopro.formula.expressions import factor_beside, parse
from mopro.formula.written import MEASUREMENT, EffectParameter, Written, WrittenEffect

ROWS = 50
RNG = np.random.default_rng(7)
TIME_S = np.arange(2.0 * ROWS) / 10
NAMES = {"x": RNG.uniform(-30.0, 30.0, 2 * ROWS), "t": TIME_S, "k": 1.7}
PERIODS = np.linspace(3.0, 40.0, 300)


def effect(text, *sizes, unit="mm", shape="P"):
    made = [EffectParameter(name, unit) for name in sizes]
    made.append(EffectParameter(shape, "mm", "period"))
    return WrittenEffect("wave", MEASUREMENT, "", Written.of(text), tuple(made))


PLAIN = effect("s * sin(2*pi*x/P) + c * cos(2*pi*x/P)", "s", "c")
SECOND = effect("s*sin(2*pi*x/P) + c*cos(2*pi*x/P) + d * sin(4*pi*x/P)", "s", "c", "d")


def sampled(**changes):
    made = Sampled(
        NAMES, TIME_S, np.arange(0, 2 * ROWS, 2), RNG.standard_normal(ROWS), 0.2, 3.0, False
    )
    return dataclasses.replace(made, **changes)


def directly(form, size, period, own):
    """The whitened column of one size at a period (mm), from the whole formula."""
    sizes = {p.name: p.factor * (p.name == size) for p in form.parameters}
    known = {**own.names, **sizes, "P": period * 1e-3}
    term = evaluate(form.term.formula, known, own.time_s)[own.rows] * own.factor
    return np.nan_to_num((term - term.mean() if own.is_aligned else term) / own.sigma)


@pytest.mark.parametrize("form", [
    PLAIN, SECOND, effect("s * (x + c) * exp(-t/P) + c * t**2", "s", "c"),
    effect("s * lag(x, P) + c * sin(2*pi*x/P)", "s", "c"),
    effect("s * sqrt(x) + c * cos(2*pi*x/P) + d / (x - x)", "s", "c", "d"),
])  # fmt: skip
@pytest.mark.parametrize("is_aligned", [False, True])
def test_sums_are_those_of_the_whole_formula(form, is_aligned):
    every = [sampled(is_aligned=is_aligned), sampled(factor=0.0), sampled(sigma=0.5, factor=-1.0)]
    columns = Columns([SECOND, form])
    gram, product = columns.sums({"P": PERIODS}, every)
    own, left = columns.places(form), np.concatenate([s.residual for s in every])
    for at in (0, 137, 299):
        expected = np.array([
            np.concatenate([directly(form, p.name, PERIODS[at], s) for s in every])
            for p in form.parameters[:-1]
        ])  # fmt: skip
        scale = np.abs(expected @ expected.T).max()
        assert gram[at][np.ix_(own, own)] == pytest.approx(expected @ expected.T, abs=1e-12 * scale)
        assert product[at, own] == pytest.approx(expected @ left, abs=1e-12 * scale**0.5 * ROWS)


def test_forms_have_the_columns_of_the_same_term_in_common():
    columns = Columns([PLAIN, SECOND])
    assert columns.places(PLAIN) == columns.places(SECOND)[:2]
    assert columns.sums({"P": PERIODS}, [sampled()])[0].shape == (300, 3, 3)


def test_sums_are_kept_for_the_same_contents_alone():
    columns, first = Columns([PLAIN]), sampled()
    kept = columns.sums({"P": PERIODS}, [first])
    copied = dataclasses.replace(first, names={n: np.copy(v) for n, v in NAMES.items()})
    assert columns.sums({"P": PERIODS.copy()}, [copied]) is kept
    first.residual[3] += 1.0
    assert np.abs(columns.sums({"P": PERIODS}, [first])[1] - kept[1]).max() > 0.01
    moved = dataclasses.replace(first, names={**NAMES, "x": NAMES["x"] + 1.0})
    assert np.abs(columns.sums({"P": PERIODS}, [moved])[0] - kept[0]).max() > 1e-3


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("sin(2*pi*x/P) + cos(16*pi*x/P) - cos(6*pi*x/P)", {"1 * pi * x / P": 8}),
        ("sin(2*x) * cos(3*x) + sin(6*x)", {"1 * x": 3}),
        ("sin(2*x) + sin(2*t) + cos(x) + sin(x + 2)", {"1 * x": 1, "1 * t": 1}),
        ("exp(sin(0.1*x)) + sin(cos(2*x))", {"1 * x": 1}),
        ("lag(sin(2*x), 1) + sin(2*x)", {}),
    ],
)
def test_multiples_of_an_angle_are_worked_out_from_it(text, angles):
    formula, names = parse(text), {**NAMES, "P": 7.0}
    made = Angles.of([formula])
    assert made.orders == angles
    if angles:
        found = over_grid(made.formulas[0], {**names, **made.values(names)})
        assert found == pytest.approx(evaluate(formula, names, TIME_S), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "left"), [("s * (x + 2)", "x + 2"), ("x * s", None), ("s * x + c", None), ("s", None)]
)
def test_what_a_name_is_multiplied_by(text, left):
    found = factor_beside(parse(text), "s")
    assert (found and found.text) == left
