"""Numbers and calls of any form, in every place that takes a formula."""

from random import Random

import numpy as np
import pytest

from helpers.fuzzing.made import formula as made_formula
from helpers.fuzzing.made import number as made_number
from helpers.operations import values_by_operations
from mopro.formula import FormulaError, dimension_of_unit, parse
from mopro.formula.bytecode import FIXED
from mopro.formula.dimension import dimension_in
from mopro.formula.evaluate import evaluate

LONG = "1" * 310
TOO_LARGE = [LONG, "1" * 490, "0x" + "f" * 300, "0b" + "1" * 400, "0o" + "7" * 300, "1_0" * 100,
             "1e31", "1e999", "1" * 310 + ".0"]  # fmt: skip
NAMES = ("x", "v", "t", "T", "u", "A", "command", "motor")


@pytest.mark.parametrize("number", TOO_LARGE, ids=lambda text: f"{text[:6]}, {len(text)}")
def test_a_number_beyond_the_largest_is_refused_at_its_place(number):
    with pytest.raises(FormulaError, match=r"too large, expected one of at most 1e\+30") as caught:
        parse(f"2 * {number}")
    assert (caught.value.start, caught.value.end) == (4, 4 + len(number))


@pytest.mark.parametrize("number", ["1" + "0" * 30, "0x" + "f" * 24, "1e30", "0." + "1" * 400])
def test_a_long_number_within_the_largest_is_one(number):
    assert np.isfinite(evaluate(parse(number), {}, np.zeros(1))[0])


def test_powers_of_powers_have_no_unit():
    with pytest.raises(FormulaError, match="unit to a power of more than 1000"):
        dimension_in(parse("(" * 12 + "x ** 0.142857142857" + ") ** 1e30" * 12 + " + x"), METRES)
    with pytest.raises(FormulaError, match="unit to a power"):
        dimension_in(parse("(sqrt(x) ** 1001) ** 1000 + x"), METRES)
    assert dimension_in(parse("(x ** 500) ** -2"), METRES)[0] == -1000


METRES = {"x": dimension_of_unit("m")}


@pytest.mark.parametrize("seed", range(8))
def test_made_formulas_are_refused_or_have_a_value(seed):
    random, taken = Random(seed), 0
    for _ in range(150):
        text = random.choice((made_formula, made_number))(random)
        try:
            formula = parse(text)
            dimension_in(formula, METRES)
        except FormulaError:
            continue
        taken += 1
        values = {name: np.linspace(-1.0, 1.0, 5) for name in formula.names}
        assert evaluate(formula, values, np.arange(5.0)).shape == (5,)
        if not formula.of_signals:
            by_codes(formula)
    assert taken > 10


def by_codes(formula):
    values = dict.fromkeys(formula.names, 0.5)
    (value,) = values_by_operations([formula], values, [FIXED] * len(values))
    return value


# -- every place that takes a formula ----------------------------------------------------

DATA = "time_s,u,T_C,x_mm\n" + "".join(
    f"{n / 10},{n % 7},{20 + n / 50},{n / 5}\n" for n in range(60)
)
READ = """[[sensor]]
name = "s"
quantity = "{}"
column = "{}"
noise_rms = 0.1
[[run]]
data = "data.csv"
"""
PLACED = READ.format("position", "x_mm")
KINEMATIC = 'machine = "kinematic"\n[inputs]\ncommand = { column = "u", unit = "mm" }\n' + PLACED
OF_AXIS = 'machine = "m.toml"\n[inputs]\nforce = { column = "u", unit = "N" }\n' + PLACED
AXIS = 'kind = "axis"\nname = "a"\nunit = "mm"\n[base]\nmass = { value = 1, unit = "kg" }\n'
HEATED = 'machine = "m.toml"\n[inputs]\nduty = { column = "u", unit = "1" }\n' + READ.format(
    "temperature", "T_C"
)
HEATER = 'kind = "thermal"\nname = "h"\n[base]\na = { value = 1, unit = "K/s" }\n[nodes]\n'
EFFECT = """[[effect]]
name = "mine"
enters = "{}"
formula = "F"
A = {{ unit = "{}", range = [-1, 1] }}
"""
SIZED = EFFECT.format("command", "m").replace('"F"', '"A"')


def motor(entered, unit):
    return {"m.toml": 'extends = "chow1992"\n' + EFFECT.format(entered, unit)}


