"""Plants of machines beside the motor against closed forms, and the cases made with them."""

import io
import json
import math
import tomllib

import numpy as np
import pytest

from helpers.commands import run_here
from mopro.blind.cases.drawn_machine import columns, drawn, left_by, visible
from mopro.blind.cases.machine_case import machine_case
from mopro.blind.cases.machine_kinds import MachineSpec, machines
from mopro.blind.cases.machine_texts import columns_of
from mopro.blind.reference.stepped_machines import PLANTS
from mopro.blind.scoring.judge_machine import judge_machine, machine_of

T = np.arange(0, 2.0, 0.002)
MASS, VISCOUS, SPRING = 2.0, 3.0, 800.0
NUMBERS = {"mass": MASS, "viscous": VISCOUS, "spring": SPRING}
STEP = {"time_s": T, "force_N": np.full(len(T), 10.0)}


def place(columns, **effects):
    return PLANTS["axis"](columns, NUMBERS, effects)[0]


# -- axis ----------------------------------------------------------------------------------


def test_a_step_of_force_rings_as_the_closed_form_does():
    decay, rest = VISCOUS / (2 * MASS), 10.0 / SPRING
    rate = math.sqrt(SPRING / MASS - decay**2)
    ring = np.exp(-decay * T) * (np.cos(rate * T) + decay / rate * np.sin(rate * T))
    assert place(STEP) == pytest.approx(rest * (1 - ring), abs=1e-8 * rest)


def test_dry_friction_takes_the_same_from_each_swing_and_holds_the_mass():
    numbers = {"mass": MASS, "viscous": 0.0, "spring": SPRING}
    x = PLANTS["axis"](STEP, numbers, {"dry_friction": {"Fc": 1.5}})[0]
    turns = x[1:-1][np.diff(np.sign(np.diff(x))) != 0]
    # About the middle of each way, (F - Fc sign v) / k, the swings are equal.
    middles = (10.0 - 1.5 * np.array([1, -1, 1, -1])) / SPRING
    expected, at = [], 0.0
    for middle in middles:
        at = 2 * middle - at
        expected.append(at)
    assert turns[:3] == pytest.approx(expected[:3], rel=1e-4)
    held = x[-100:]
    assert np.ptp(held) == 0.0
    assert abs(10.0 - SPRING * held[0]) <= 1.5


def test_a_force_below_the_friction_moves_nothing():
    assert np.ptp(place(STEP, dry_friction={"Fc": 10.5})) == 0.0


@pytest.mark.parametrize("halves", [2, 5, 6])
def test_a_delay_of_the_input_moves_the_answer(halves):
    """By half rows; the same held force in rows twice as close shows the places between."""
    force = np.where(T > 0.1, 10.0, 0.0)
    late = place({"time_s": T, "force_N": force}, input_delay={"d": halves * 0.001})
    close = np.arange(0, 2.0, 0.001)
    plain = place({"time_s": close, "force_N": np.repeat(force, 2)})
    shifted = np.concatenate((np.zeros(halves), plain))[: len(close) : 2]
    assert late == pytest.approx(shifted, abs=1e-10)


def test_lags_of_the_input_and_of_the_reading_are_one_to_a_linear_machine():
    force = 10 * np.sin(9.0 * T)
    runs = {"time_s": T, "force_N": force}
    by_input = place(runs, input_lag={"tau": 0.01})
    by_reading = place(runs, sensor_lag={"tau": 0.01})
    assert by_input == pytest.approx(by_reading, abs=2e-4 * np.ptp(by_input))


@pytest.mark.parametrize(
    ("effect", "own", "force"),
    [
        ("quadratic_drag", {"d": 4.0}, lambda x, v, u: -4.0 * v * abs(v)),
        ("cubic_damping", {"b3": 9.0}, lambda x, v, u: -9.0 * v**3),
        ("cubic_stiffness", {"k3": 1e6}, lambda x, v, u: -1e6 * x**3),
        ("bias_force", {"g": -2.0}, lambda x, v, u: -2.0),
        ("direction_dependent_gain", {"k_u": 0.1}, lambda x, v, u: 0.1 * abs(u)),
        ("input_dead_zone", {"w": 2.0}, lambda x, v, u: -math.copysign(min(abs(u), 2.0), u)),
        ("cogging", {"P": 0.004, "s": 1.0, "c": 0.5}, lambda x, v, u: (
            math.sin(2 * math.pi * x / 0.004) + 0.5 * math.cos(2 * math.pi * x / 0.004)
        )),
    ],
)  # fmt: skip
def test_an_effect_is_the_force_that_it_states(effect, own, force):
    """By SciPy's integrator, restarted at each row, as the input jumps there."""
    from scipy.integrate import solve_ivp

    t = T[:300]
    pushes = 10 * np.sin(12.0 * t)
    state, expected = [0.0, 0.0], []
    for push in pushes:
        expected.append(state[0])

        def rates(_, s, push=push):
            return [s[1], (push - VISCOUS * s[1] - SPRING * s[0] + force(*s, push)) / MASS]

        state = solve_ivp(rates, (0, 0.002), state, rtol=1e-9, atol=1e-12).y[:, -1]
    found = place({"time_s": t, "force_N": pushes}, **{effect: own})
    assert found == pytest.approx(np.array(expected), abs=1e-8)


