"""The language of formulas: what it has and refuses, its dimensions, its two evaluations."""

import math
from random import Random

import numpy as np
import pytest

from helpers.operations import values_by_operations
from mopro.engine.play import follow
from mopro.engine.swing import swing
from mopro.formula import FormulaError, UnitError, dimension_of_unit, factor_of, parse, product
from mopro.formula.bytecode import FIXED, MOVING, TIMED, Assembler
from mopro.formula.dimension import MOST_FACTORS, dimension_in
from mopro.formula.evaluate import evaluate
from mopro.formula.expressions import (
    MOST_CHARACTERS,
    check_names,
    substituted,
    without_products,
)

VALUES = {"x": -0.7, "y": 2.5, "z": 0.0}
FORMULAS = [
    "x + y * z - 3",
    "-x ** 2 + y ** 3 / 4 + y ** 0.5",
    "sin(x) + cos(y) * tan(x) - tanh(y) + sinh(x) + cosh(y)",
    "asin(x) + acos(x) + atan(y) + atan2(x, y)",
    "exp(x) + log(y) + sqrt(y) + abs(x) + sign(x) + sign(z)",
    "min(x, y, z) + max(x, y, z, 1)",
    "1 if x < 0 and not y > 3 else 2",
    "(x <= y) + (x >= y) + (x == y) + (x != y) + (x < 0 or y < 0)",
    "kelvin(x) + 2 * pi - +y",
]


def by_codes(text, values):
    """The value of a formula by the machine of operations, each name of another change."""
    changes = [(FIXED, TIMED, MOVING)[place % 3] for place in range(len(values))]
    (value,) = values_by_operations([parse(text)], values, changes)
    return value


@pytest.mark.parametrize("text", FORMULAS)
def test_both_evaluations_are_those_of_python(text):
    alike = ("sin", "cos", "tan", "tanh", "sinh", "cosh", "sqrt", "exp", "log")
    names = {name: getattr(np, name) for name in alike}
    names |= {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2}
    names |= {"sign": np.sign, "kelvin": lambda c: c + 273.15, "pi": np.pi}
    expected = eval(text, names, dict(VALUES))
    arrays = {name: np.full(3, value) for name, value in VALUES.items()}
    assert evaluate(parse(text), arrays, np.arange(3.0)) == pytest.approx(np.full(3, expected))
    assert by_codes(text, VALUES) == pytest.approx(expected)


@pytest.mark.parametrize("first", range(3))
def test_values_of_a_program_are_those_of_the_formulas_however_often_numbers_change(first):
    changes = [(FIXED, TIMED, MOVING)[(first + place) % 3] for place in range(len(VALUES))]
    found = values_by_operations([parse(text) for text in FORMULAS], VALUES, changes)
    assert found == [by_codes(text, VALUES) for text in FORMULAS]


def test_what_formulas_have_in_common_is_carried_out_once_and_what_is_fixed_beforehand():
    assembler = Assembler([FIXED, FIXED, MOVING])
    slots = {"c": 0, "m": 1, "v": 2}
    values = [
        assembler.value(parse(text), slots) for text in ("sin(v) * (c / m)", "c / m + sin(v)")
    ]
    fixed, timed, one, other = (last - first for first, last in assembler.program(values).segments)
    assert (fixed, timed, one, other) == (1, 0, 2, 1)


@pytest.mark.parametrize("text", ["1 / z", "log(z)", "sqrt(x)", "x ** 0.5", "y ** 1e9"])
def test_what_has_no_number_is_not_finite_and_raises_nothing(text):
    assert not np.isfinite(evaluate(parse(text), VALUES, np.zeros(2))).any()
    assert not np.isfinite(by_codes(text, VALUES))


