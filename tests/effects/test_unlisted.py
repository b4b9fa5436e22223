"""Free-form terms inside the simulator: what they do there, and that the diagnosis drafts them."""

import json
import re

import numpy as np
import pytest

import mopro
from helpers import one_run
from helpers.commands import run_here
from helpers.diagnosis import OTHER_THAN_FORCES, diagnose
from helpers.laboratory import Lab
from helpers.signals import names
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Foreign
from mopro.effects import Active, catalogue
from mopro.effects.unlisted import unlisted_terms, with_unlisted
from mopro.engine.freeform import measurement_laws
from mopro.experiment import load_experiment
from mopro.experiment.sawyer.candidates import unlisted
from mopro.experiment.sawyer.system import Model
from mopro.experiment.sawyer.trials import Experiment, SteadyTable
from mopro.machine import load_machine
from mopro.plant import plan_with_effects, simulate
from mopro.source import Source

PITCH_M = load_machine("chow1992").axis.pitch_m
AIR_C = load_machine("chow1992").heat.ambient_C
BOTH_WAYS = "UU012500/1\nACC1 0.1\nVEL1 5\nMRI1 0.5\nWX1\nWT200\nMRI1 -0.5\nWX1\nWT200\n"


@pytest.fixture(scope="module")
def motion():
    return Model(one_run.of(np.zeros(3000)))


@pytest.fixture(scope="module")
def table():
    rows = (np.array([0.1, 0.3]), np.array([2.0, 2.0]), np.array([0.2, 0.1]), np.array([0.0, 0.1]))
    steady = SteadyTable("table", *rows, np.zeros(2), 1.0)
    return Model(Experiment(Source("x", ""), load_machine("chow1992"), (), (steady,)))


def shift(model, settings):
    return np.concatenate(model(settings)) - np.concatenate(model({}))


@pytest.mark.parametrize(
    ("term", "of_term", "effect", "of_effect"),
    [
        ("force of v", {"c": -8.0}, "viscous_drag", {"b": 8.0}),
        ("force of v|v|", {"c": -5.0}, "quadratic_drag", {"c": 5.0}),
        ("force of sgn v", {"c": -3.0}, "coulomb_friction", {"Fc": 3.0}),
        ("load's force of sgn v", {"c": -0.1}, "load_dependent_friction", {"mu": 0.1}),
        (
            "falling force of sgn v",
            {"c": -2.0, "s": -1.0, "vs": 1e6},
            "coulomb_friction",
            {"Fc": 3.0},
        ),
        # Over a presliding longer than any path, no friction builds up.
        ("force of v in presliding", {"c": -8.0, "delta": 1e9}, "viscous_drag", {"b": 8.0}),
        ("steady force", {"c": 2.0}, "constant_force", {"F_b": 2.0}),
        # Over a place that is wider than any path.
        ("force in one place", {"c": 2.0, "x0": 0, "w": 1e6}, "constant_force", {"F_b": 2.0}),
        (
            "friction in one place",
            {"c": -3.0, "x0": 0.0, "w": 1e6, "delta": 5e-6},
            "coulomb_friction",
            {"Fc": 3.0},
        ),
        ("force of x", {"c": -20.0}, "umbilical_spring", {"k_h": 20.0}),
        ("force of a", {"c": -0.5}, "payload_mass", {"dm": 0.5}),
        (
            "force of x mod",
            {"c": 4.0, "p": PITCH_M / 4, "phi": 0.3},
            "detent_force",
            {"Fd": 4.0, "phi": 0.3 + np.pi},
        ),
    ],
)
def test_a_force_acts_as_the_listed_effect_of_its_law(motion, term, of_term, effect, of_effect):
    own, listed = shift(motion, {term: of_term}), shift(motion, {effect: of_effect})
    assert np.abs(listed).max() > 1e-5
    assert own == pytest.approx(listed, abs=1e-9)


def test_a_force_beyond_a_speed_acts_while_the_axis_is_faster(motion):
    """At an even speed it shifts the axis by force over stiffness; else it does nothing."""
    axis, time = load_machine("chow1992").axis, np.arange(3000) / 2000
    even, rest = (time > 0.28) & (time < 0.3), time > 1.4
    shifted = {
        v0: shift(motion, {"force beyond a speed": {"c": -3.0, "v0": v0}}) for v0 in (0.1, 2)
    }
    assert shifted[0.1][even] * 0.0254 == pytest.approx(-3.0 / axis.stiffness_N_m, rel=0.1)
    assert np.abs(shifted[0.1][rest]).max() < 0.01 * np.abs(shifted[0.1]).max()
    assert not shifted[2].any()