# -- others --------------------------------------------------------------------------------


def test_a_node_warms_as_the_closed_form_does():
    t = np.arange(0, 600.0, 2.0)
    numbers = {"nodes": 1.0, "begin": 20.0, "a1": 0.4, "U1": 0.01}
    seen = PLANTS["thermal"]({"time_s": t, "duty1": np.full(len(t), 0.5)}, numbers, {})
    assert seen[0] == pytest.approx(20 + 20 * (1 - np.exp(-0.01 * t)), abs=1e-6)


def test_coupled_nodes_share_their_heat():
    t = np.arange(0, 600.0, 2.0)
    numbers = {"nodes": 2.0, "begin": 20.0, "a1": 0.4, "a2": 0.4, "U1": 0.01, "U2": 0.01}
    given = {"time_s": t, "duty1": np.full(len(t), 0.5), "duty2": np.zeros(len(t))}
    one, two = PLANTS["thermal"](given, numbers, {"coupling": {"k": 0.005}})
    # Sum and difference are nodes of their own: the difference loses by U + 2 k.
    assert one + two == pytest.approx(40 + 20 * (1 - np.exp(-0.01 * t)), abs=1e-6)
    assert one - two == pytest.approx(10 * (1 - np.exp(-0.02 * t)), abs=1e-6)


def test_a_slide_is_late_and_has_play():
    t = np.arange(0, 4.0, 0.01)
    ramp = {"time_s": t, "command_m": 0.05 * t}
    late = PLANTS["kinematic"](ramp, {}, {"lag": {"tau": 0.1}})[0]
    assert late == pytest.approx(0.05 * (t - 0.1 * (1 - np.exp(-t / 0.1))), abs=1e-12)
    there = {"time_s": t, "command_m": 0.1 * np.abs(t - 2.0)}
    play = PLANTS["kinematic"](there, {}, {"backlash": {"w": 2e-3, "begun": -1.0}})[0]
    assert play[:200] == pytest.approx(there["command_m"][:200] + 1e-3, abs=1e-12)
    assert play[230:] == pytest.approx(there["command_m"][230:] - 1e-3, abs=1e-12)


def test_an_effort_is_the_sum_of_its_terms():
    t = np.arange(0, 2.0, 0.002)
    given = {
        "time_s": t, "angle_rad": np.sin(3 * t), "speed": 3 * np.cos(3 * t),
        "acceleration": -9 * np.sin(3 * t),
    }  # fmt: skip
    effects = {"dry_friction": {"Fc": 0.05}, "stiffness": {"k": 0.02}}
    seen = PLANTS["effort"](given, {"inertia": 2e-3, "damping": 7e-3}, effects)[0]
    expected = 2e-3 * given["acceleration"] + 7e-3 * given["speed"]
    expected = expected + 0.05 * np.sign(given["speed"]) + 0.02 * given["angle_rad"]
    assert seen == pytest.approx(expected, abs=1e-12)


# -- cases ---------------------------------------------------------------------------------


def a_case(kind, hidden, seed=1, **changes):
    spec = MachineSpec(kind, hidden, "", 2, "stated", ())
    return machine_case(np.random.default_rng(seed), MachineSpec(**{**vars(spec), **changes}))


@pytest.mark.parametrize("kind", ["axis", "kinematic", "thermal"])
def test_what_hides_nothing_is_an_experiment_without_disagreement_once_fitted(tmp_path, kind):
    answer, files = a_case(kind, (), troubles=("gap", "outliers", "irregular"))
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--json")
    assert done.returncode == 0, done.stderr
    reply = json.loads(done.stdout)
    assert reply["verdict"] == "none"
    judged = judge_machine("001", answer, reply, tmp_path)
    assert judged.outcome == "right"
    assert not judged.said


def test_the_grid_has_a_fifth_of_nulls_and_hides_all_that_is_drawn():
    specs = list(machines(np.random.default_rng(1)))
    assert len(specs) == 300
    assert sum(s.group == "none" for s in specs) == 60
    assert {s.runs for s in specs} == {1, 2, 3, 4, 5, 6}


def test_a_case_is_made_alike_from_a_seed_and_its_truth_leaves_nothing(tmp_path):
    first, files = a_case("axis", ("cubic_damping",))
    assert first == a_case("axis", ("cubic_damping",))[0]
    machine = machine_of(first)
    runs = [columns_of("axis", files[name]) for name in first["runs"]]
    truth = {e["name"]: e["parameters"] for e in first["effects"]}
    assert left_by(machine, runs, truth, truth, first["sigma"]) == pytest.approx(0, abs=1e-9)
    assert left_by(machine, runs, truth, {}, first["sigma"]) > 100
    assert all(e["total_sigma"] >= 20 * 0.999 for e in first["effects"])


