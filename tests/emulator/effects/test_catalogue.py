"""The catalogue itself: names, documents, kernels of their own, effects from outside."""

import inspect
import os
import subprocess
import sys
from importlib.metadata import distributions

import numpy as np
import pytest
from paths import PROGRAMS

import mopro
from mopro.emulator.effects import Active, catalogue
from mopro.emulator.effects.document import markdown
from mopro.errors import ModelError

NAMES = [
    "payload_mass",
    "viscous_drag",
    "quadratic_drag",
    "coulomb_friction",
    "umbilical_spring",
    "constant_force",
    "electrical_damping",
    "force_constant",
    "force_constant_temperature",
    "detent_force",
    "phase_gain_imbalance",
    "quadrature_error",
    "phase_current_offset",
    "current_third_harmonic",
    "current_loop_lag",
    "voltage_saturation",
    "hold_current_reduction",
    "acceleration_scale",
    "velocity_scale",
    "profile_tick",
    "controller_clock",
    "start_delay",
    "lost_steps",
    "pitch_scale",
    "platen_expansion",
    "backlash",
    "periodic_error",
    "cross_axis_coupling",
    "sensor_gain",
    "sensor_offset",
    "sensor_nonlinearity",
    "sensor_bandwidth",
    "trigger_delay",
    "sample_clock",
    "hum",
    "platen_conduction",
    "speed_dependent_heat",
    "convection_scale",
    "resistance_tempco",
    "radiation",
    "ambient_drift",
    "thermocouple_lag",
]
BODY = "UU012500/1\nVEL1 15.0\nACC1 0.1\nMRI1 1.0\nWX1\nWT100\n"


def test_the_names_are_the_vocabulary():
    assert set(NAMES) <= set(catalogue())
    assert len(set(NAMES)) == len(NAMES) == 42


@pytest.mark.parametrize("name", NAMES)
def test_each_says_its_equation_and_source_and_keeps_its_own_bounds(name):
    effect = catalogue()[name]
    assert "Source:" in effect.equation()
    for p in effect.parameters:
        for value in (p.default, p.null, *p.plausible):
            assert p.low <= value <= p.high, p.name
        assert p.name in effect.equation() or p.name in ("o_a", "o_b", "phi2", "phi3")


def test_the_page_is_what_the_command_prints():
    page = (PROGRAMS.parent / "docs" / "effects.md").read_text(encoding="utf-8")
    assert page == markdown()


def of(*names):
    effects = catalogue()
    return [
        Active(e, tuple(p.default for p in e.parameters), (1, 2)) for e in map(effects.get, names)
    ]


def test_compiled_and_plain_kernels_give_the_same_bits():
    effects = {
        "coulomb_friction": {},
        "detent_force": {},
        "quadrature_error": {},
        "current_loop_lag": {},
        "voltage_saturation": {},
    }
    program = mopro.compile(BODY)
    plain, built = (mopro.emulate(program, effects=effects, compiled=c) for c in (False, True))
    for column, values in plain.columns.items():
        assert np.array_equal(values, built[column]), column


OUTSIDE = '''
import math
from mopro.emulator.effects import Effect, Parameter, Stage


class Wobble(Effect):
    """A force that varies along the platen.

    F = A sin(x/L), A in N, L in m. Source: test.
    """

    name = "wobble"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("A", "N", "force", 1.0, (0.1, 5.0), 0.0, 50.0, "amplitude"),
        Parameter("L", "m", "length", 0.01, (1e-3, 1.0), 1e-6, 10.0, "length", null=0.01),
    )

    @staticmethod
    def force(x, v, a, length):
        return a * math.sin(x / length)
'''
SCRIPT = f"""
import math, mopro
program = mopro.compile({BODY!r})
for compiled in (False, True):
    on = mopro.emulate(program, effects={{"wobble": {{"A": 4.0}}}}, compiled=compiled)
    off = mopro.emulate(program)
    x = on["position_1_m"][-1]
    k = 2 * math.pi / 1.016e-3
    print(abs((x - off["position_1_m"][-1]) / (4.0 * math.sin(x / 0.01) / (k * 111.0)) - 1))
"""


def test_an_installed_package_adds_an_effect(tmp_path):
    package = tmp_path / "outside"
    package.mkdir()
    (package / "wobble_effect.py").write_text(OUTSIDE)
    (package / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "wobble-effect"\nversion = "1"\n'
        '[project.entry-points."mopro.effects"]\nwobble = "wobble_effect:Wobble"\n'
        '[tool.hatch.build.targets.wheel]\ninclude = ["wobble_effect.py"]\n'
    )
    site = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(site)]
    if any(d.metadata["Name"] == "hatchling" for d in distributions()):
        install.append("--no-build-isolation")
    subprocess.run([*install, str(package)], check=True, capture_output=True, text=True)
    env = os.environ | {"PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=env, check=True, capture_output=True, text=True
    )
    assert [float(line) for line in done.stdout.split()] == pytest.approx([0, 0], abs=0.01)


def test_effects_asked_for_in_python_are_checked_too():
    program = mopro.compile(BODY)
    with pytest.raises(ModelError, match="did you mean `viscous_drag`"):
        mopro.emulate(program, effects={"viscous_darg": {"b": 1.0}})
    with pytest.raises(ModelError, match="out of bounds"):
        mopro.emulate(program, effects={"viscous_drag": {"b": -1.0}})


def test_terms_are_scalar_functions_without_hidden_state():
    """What a kernel holds must not change behind its back."""
    for effect in catalogue().values():
        for kind in ("force", "reaction", "slide", "setpoint"):
            term = getattr(effect, kind)
            if term is not None:
                closed = inspect.getclosurevars(term)
                assert not closed.nonlocals
                assert set(closed.globals) <= {"math"}