PLACES = {
    **{f"motor, {e}": motor(e, u)
       for e, u in (("force", "N"), ("friction", "N"), ("command", "m"), ("measurement", "m"))},
    "motor, experiment": {"e.toml": EFFECT.format("force", "N") + (
        '[[sensor]]\nname = "s"\nquantity = "position"\naxis = 1\ncolumn = "x_mm"\n'
        'rate_hz = 10.0\nnoise_rms = 0.1\n[[run]]\nprogram = "P.CMD"\ndata = "data.csv"\n')},
    "input": {"e.toml": KINEMATIC.replace('column = "u"', 'formula = "F"')},
    "use": {"e.toml": KINEMATIC + 'use = "F"\n'},
    "reads": {"e.toml": KINEMATIC.replace("noise_rms", 'reads = "F"\nnoise_rms')},
    "kinematic, effect": {"e.toml": KINEMATIC + EFFECT.format("command", "m")},
    "range": {"e.toml": KINEMATIC + SIZED.replace("[-1,", '["F",')},
    "start": {"e.toml": KINEMATIC + SIZED.replace("range = [-1, 1]", 'start = "F"')},
    "kinematic, law": {"e.toml": KINEMATIC.replace('"kinematic"', '"m.toml"'),
                       "m.toml": 'kind = "kinematic"\nname = "k"\nposition = "F"\n'},
    "axis, law": {"e.toml": OF_AXIS, "m.toml": AXIS.replace("unit", 'acceleration = "F"\nunit', 1)},
    "axis, friction": {"e.toml": OF_AXIS + EFFECT.format("friction", "N"), "m.toml": AXIS},
    "thermal, law": {"e.toml": HEATED, "m.toml": HEATER + 's = "F"\n'},
    "thermal, effect": {"e.toml": HEATED + EFFECT.format("power", "K/s"),
                        "m.toml": HEATER + 's = "a * duty"\n'},
}  # fmt: skip


def written(folder, files, formula):
    (folder / "data.csv").write_text(DATA)
    for name, text in files.items():
        (folder / name).write_text(text.replace('"F"', f'"{formula}"'))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("formula", [f"1e0 * {LONG} * x", f"x ** 0x{'f' * 300}", "sin(1, 2)"])
def test_each_place_of_a_formula_refuses_it_with_its_place(tmp_path, mopro, place, formula):
    files = PLACES[place]
    written(tmp_path, files, formula)
    args = (
        ("compare", "e.toml")
        if "e.toml" in files
        else ("run", "P.CMD", "--emulate", "--machine", "m.toml")
    )
    done = mopro(*args, text="UU012500/1\nVEL0 1.0\nACC0 1.0\nMR1 1.0\nWX1\n")
    assert done.returncode == 2
    assert "[bad-formula]" in done.stderr
    file = next(name for name, text in files.items() if '"F"' in text)
    line = next(n for n, own in enumerate(files[file].splitlines(), 1) if '"F"' in own)
    assert f"{file}:{line}:" in done.stderr


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ('range = ["-nothing", 1]', "unknown name nothing: known are"),
        ('range = [-1, "1 / 0"]', "no finite number"),
        ('start = "length * 1e-999"', "cannot start at 0"),
        ("start = 0", "cannot start at 0"),
        ('start = "log(-1)"', "no finite number"),
    ],
)
def test_a_size_that_is_no_number_is_refused_with_its_place(tmp_path, mopro, stated, words):
    files = {"e.toml": KINEMATIC + SIZED.replace("range = [-1, 1]", stated)}
    written(tmp_path, files, "")
    done = mopro("reconcile", "e.toml")
    assert done.returncode == 2
    assert words in done.stderr
    assert "e.toml:15:" in done.stderr


def test_a_range_whose_middle_is_nearly_zero_can_be_searched(tmp_path, mopro):
    written(tmp_path, {"e.toml": KINEMATIC + SIZED.replace("[-1, 1]", "[-11, 9]")}, "")
    done = mopro("reconcile", "e.toml")
    assert done.returncode in (0, 1)


@pytest.mark.parametrize("law", ["before(x)", "command + v", "a"])
def test_the_law_of_a_place_cannot_refer_to_it(tmp_path, mopro, law):
    written(tmp_path, PLACES["kinematic, law"], law)
    done = mopro("compare", "e.toml")
    assert done.returncode == 2
    assert "unknown name" in done.stderr
    assert "m.toml:3:" in done.stderr


@pytest.mark.parametrize("value", ["1 / 0", "9**9**9", "exp(1e9)", "log(-1)", "sqrt(-1)", "0**-1"])
@pytest.mark.parametrize("entered", ["force", "friction"])
def test_a_term_without_a_value_at_rest_is_a_finding(tmp_path, mopro, entered, value):
    on = "[effects.mine]\nA = 1.0\n"
    written(tmp_path, {"m.toml": motor(entered, "N")["m.toml"] + on}, f"A * {value}")
    done = mopro("machine", "check", "m.toml")
    assert done.returncode == 1
    assert "a trial move of one pitch fails" in done.stdout + done.stderr