@pytest.mark.parametrize(
    ("text", "words", "start"),
    [
        ("__import__('os').system('x')", "no function", 0),
        ("x.real", "a dot", 0),
        ("x[0]", "an index", 0),
        ("lambda: 1", "lambda", 0),
        ("1 +", "no formula", 0),
        ("2 * sin(1, 2)", "takes 1 argument, found 2", 4),
        ("side(x, 1, 2)", "side takes 1 or 2 arguments, found 3", 0),
        ("sin", "is a function", 0),
        ("x < y < z", "a chain", 0),
        ("'text'", "this value", 0),
        ("True", "this value", 0),
        ("x if True else y", "this value", 5),
        ("1e400", "too large", 0),
        ("max(x)", "two or more", 0),
        ("x := 3", "no formula", 2),
        ("(" * 60 + "x" + ")" * 60, "levels deep", 40),
        ("+".join("x" * 400), "characters", 0),
        ("sin(x=1)", "takes 1 argument", 0),
        ("[x for x in y]", "not of the language", 0),
    ],
)
def test_everything_else_is_refused_with_its_place(text, words, start):
    with pytest.raises(FormulaError, match=words) as caught:
        parse(text)
    assert caught.value.start == start


def test_a_long_chain_of_signs_is_refused_before_it_is_walked():
    with pytest.raises(FormulaError):
        parse("-" * (MOST_CHARACTERS - 1) + "x")


def test_an_unknown_name_is_told_with_the_nearest():
    with pytest.raises(FormulaError, match="did you mean load") as caught:
        check_names(parse("2 * lod"), {"load", "x"})
    assert (caught.value.start, caught.value.end) == (4, 7)


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("s * sin(x) + c * cos(x)", "s * sin(x)"),
        ("s * x + 2 * (c * x) + c", "s * x"),
        ("(c * x + s) * y", "s * y"),
        ("s * x - c * y", "s * x - c * y"),
        ("c", "0.0"),
    ],
)
def test_summands_with_a_factor_of_zero_are_left_out(text, left):
    made = without_products(parse(text), {"c"})
    names = {"s": 2.0, "x": 0.3, "y": 0.7, "c": 0.0}
    values = [evaluate(own, names, np.zeros(1)) for own in (made, parse(text))]
    assert (made.text, made.names) == (left, parse(left).names)
    assert values[0] == values[1]


def test_names_are_replaced_by_formulas():
    formula = substituted(parse("k * exchange"), {"exchange": parse("(b - T) + (c - T)")})
    assert formula.names == {"k", "b", "c", "T"}
    values = {"k": 2.0, "b": 3.0, "c": 4.0, "T": 1.0}
    assert evaluate(formula, values, np.zeros(1))[0] == 10.0


# -- units -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "same", "factor"),
    [
        ("N s2/m2", "kg/m", 1.0),
        ("mm/s", "m/s", 1e-3),
        ("W/(m K)", "kg m/(s3 K)", 1.0),
        ("1/s^2", "1/s2", 1.0),
        ("arcsec", "1", np.pi / 648000),
        ("V/A", "ohm", 1.0),
        ("K/s^0.5", "C/s^0.5", 1.0),
        ("N m/(rad/s)", "N m s", 1.0),
        ("N/(m/s)^2", "kg/m", 1.0),
        ("W/(m2 (K/h))", "W h/(m2 K)", 1.0),
        ("N/m/s", "N/(m s)", 1.0),
        ("V/krpm", "V s/rad", 60 / (2000 * np.pi)),
        ("Nm/A", "N m/A", 1.0),
        ("kgm²", "kg m2", 1.0),
        ("m⋅s⁻²", "m/s2", 1.0),
        ("kΩ", "ohm", 1e3),
        ("°C/sec", "K/s", 1.0),
        ("counts/µs", "count/us", 1.0),
    ],
)
def test_units_have_dimensions_and_factors(unit, same, factor):
    assert dimension_of_unit(unit) == dimension_of_unit(same)
    assert factor_of(unit) == pytest.approx(factor * factor_of(same))


@pytest.mark.parametrize(
    "unit",
    ["furlong", "N**2", "", "m//s", "s" * 100, "%9999", "m^25", "h24 s", "m٣", "()", "N)", "(N",
     "N/", "(N/(m)", "N/()"],
)  # fmt: skip
def test_what_is_no_unit_is_refused(unit):
    with pytest.raises(UnitError):
        dimension_of_unit(unit)