def test_what_a_free_number_takes_up_does_not_show():
    g = np.random.default_rng(3)
    machine = drawn(g, "axis")
    run = columns(g, machine, 1, False)
    sizes = visible(machine, [run], {
        "viscous_drag": {"b": 1e-3 * machine.numbers["viscous"]},
        "cubic_damping": {"b3": 1.0},
    })  # fmt: skip
    assert sizes["viscous_drag"] < 1e-3 * sizes["cubic_damping"]


def test_a_program_of_a_machine_is_run_only_where_that_is_allowed(tmp_path):
    words = ("--seed", 77, "--grid", "machines", "--cases", "84,95", "--out", "c")
    made = run_here(tmp_path, "blind", "make", *words)
    assert made.returncode == 0, made.stderr
    refused = run_here(tmp_path, "blind", "score", "c")
    assert refused.returncode == 2
    assert "--allow-python" in refused.stderr
    done = run_here(tmp_path, "blind", "score", "c", "--allow-python", "--json")
    assert done.returncode == 0, done.stderr
    answers = json.loads((tmp_path / "c" / "answers.json").read_text())["cases"]
    for number, answer in answers.items():
        reply = json.loads((tmp_path / "c" / number / "verdict.json").read_text())
        named = {effect["name"] for effect in reply["effects"]}
        assert named == {effect["name"] for effect in answer["effects"]}
        judged = judge_machine(number, answer, reply, tmp_path / "c" / number)
        assert judged.same
        assert judged.unseen_after <= 1.005 * judged.unseen_before


@pytest.mark.parametrize("seed", range(8))
def test_a_number_with_a_tolerance_is_off_by_less(seed):
    answer, files = a_case("axis", ("quadratic_drag",), seed=seed)
    base = tomllib.loads(files["machine.toml"].decode())["base"]
    (name,) = answer["machine"]["off"]
    stated, true = base[name], answer["machine"]["numbers"][name]
    off = abs(stated["value"] / true - 1)
    assert 0 < off < stated["tolerance"] == 0.1  # a share, whatever the unit
    assert off == pytest.approx(abs(answer["machine"]["off"][name]), abs=1e-5)


@pytest.mark.parametrize("kind", PLANTS)
def test_residuals_of_an_unseen_run_are_told_over_the_noise(tmp_path, kind):
    """By the noise of the readings themselves: what is left by the truth, in the log's unit."""
    answer, files = a_case(kind, ())
    data = np.genfromtxt(io.BytesIO(files["unseen.csv"]), delimiter=",", names=True)
    read = data[data.dtype.names[-1]]
    # Of differences that a motion leaves out: its fourth ones are noise, times the root of 70.
    rms = float(np.std(np.diff(read, 4)) / math.sqrt(70))
    row = {"run": "unseen.csv", "sensor": "s", "before_rms": 3 * rms, "after_rms": rms}
    judged = judge_machine("001", answer, {"verdict": "none", "unseen": [row]}, tmp_path)
    assert judged.unseen_after == pytest.approx(1.0, rel=0.2)
    assert judged.unseen_before == pytest.approx(3 * judged.unseen_after)


@pytest.mark.parametrize("words", [("--effects", "mine.toml"), ("--machine", "mine.toml")])
def test_other_machines_and_effects_are_not_for_this_grid(tmp_path, words):
    (tmp_path / "mine.toml").write_text("")
    done = run_here(
        tmp_path, "blind", "make", "--seed", 1, "--grid", "machines", "--out", "c", *words
    )
    assert done.returncode == 2
    assert "draws its own machines" in done.stderr
    assert not (tmp_path / "c").exists()


def reply_of(name, **parameters):
    told = {
        n: {"value": v, "unit": u, "ci95": [0.9 * v, 1.1 * v]} for n, (v, u) in parameters.items()
    }
    return {
        "verdict": "named", "effects": [{"name": name, "parameters": told}], "alternatives": [],
    }  # fmt: skip


def test_a_name_is_false_unless_its_best_fit_leaves_nothing(tmp_path):
    answer, files = a_case("axis", ("input_lag",))
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    tau = answer["effects"][0]["parameters"]["tau"]
    twin = judge_machine("001", answer, reply_of("sensor_lag", tau=(tau, "s")), tmp_path)
    false = judge_machine("001", answer, reply_of("bias_force", g=(0.1, "N")), tmp_path)
    right = judge_machine("001", answer, reply_of("input_lag", tau=(1e3 * tau, "ms")), tmp_path)
    assert (twin.outcome, false.outcome, right.outcome) == ("family", "wrong", "right")
    assert [c.inside for c in right.covered] == [True]
    assert false.leaves > 10
