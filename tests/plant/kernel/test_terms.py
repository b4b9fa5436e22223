"""Terms of effects in the kernel: states, reactions, and sets of several."""

import gc
import math

import numpy as np
import pytest

from mopro.effects import Active, Domain, Effect, catalogue
from mopro.machine import load_machine
from mopro.machine.constants import PlantConstants
from mopro.motion.track import Track
from mopro.plant.command_table import CommandTable
from mopro.plant.drive_scaling import DriveScaling
from mopro.plant.integration import Integration, Stepping
from mopro.plant.kernel.build import kernel
from mopro.plant.kernel.effect_terms import TermSet

MACHINE = load_machine("chow1992")
PLANT = PlantConstants.of(MACHINE, 0.0)
K, F0, M = PLANT.wave_number_1_m, PLANT.pull_out_force_N, PLANT.mass_kg
TIMES = np.linspace(0.0, 0.2, 401)


def effect(**terms):
    functions = {kind: staticmethod(term) for kind, term in terms.items()}
    facts = {"name": "test", "stage": Domain.DYNAMICS, "parameters": ()}
    return Active(type("Test", (Effect,), facts | functions)(), (), (1, 2))


def positions(active, x0, compiled=False):
    """Free motion from `x0` at a command at rest, undamped but by `active`."""
    plant = PlantConstants(**vars(PLANT) | {"damping_N_s_m": 0.0})
    how = (plant, CommandTable(Track()), False, Stepping(2e-5), active, DriveScaling.full())
    integration = Integration(*how, compiled)
    integration.x = x0
    return integration.through(TIMES).position


@pytest.mark.parametrize("compiled", [False, True])
def test_a_reaction_in_proportion_to_the_motor_s_force_is_another_mass(compiled):
    """F - e F = m ẍ swings at √((1 - e) K/m) for small lags, K = k F0."""
    found = positions([effect(reaction=lambda x, v, motor: -0.19 * motor)], 1e-8, compiled)
    expected = 1e-8 * np.cos(0.9 * math.sqrt(K * F0 / M) * TIMES)
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_reaction_may_have_a_state_that_follows_the_path(compiled):
    """-F - c z, z the way gone, takes the motor away: m ẍ = P - c (x - x0) under a push P."""
    spring = effect(reaction=lambda x, v, z, motor: -motor - 2e5 * z, slide=lambda z, dx: z + dx)
    found = positions([spring, effect(force=lambda x, v: 2.0)], 1e-4, compiled)
    expected = 1e-4 + 2.0 / 2e5 * (1 - np.cos(math.sqrt(2e5 / M) * TIMES))
    assert found == pytest.approx(expected, abs=1e-11)


def test_plain_and_compiled_give_the_same_bits_for_several_states():
    other = effect(force=lambda x, v, z: -50.0 * z, slide=lambda z, dx: 0.9 * z + dx)
    friction = Active(catalogue()["coulomb_friction"], (3.0, 5e-6), (1, 2))
    active = [friction, other, effect(reaction=lambda x, v, motor: -0.1 * abs(motor))]
    assert np.array_equal(positions(active, 1e-4, False), positions(active, 1e-4, True))


def test_two_sets_have_two_kernels_and_one_set_has_one():
    drag, squared = (
        TermSet.of([Active(catalogue()[name], (1.0,), (1, 2))])
        for name in ("viscous_drag", "quadratic_drag")
    )
    again = TermSet.of([Active(catalogue()["viscous_drag"], (2.0,), (1, 2))])
    assert kernel(drag, False, False) is kernel(again, False, False)
    assert kernel(drag, False, False) is not kernel(squared, False, False)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_division_by_zero_in_a_term_leaves_the_finite_numbers(compiled):
    """A run says so at its line; an exception from compiled code would be a traceback."""
    pole = effect(force=lambda x, v: 1e-12 / (x - 1e-8))
    assert not np.isfinite(positions([pole], 1e-8, compiled)[-1])


def test_a_term_that_allocates_memory_compiles():
    def from_a_list(x, v):
        forces = [-1e3 * x]
        forces.append(-20.0 * v)
        return forces[0] + forces[1]

    listed = positions([effect(force=from_a_list)], 1e-5, True)
    assert np.array_equal(listed, positions([effect(force=from_a_list)], 1e-5, False))


def test_garbage_is_collected_again_after_a_compilation():
    positions([effect(force=lambda x, v: -3.0 * v)], 1e-5, True)
    assert gc.isenabled()