def test_a_unit_in_another_case_is_asked_for():
    with pytest.raises(UnitError, match=r"'Rpm' in 'V/Rpm' is no unit; did you mean rpm\?"):
        dimension_of_unit("V/Rpm")


SIZES = [("mm", 1e-3), ("ms", 1e-3), ("lbf", 4.4482216152605), ("h", 3600.0), ("1", 1.0)]


def made_unit(rng, depth=0):
    """A unit with brackets, its size in SI, and the exponents of its symbols in all."""
    above, below = ([_part(rng, depth) for _ in range(rng.randint(*n))] for n in ((1, 2), (0, 2)))
    text = " ".join(own for own, *_ in above) + "".join(f"/{own}" for own, *_ in below)
    size = math.prod(size for _, size, _ in above) / math.prod(size for _, size, _ in below)
    return text, size, sum(exponents for *_, exponents in above + below)


def _part(rng, depth):
    text, size, exponents = *rng.choice(SIZES), 1
    if depth < 2 and rng.random() < 0.4:
        text, size, exponents = made_unit(rng, depth + 1)
        text = f"({text})"
    power = rng.choice([1, 1, 2, -1])
    return (text if power == 1 else f"{text}^{power}"), size**power, exponents * abs(power)


def test_brackets_in_units_hold_together_what_stands_in_them():
    rng, tried = Random(5), 0
    while tried < 300:
        text, size, exponents = made_unit(rng)
        if len(text) <= 60 and "(" in text and exponents <= MOST_FACTORS:
            assert math.isclose(factor_of(text), size, rel_tol=1e-9), text
            tried += 1


def test_products_of_units_are_simplified():
    assert product("rad/s2", "s/rad") == "1/s"
    assert product("N", "s/m") == "N s/m"
    assert product("rad/s2", "s/rad", "s/rad") == "1/rad"


NAMES = {
    "x": dimension_of_unit("m"),
    "v": dimension_of_unit("m/s"),
    "t": dimension_of_unit("s"),
    "F": dimension_of_unit("N"),
    "b": dimension_of_unit("N s/m"),
    "T": dimension_of_unit("K"),
}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("-b * v", "N"),
        ("F * exp(-(v / max(v, 0))**2)", "N"),
        ("sqrt(x**2 + (v * t)**2)", "m"),
        ("lag(F, t) - F", "N"),
        ("rate(x)", "m/s"),
        ("kelvin(T)**4", "K4"),
        ("F if v > 0 else -F", "N"),
        ("sin(2 * pi * x / x) * F", "N"),
        ("play(x, x) + presliding(v, v) * x", "m"),
    ],
)
def test_the_dimension_of_a_formula_follows_from_its_names(text, unit):
    assert dimension_in(parse(text), NAMES) == dimension_of_unit(unit)


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("x + v", 4),
        ("F + sin(x)", 8),
        ("x > 3", 4),
        ("lag(x, x)", 7),
        ("kelvin(x)", 7),
        ("x if v > 0 else v", 16),
        ("2 ** x", 5),
        ("min(x, t)", 7),
    ],
)
def test_units_that_do_not_match_are_told_at_their_place(text, start):
    with pytest.raises(FormulaError) as caught:
        dimension_in(parse(text), NAMES)
    assert caught.value.start == start


# -- signals -----------------------------------------------------------------------------

T = np.array([0.0, 0.1, 0.3, 0.4, 0.8, 1.0, 1.5])


def test_a_lag_of_a_ramp_at_irregular_times_is_exact():
    tau = 0.2
    expected = T - tau * (1 - np.exp(-T / tau))
    assert evaluate(parse("lag(t, 0.2)"), {"t": T}, T) == pytest.approx(expected)


def test_a_play_follows_at_half_its_width():
    x = np.array([0.0, 1.0, 2.0, 1.5, 1.0, 0.0, -1.0])
    assert evaluate(parse("play(x, 1)"), {"x": x}, T).tolist() == [0, 0.5, 1.5, 1.5, 1.5, 0.5, -0.5]
    behind = evaluate(parse("play(x, 1, -1)"), {"x": x}, T)
    assert behind.tolist() == [-0.5, 0.5, 1.5, 1.5, 1.5, 0.5, -0.5]
    ahead = evaluate(parse("play(x, 4, 1)"), {"x": x}, T)
    assert ahead.tolist() == [2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0]
    down = evaluate(parse("play(-x, 1, -1)"), {"x": x}, T)
    assert down.tolist() == (-behind).tolist()
    assert evaluate(parse("play(x, 1, -1)"), {"x": np.zeros(7)}, T).tolist() == [0] * 7


