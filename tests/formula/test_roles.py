"""Roles of the parameters of a user's effect that states none."""

import pytest

from mopro.experiment.opened import experiment_file

EXPERIMENT = """\
machine = "axis"
[inputs]
force = {{ column = "force_N" }}
[[sensor]]
name = "scale"
quantity = "position"
column = "position_m"
noise_rms = "unknown"
[[run]]
data = "run.csv"
[[effect]]
name = "own"
enters = "force"
formula = "{formula}"
s = {{ unit = "N" }}
p = {{ unit = "{unit}"{role} }}
"""


def roles(folder, formula, unit="m", role=""):
    text = EXPERIMENT.format(formula=formula, unit=unit, role=role)
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    (folder / "run.csv").write_text("time_s,force_N,position_m\n0,0,0\n1,1,1\n", encoding="utf-8")
    (own,) = experiment_file(folder / "experiment.toml").entries.machine.effects
    return {p.name: p.role for p in own.parameters}


@pytest.mark.parametrize(
    ("formula", "unit", "role"),
    [
        ("s * sin(2 * pi * x / p)", "m", "period"),
        ("s * cos(2*pi*x/p) + s * sin(4*pi*x/p)", "m", "period"),
        ("s * sin(2 * pi * t / (2 * p))", "s", "period"),
        ("s * tanh(v / p)", "m/s", "shape"),
        ("s * exp(-(x / p)**2)", "m", "shape"),
        ("s * x / (abs(x) + p)", "m", "shape"),
        ("s / (1 + (v / p)**2) * sin(v / p)", "m/s", "shape"),
        ("s + p * x", "N/m", "amplitude"),
        ("s * (lag(x, p) - x) / max(abs(x), 1)", "s", "amplitude"),
        ("s * sin(x / p) + p * 0", "m", "amplitude"),
        ("s * x * p", "1/m", "amplitude"),
    ],
)
def test_a_parameter_that_only_divides_is_no_amplitude(tmp_path, formula, unit, role):
    assert roles(tmp_path, formula, unit) == {"s": "amplitude", "p": role}


@pytest.mark.parametrize("role", ["amplitude", "shape", "threshold"])
def test_a_role_that_is_stated_is_believed(tmp_path, role):
    found = roles(tmp_path, "s * sin(2 * pi * x / p)", role=f', role = "{role}"')
    assert found == {"s": "amplitude", "p": role}