@pytest.mark.parametrize(
    ("name", "of", "values", "sizes"),
    [
        ("force beyond a speed", "v", {"c": -3.0, "v0": 0.16}, ("v0",)),
        ("force in one place", "x", {"c": 6.0, "x0": 0.008, "w": 0.0015}, ("x0", "w")),
        ("friction in one place", "x", {"c": -6.0, "x0": 0.008, "w": 0.0015}, ("x0", "w")),
    ],
)
def test_a_force_beyond_a_speed_or_in_one_place_is_drafted_as_such(name, of, values, sizes):
    program = mopro.compile(BOTH_WAYS.replace("VEL1 5", "VEL1 9"))
    own = {**values, **({"delta": 5e-6} if name.startswith("friction") else {})}
    (exact,) = Model(one_run.of(np.zeros(4000), program))({name: own})
    noise = one_run.LASER.noise_rms * np.random.default_rng(3).standard_normal(len(exact))
    asked = one_run.of(exact + noise, program)
    verdict = diagnose(asked, left_out=OTHER_THAN_FORCES).verdict
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    draft = verdict.drafts[0]
    assert (draft.name, draft.of) == (name, of)
    told = [float(n) for n in re.findall(r"-?[0-9.]+(?:e-?[0-9]+)?", draft.law)]
    for size in sizes:
        assert any(n == pytest.approx(values[size], rel=0.1) for n in told)


def test_a_motor_that_is_stronger_forwards_lags_less_while_it_accelerates(motion):
    """m a = F (1 + c) forwards: the lag behind the command is smaller by that factor."""
    a = 0.2 * 0.0254 * 1000
    axis, time = load_machine("chow1992").axis, np.arange(3000) / 2000
    # The first ramp, of 0.2 s, after the ring of its beginning has decayed to a few hundredths.
    ramp = (time > 0.12) & (time < 0.19)
    lag = axis.moving_mass_kg * a / axis.stiffness_N_m
    gained = shift(motion, {"motor's force of sgn v": {"c": 0.1}})[ramp].mean() * 0.0254
    assert gained == pytest.approx(lag * (1 - 1 / 1.1), rel=0.15)


def test_a_damping_in_presliding_ends_once_the_axis_slides(motion):
    """Over 5 um it acts on the ring at rest, and not on the lag while the axis moves evenly."""
    time = np.arange(3000) / 2000
    even, rest = (time > 0.25) & (time < 0.3), time > 1.3
    damped = shift(motion, {"force of v in presliding": {"c": -30.0}})
    drag = shift(motion, {"viscous_drag": {"b": 30.0}})
    assert np.abs(damped[even]).max() < 0.01 * np.abs(drag[even]).max()
    assert np.abs(damped[rest]).max() > 0.3 * np.abs(drag[rest]).max()


@pytest.mark.parametrize("power", [2, 3])
def test_a_force_of_place_shifts_an_axis_at_rest_by_force_over_stiffness(motion, power):
    axis = load_machine("chow1992").axis
    at_rest = np.arange(3000) / 2000 > 1.3
    x = np.concatenate(motion({}))[at_rest] * 0.0254
    moved = shift(motion, {f"force of x{'²³'[power - 2]}": {"c": 10.0}})[at_rest] * 0.0254
    assert moved == pytest.approx(10.0 * x**power / axis.stiffness_N_m, rel=0.02)


@pytest.mark.parametrize(
    ("term", "of_term", "effect", "of_effect"),
    [
        ("heat of T", -4.0, "platen_conduction", {"G": 4.0, "T_p": AIR_C}),
        ("heat of v", 0.05 / PITCH_M, "speed_dependent_heat", {"kh": 0.05}),
        ("heat of v²", 1e-4 / PITCH_M**2, "speed_dependent_heat", {"kh": 0.0, "ke": 1e-4}),
    ],
)
def test_a_heat_flow_acts_as_the_listed_effect_of_its_law(table, term, of_term, effect, of_effect):
    own, listed = shift(table, {term: {"c": of_term}}), shift(table, {effect: of_effect})
    assert np.abs(listed).max() > 0.5
    assert own == pytest.approx(listed, abs=1e-6)