@pytest.mark.parametrize("width", [-1.0, 0.0, 0.3, 50.0])
def test_a_play_is_the_same_in_a_formula_and_in_an_effect(width):
    x = np.cumsum(np.random.default_rng(3).standard_normal(25_000))
    at, expected = x[0], []
    for place in x:
        at = min(max(at, place - max(width, 0.0) / 2), place + max(width, 0.0) / 2)
        expected.append(at)
    time_s = np.arange(len(x)) * 1e-3
    for size in (0, 1, 300, len(x)):
        named = {"x": x[:size], "w": np.float64(width)}
        played = evaluate(parse("play(x, w)"), named, time_s[:size])
        assert played.tolist() == expected[:size]
        assert follow(x[:size], max(width, 0.0) / 2).tolist() == expected[:size]


def test_a_swing_is_that_of_the_drafts_and_has_no_value_where_none_swings():
    t = np.linspace(0, 2, 400)
    names = {"a": np.sin(5 * t), "f": 3.0, "zeta": 0.1}
    formula = parse("swing(a, f, zeta)")
    assert evaluate(formula, names, t) == pytest.approx(swing(t, names["a"], 3.0, 0.1))
    for wrong in ({"f": 0.0}, {"f": -1.0}, {"zeta": 1.0}, {"zeta": -0.1}, {"f": np.nan}):
        assert np.isnan(evaluate(formula, names | wrong, t)).all()
    units = {name: dimension_of_unit(u) for name, u in (("a", "m/s2"), ("f", "Hz"), ("zeta", "1"))}
    assert dimension_in(formula, units) == dimension_of_unit("m/s2")
    with pytest.raises(FormulaError):
        dimension_in(formula, units | {"f": dimension_of_unit("s")})


def test_signals_of_a_log():
    x = np.array([0.0, 5.0, 5.0, 0.1, 0.1, -5.0, -5.0])
    named = {"x": x}
    assert evaluate(parse("side(x)"), named, T).tolist() == [0, 1, 1, 1, 1, -1, -1]
    assert evaluate(parse("side(x, 0.01)"), named, T).tolist() == [0, 1, 1, 1, 1, -1, -1]
    assert evaluate(parse("side(-x, 0.01)"), named, T).tolist() == [0, -1, -1, -1, -1, 1, 1]
    small = {"x": np.array([1.0, -0.3, 0.3, -0.6, 0.0, 0.6, -1.0])}
    assert evaluate(parse("side(x, 0.5)"), small, T).tolist() == [1, 1, 1, -1, -1, 1, -1]
    assert evaluate(parse("before(x)"), named, T) == pytest.approx([0, 0, 5, 10, 10.1, 10.2, 5.2])
    changed = evaluate(parse("since_change(x)"), named, T)
    assert changed == pytest.approx([0, 0, 0.2, 0, 0.4, 0, 0.5])
    assert evaluate(parse("presliding(x, 5)"), named, T)[1:4] == pytest.approx([1, 1, 0.02])
    assert evaluate(parse("delayed(t, 0.1)"), {"t": T}, T)[2:4] == pytest.approx([0.2, 0.3])
    assert evaluate(parse("first(t) + rate(t)"), {"t": T}, T) == pytest.approx(np.ones(7))


@pytest.mark.parametrize("constant", ["1e30 ** 10", "10.0 ** 308", "9 ** 400"])
def test_a_lag_of_any_constant_is_finite(constant):
    """Of 1e308 s it was a division by zero."""
    time_s = np.linspace(0.0, 1e-20, 5)
    found = evaluate(parse(f"lag(x, {constant})"), {"x": time_s + 1.0}, time_s)
    assert found.tolist() == [1.0] * 5
