"""The catalogue itself: names, documents, kernels of their own, effects from outside."""

import importlib
import inspect
import os
import subprocess
import sys
from importlib.metadata import distributions

import numpy as np
import pytest

import mopro
from helpers.paths import TESTS
from mopro.effects import catalogue
from mopro.effects.effect import Effect
from mopro.effects.registry import OWN, STATED_ELSEWHERE, in_order, own_effects
from mopro.effects.resolve import with_values
from mopro.errors import ModelError

BODY = "UU012500/1\nVEL1 15.0\nACC1 0.1\nMRI1 1.0\nWX1\nWT100\n"


# The end of the platen, which every machine has.
EVERY_MACHINE_S = "forces:PlatenEdge"
DOMAINS = ("forces", "currents", "command", "measurement", "heat")


def test_each_effect_of_a_domain_is_registered_under_its_own_name():
    classes = {
        f"{domain}:{name}"
        for domain in DOMAINS
        for name, found in vars(importlib.import_module(f"mopro.effects.{domain}")).items()
        if isinstance(found, type) and issubclass(found, Effect) and "name" in vars(found)
    }
    assert classes == {*OWN, EVERY_MACHINE_S}
    assert list(own_effects()) == [effect.name for effect in own_effects().values()]


@pytest.mark.parametrize("effect", catalogue().values(), ids=lambda effect: effect.name)
def test_each_says_its_equation_and_source_and_keeps_its_own_bounds(effect):
    assert "Source:" in effect.equation()
    for p in effect.parameters:
        for value in (p.default, p.null, *p.plausible):
            assert p.low <= value <= p.high, p.name
        stem = p.name.rstrip("0123456789").partition("_")[0]
        assert stem in effect.equation(), p.name


def test_effects_load_no_scipy():
    """They say how they are fitted, and `mopro run` fits nothing."""
    script = "import sys, mopro.effects; mopro.effects.catalogue(); print('scipy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    )
    assert done.stdout == "False\n"


def test_a_machine_without_effects_loads_no_domain_but_of_those_stated_elsewhere():
    script = (
        "import sys; from mopro.effects import catalogue; from mopro.machine import load_machine\n"
        "from mopro.effects.resolve import active_effects\n"
        "print(active_effects(load_machine('chow1992'), catalogue()))\n"
        f"print(*(d for d in {DOMAINS} if f'mopro.effects.{{d}}' in sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    )
    stated = {type(own_effects()[name]).__module__ for name in STATED_ELSEWHERE}
    expected = [d for d in DOMAINS if f"mopro.effects.{d}" in stated]
    assert done.stdout.splitlines() == ["()", " ".join(expected)]


def test_effects_stated_elsewhere_are_those_that_say_so():
    own = own_effects().values()
    stating = [e.name for e in own if type(e).stated_by is not Effect.stated_by]
    assert sorted(stating) == sorted(STATED_ELSEWHERE)


def test_the_catalogue_s_order_is_that_of_acting_but_for_what_acts_last():
    names = [
        a.name for a in in_order(of("backlash", "cross_axis_coupling", "pitch_scale"), catalogue())
    ]
    assert names == ["pitch_scale", "backlash", "cross_axis_coupling"]


def of(*names):
    return [with_values(catalogue()[name], {}) for name in names]


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
from mopro.effects import Domain, Effect, Parameter


class Wobble(Effect):
    """A force that varies along the platen.

    F = A sin(x/L), A in N, L in m. Source: test.
    """

    name = "wobble"
    domain = Domain.DYNAMICS
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
import numpy as np
program = mopro.compile({BODY!r})
for compiled in (False, True):
    on = mopro.emulate(program, effects={{"wobble": {{"A": 4.0}}}}, compiled=compiled)
    off = mopro.emulate(program)
    x = on["position_1_m"][-1]
    k = 2 * math.pi / 1.016e-3
    print(abs((x - off["position_1_m"][-1]) / (4.0 * math.sin(x / 0.01) / (k * 111.0)) - 1))

from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import ForwardModel
from helpers.one_run import of

motor = ForwardModel(of(np.zeros(100), program))
(wobble,) = [c for c in candidates(motor) if c.name == "wobble"]
print(*[p.name + " " + p.role for p in wobble.parameters], dict(wobble.fixed))
"""


def test_an_installed_package_adds_an_effect_that_is_run_and_fitted(tmp_path):
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
    env = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (site, TESTS)))}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=env, check=True, capture_output=True, text=True
    )
    *apart, candidate = done.stdout.splitlines()
    assert [float(line) for line in apart] == pytest.approx([0, 0], abs=0.01)
    assert candidate == "A amplitude L constant {}"


def test_effects_asked_for_in_python_are_checked_too():
    program = mopro.compile(BODY)
    with pytest.raises(ModelError, match="did you mean `viscous_drag`"):
        mopro.emulate(program, effects={"viscous_darg": {"b": 1.0}})
    with pytest.raises(ModelError, match="out of bounds"):
        mopro.emulate(program, effects={"viscous_drag": {"b": -1.0}})


def test_terms_are_scalar_functions_without_hidden_state():
    """A compiled kernel keeps the values that its terms had when it was made."""
    for effect in catalogue().values():
        for kind in ("force", "reaction", "slide", "setpoint"):
            term = getattr(effect, kind)
            if term is not None:
                closed = inspect.getclosurevars(term)
                assert not closed.nonlocals
                assert set(closed.globals) <= {"math"}


def test_an_assumed_constant_begins_within_its_range():
    """The air may be warmer than any plausible place where the magnets were measured."""
    fitted = catalogue()["force_constant_temperature"].parameter("T0").assumed(35.0)
    assert (fitted.low, fitted.high, fitted.starts) == (15.0, 30.0, (30.0, 15.0))