def test_the_heat_of_a_squared_rise_balances_the_motor_s_power(table):
    """P - g r - c r|r| = 0, where P and g are known from two rises without the term."""
    one, other = (np.concatenate(table(s)) for s in ({}, {"heat of T": {"c": -4.0}}))
    conductance = 4.0 * other / (one - other)
    rise = np.concatenate(table({"heat of T²": {"c": -0.1}}))
    assert conductance * one == pytest.approx(conductance * rise + 0.1 * rise * abs(rise), rel=1e-6)


def test_a_power_that_grows_with_the_rise_is_that_of_a_resistance_that_does(table):
    own = shift(table, {"heat of T power": {"c": 0.004}})
    listed = shift(table, {"resistance_tempco": {"alpha": 0.004, "T0": AIR_C}})
    assert np.abs(listed).max() > 0.5
    assert own == pytest.approx(listed, abs=1e-6)


def test_cooling_in_proportion_to_the_speed_is_that_of_a_conductance_at_that_speed(table):
    """P - g r - c v r = 0; g and P from a term of T, v from a term of v: P + c v - g r = 0."""

    def rise(term, c):
        return np.concatenate(table({term: {"c": c}}))

    plain, cooled = np.concatenate(table({})), rise("heat of T", -4.0)
    conductance = 4.0 * cooled / (plain - cooled)
    speed = conductance * (rise("heat of v", 20.0) - plain) / 20.0
    assert speed.min() > 0.01
    expected = conductance * plain / (conductance + 30.0 * speed)
    assert rise("heat of T v", -30.0) == pytest.approx(expected, rel=1e-6)


def test_no_term_has_the_name_of_an_effect_and_each_states_its_law():
    terms = unlisted_terms()
    names = {term.name for term in terms}
    assert len(names) == len(terms)
    assert not names & set(catalogue())
    values = {"c": 2.0, "p": 1e-3, "phi": 0.1, "s": 3.0, "vs": 0.05, "delta": 4e-6}
    values |= {"v0": 0.3, "x0": 0.01, "w": 0.002}
    written = {term.name: term.law.formula(values) for term in terms}
    assert written["force of v|v|"] == "2 * v * abs(v)"
    assert written["falling force of sgn v"] == "(2 + 3 * exp(-abs(v) / 0.05)) * sign(v)"
    assert written["force of v in presliding"] == "2 * (v - abs(v) * presliding(x, 4e-06))"
    assert written["steady force"] == "2"
    assert written["force beyond a speed"] == "2 * sign(v) * (abs(v) > 0.3)"
    assert written["force in one place"] == "2 * exp(-((x - 0.01) / 0.002)**2)"
    assert written["friction in one place"] == "2 * sign(v) * exp(-((x - 0.01) / 0.002)**2)"
    assert written["force of x mod"] == "2 * sin(2 * pi * x / 0.001 + 0.1)"
    assert {t.law.of for t in terms} == {"v", "sgn v", "x", "x mod", "a", "T", "t"}


def test_a_term_is_probed_well_within_the_pull_out_force(motion):
    for candidate in unlisted(motion.forward):
        if candidate.find_starts is None and candidate.name != "force of a":
            starts = {p.name: p.starts[0] for p in candidate.parameters}
            moved = shift(motion, candidate.settings(starts)) * 0.0254
            assert 0 < np.abs(moved).max() < PITCH_M / 8


@pytest.mark.parametrize(
    ("effect", "values", "of"),
    [("viscous_drag", {"b": 9.0}, "v"), ("constant_force", {"F_b": 5.0}, "x")],
)
def test_a_force_that_nobody_listed_is_drafted_and_no_effect_is_named(tmp_path, effect, values, of):
    lab = Lab(tmp_path)
    for program in ("fast", "slow"):
        lab.record(f"{program}.CMD", f"{program}.csv", {effect: values})
    runs = [f'program = "{n}.CMD"\ndata = "{n}.csv"' for n in ("fast", "slow")]
    asked = load_experiment(lab.experiment(runs))
    verdict = diagnose(asked, left_out=OTHER_THAN_FORCES | {effect}).verdict
    assert verdict.verdict == "unexplained"
    assert [e.name for e in verdict.effects] == []
    assert [draft.of for draft in verdict.drafts] == [of]
    assert verdict.drafts[0].enters == "force"


