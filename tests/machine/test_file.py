"""Machine files: units, provenance, and every fault at its line."""

import math
from importlib import resources

import pytest

from mopro.errors import ModelError
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.source import Source

TEXT = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()


def faults(text):
    with pytest.raises(ModelError) as caught:
        read_machine(Source("m.toml", text))
    found = caught.value.diagnostics
    lines = text.splitlines()
    return [(d.rule, lines[d.span.line - 1].split()[0] if lines else "") for d in found]


def test_the_nominal_machine():
    machine = load_machine("chow1992")
    axis = machine.axis
    assert axis.pitch_m == pytest.approx(1.016e-3, rel=1e-15)
    assert machine.microstep_m == pytest.approx(2.032e-6, rel=1e-15)
    frequency = math.sqrt(axis.stiffness_N_m / axis.moving_mass_kg) / (2 * math.pi)
    assert frequency == pytest.approx(82.69, abs=5e-3)
    assert (machine.heat.rated_C, machine.platen.length_m) == (110.0, pytest.approx(1.3208))


def test_every_value_says_where_it_comes_from():
    machine = load_machine("chow1992")
    quantities = TEXT.count("value =")
    assert len(machine.provenance) == quantities
    assert machine.provenance["axis.moving_mass"].origin == "thesis"
    assert machine.provenance["axis.pull_out_force"].origin == "assumed"


def test_a_number_may_have_a_tolerance():
    text = TEXT.replace("value = 0.03,", "value = 0.03, tolerance = 0.5,")
    machine = read_machine(Source("m", text))
    assert machine.provenance["axis.damping_ratio"].tolerance == 0.5
    assert machine.provenance["axis.pull_out_force"].tolerance == 0.0
    assert machine == load_machine("chow1992")


def test_units_are_converted():
    text = TEXT.replace('value = 0.040, unit = "in"', 'value = 1.016, unit = "mm"')
    assert read_machine(Source("m", text)).axis.pitch_m == pytest.approx(1.016e-3, rel=1e-15)
    text = TEXT.replace('value = 111.0, unit = "N"', 'value = 25, unit = "lbf"')
    assert read_machine(Source("m", text)).axis.pull_out_force_N == pytest.approx(111.2, abs=0.01)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('value = 0.040, unit = "in"', 'value = 0.040, unit = "kg"', ("wrong-unit", "pitch")),
        ('value = 0.040, unit = "in"', 'value = 0.040, unit = "furlong"', ("wrong-unit", "pitch")),
        ('value = 0.040, unit = "in"', 'value = "x", unit = "in"', ("bad-value", "pitch")),
        ('value = 0.040, unit = "in"', 'value = -1, unit = "in"', ("bad-value", "pitch")),
        ('value = 0.040, unit = "in"', 'value = nan, unit = "in"', ("bad-value", "pitch")),
        ('value = 0.040, unit = "in"', 'value = true, unit = "in"', ("bad-value", "pitch")),
        ('"in", origin = "thesis", place = "2.1, 4.1"', '"in", source = "x", origin = "thesis"',
         ("unknown-key", "pitch")),
        ('unit = "in", origin = "thesis"', 'unit = "in", origin = "dream"',
         ("missing-origin", "pitch")),
        ("value = 0.040,", "value = 0.040, tolerance = 0.1,", ("unknown-key", "pitch")),
        ("value = 111.0,", "value = 111.0, tolerance = 1.5,", ("bad-value", "pull_out_force")),
        ("value = 111.0,", 'value = 111.0, tolerance = "5 %",', ("bad-value", "pull_out_force")),
        ("value = 111.0,", "value = 111.0, tolerance = nan,", ("bad-value", "pull_out_force")),
        ("damping_ratio =", "dampign_ratio =", ("unknown-key", "dampign_ratio")),
        ("[platen]", "[plate]", ("unknown-key", "[plate]")),
        ('name = "chow1992"', "name = 5", ("missing-key", "name")),
        ("[axis]", "[axis", ("bad-toml", "[axis")),
    ],
)  # fmt: skip
def test_faults_stand_at_their_line(old, new, expected):
    assert old in TEXT
    assert expected in faults(TEXT.replace(old, new, 1))


def test_all_faults_come_at_once_with_suggestions():
    text = TEXT.replace("damping_ratio =", "dampign_ratio =").replace('unit = "kg"', 'unit = "m"')
    with pytest.raises(ModelError) as caught:
        read_machine(Source("m.toml", text))
    rules = {d.rule for d in caught.value.diagnostics}
    assert rules == {"unknown-key", "missing-key", "wrong-unit"}
    assert "did you mean `damping_ratio`?" in str(caught.value)


def test_an_unknown_name_lists_the_known_ones(tmp_path):
    with pytest.raises(ModelError, match="built in: chow1992"):
        load_machine("chow1993")
    binary = tmp_path / "m.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="not UTF-8"):
        load_machine(str(binary))
    with pytest.raises(ModelError):
        read_machine(Source("empty", ""))