def test_a_drafted_force_is_in_the_machine_file_if_it_is_asked_for(tmp_path):
    """On another program that file leaves the noise, and the one without the draft does not."""
    lab = Lab(tmp_path)
    for program in ("fast", "slow"):
        lab.record(f"{program}.CMD", f"{program}.csv", {"viscous_drag": {"b": 9.0}})
    file = lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"'])
    asked = "reconcile", file, "--without", "viscous_drag", "--out", "new.toml", "--with-drafts"
    done = run_here(tmp_path, *asked)
    assert "The machine file has force of v, unconfirmed" in done.stdout
    other = lab.experiment(['program = "slow.CMD"\ndata = "slow.csv"'])
    applied = run_here(tmp_path, "compare", other, "--apply", "new.toml", "--json")
    (gap,) = json.loads(applied.stdout)["applied"]
    assert gap["after_rms"] < 1.1 * gap["noise_rms"] < 0.6 * gap["before_rms"]


@pytest.mark.parametrize("drag", [0.0, 4.0])
def test_a_friction_whose_bristles_damp_is_told_by_that_and_not_by_what_makes_up_for_it(drag):
    """LuGre's friction on the reference plant: it damps the ring at rest, and hardly anything else.

    A dry friction with a fall of the current at rest, both listed, leave noise as well. A viscous
    drag beside it is no part of that damping, and is named.
    """
    law = {"N": 0.03, "presliding": 1.5e-5, "static": 1.3, "vs": 0.05, "inner": 0.2}
    own = one_run.LASER
    laser = Instrument(
        own.name, "position", 1, own.column, 0.0254, own.rate_hz, own.noise_rms, 0.0
    )  # fmt: skip
    hidden = {"viscous_drag": {"b": drag}} if drag else {}
    plant = ReferencePlant(hidden, foreign=Foreign("lugre", law))
    _, (exact,) = plant.readings(ProgramRun(BOTH_WAYS), [laser], np.random.default_rng(1))
    noise = own.noise_rms * np.random.default_rng(2).standard_normal(len(exact))
    asked = one_run.of(exact + noise, mopro.compile(BOTH_WAYS))
    verdict = diagnose(asked, left_out=OTHER_THAN_FORCES - {"hold_current_reduction"}).verdict
    assert (verdict.verdict, names(verdict)) == ("unexplained", set(hidden))
    # The friction itself, of 0.03 N at 0.1 m/s, looks like a little more of the drag.
    for effect in verdict.effects:
        assert effect.parameters["b"].value == pytest.approx(drag, abs=0.5)
    (draft,) = verdict.drafts
    assert (draft.name, draft.of, draft.held_out) == ("force of v in presliding", "v", True)
    assert draft.sigmas > 20


def test_a_force_that_grows_with_the_speed_is_probed_where_it_does_not_run_away(motion):
    damping = load_machine("chow1992").axis.drive_damping_N_s_m
    of_speed = {c.name: c.parameters[0] for c in unlisted(motion.forward)}
    assert of_speed["force of v"].high <= damping
    assert of_speed["force of v|v|"].high < damping
    assert of_speed["force of v"].low < -damping


@pytest.mark.parametrize("compiled", [True, False])
def test_an_axis_that_runs_away_is_told_and_not_followed(compiled):
    """A negative drag of ten times the damping: after a second the speed would be e^100 m/s."""
    program = mopro.compile("UU012500/1\nACC1 0.2\nVEL1 10\nMRI1 1.0\nWX1\nWT2000\n")
    schedule = plan_with_effects(program, load_machine("chow1992"), ())
    drag = Active(with_unlisted(catalogue())["force of v"], (300.0,), (1, 2))
    simulation = simulate(
        schedule, load_machine("chow1992"), (drag,), payload_kg=0.0, resolved=False,
        compiled=compiled,
    )  # fmt: skip
    place = simulation.positions_m(1, np.linspace(0, 2, 50), 2.0)
    assert np.isfinite(place[0])
    assert np.isnan(place[-1])


def test_a_sensor_may_follow_the_other_axis():
    """y goes along: the term of its place is c y, whatever x does."""
    text = (
        "UU112500/1\nUU212500/1\nVEL1 10\nVEL2 10\nACC1 0.2\nACC2 0.2\nMR1 1.0\nMR2 0.5\nGO\nWX1\n"
    )
    program = mopro.compile(text)
    (series,) = Model(one_run.of(np.zeros(1000), program)).series()
    (term,) = (c for c in measurement_laws([series]) if c.name == "other x in laser")
    moved = term.law.of_data(series, np.zeros(1000), {"c": 0.02})
    assert moved[0] == 0
    assert moved[-1] == pytest.approx(0.02 * 0.5, rel=1e-3)
