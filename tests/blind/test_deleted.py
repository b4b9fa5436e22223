"""Cases whose true effect is left out of the candidates: what stands in for it, and the judging."""

import json
from subprocess import CompletedProcess

import numpy as np
import pytest

from mopro.blind.cases.equivalent import MARGIN, equivalents, least_left, left_by_set
from mopro.blind.cases.grids import GRIDS, case_specs, spread
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS
from mopro.blind.cases.hidden_sizes import NoiselessRuns
from mopro.blind.cases.make import make
from mopro.blind.cases.spec import ENCODER, case_instruments
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.scoring.judge import judge
from mopro.blind.scoring.outcome import said
from mopro.blind.scoring.score import Score
from mopro.blind.scoring.scored_cases import with_named_set
from mopro.blind.scoring.verdict_source import VerdictSource, without_of
from mopro.cli.blind import make as make_command

MOVE = "UU012500/1\nVEL1 {}\nACC1 0.2\nMRI1 3.0\nWX1\nWT200\nMRI1 -2.0\nWX1\nWT200\n"
VARIABLES = {"v", "sgn v", "x", "x mod", "a", "t", "T", "command", "sensor"}


@pytest.fixture(scope="module")
def runs():
    """Two runs at different speeds, seen by an encoder."""
    programs = [ProgramRun(MOVE.format(speed)) for speed in (10.0, 30.0)]
    return NoiselessRuns(programs, case_instruments(ENCODER, "strokes"))


def left(runs, truth, rival):
    return least_left(runs, runs.change(truth), [HIDDEN_EFFECTS[rival]], np.random.default_rng(1))


def test_a_late_sensor_is_also_a_late_program_but_no_mass(runs):
    late = {"trigger_delay": {"t_d": 2e-4}}
    size = float(np.sum(runs.change(late) ** 2))
    assert size > 400
    assert left(runs, late, "start_delay") < 0.01 * MARGIN
    assert left(runs, late, "payload_mass") > 0.5 * size


def test_a_rival_is_fitted_within_its_range_only(runs):
    """A gain of the sensor is a pitch that is off by as much, unless that is implausibly much."""
    small, large = ({"sensor_gain": {"g": g}} for g in (2e-4, 5e-3))
    assert left(runs, small, "pitch_scale") < 0.01 * MARGIN
    assert left(runs, large, "pitch_scale") > MARGIN


def test_equivalents_are_listed_and_others_are_not(runs, monkeypatch):
    few = ("sensor_gain", "pitch_scale", "viscous_drag", "radiation")
    rivals = {name: HIDDEN_EFFECTS[name] for name in few}
    monkeypatch.setattr("mopro.blind.cases.equivalent.HIDDEN_EFFECTS", rivals)
    found = equivalents(runs, {"sensor_gain": {"g": 2e-4}}, np.random.default_rng(1))
    assert found == ["pitch_scale"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["payload_mass", "electrical_damping"], True),
        (["payload_mass", "viscous_drag"], False),
    ],
)
def test_a_weaker_motor_is_a_heavier_forcer_with_less_damping(runs, names, expected):
    """m ẍ = F sin kΔ + c (ẋ_c - ẋ): what weakens F alone does as more of m and c together."""
    truth = {"force_constant": {"e": -0.12}}
    assert np.linalg.norm(runs.change(truth)) > 20
    named = {name: {} for name in names}
    left = left_by_set(runs, ReferencePlant(truth), named, np.random.default_rng(1))
    assert (left < MARGIN) is expected


def test_what_the_reference_plant_does_not_know_leaves_no_number(runs):
    truth, named = {"force_constant": {"e": -0.12}}, {"payload_mass": {}, "no_effect": {}}
    assert left_by_set(runs, ReferencePlant(truth), named, np.random.default_rng(1)) is None


@pytest.mark.parametrize(("static_N", "expected"), [(1.0, True), (2.0, False)])
def test_the_parameters_that_a_verdict_states_are_tried_as_they_are(
    runs, static_N, expected, monkeypatch
):
    """Stribeck's friction with no excess at rest is Coulomb's, which a fit of it may miss."""
    monkeypatch.setattr("mopro.blind.cases.equivalent.least_left", lambda *_: np.inf)
    truth = {"coulomb_friction": {"Fc": 1.0, "delta": 5e-6}}
    stated = {"Fc": 1.0, "Fs": static_N, "vs": 0.05, "delta": 5e-6}
    assert np.linalg.norm(runs.change(truth)) > 20
    named, generator = {"stribeck_friction": stated}, np.random.default_rng(1)
    assert (left_by_set(runs, ReferencePlant(truth), named, generator) < MARGIN) is expected


def test_all_effects_that_can_be_hidden_are_left_out_once():
    specs = case_specs("deleted", 1)
    assert sorted(name for s in specs for name, _ in s.effects) == sorted(HIDDEN_EFFECTS)
    assert all(s.deleted and len(s.effects) == 1 for s in specs)


def test_each_effect_has_right_variables():
    assert all(effect.variables for effect in HIDDEN_EFFECTS.values())
    assert {v for effect in HIDDEN_EFFECTS.values() for v in effect.variables} <= VARIABLES
    assert said(" sgn  v ") == "sgn v"


def test_the_command_knows_all_grids():
    (grid,) = (p for p in make_command.params if p.name == "grid")
    assert list(grid.type.choices) == list(GRIDS)


def test_a_sample_is_evenly_spread():
    numbers = [f"{i:03d}" for i in range(1, 11)]
    assert spread(numbers, 4) == ["001", "003", "006", "008"]
    assert spread(numbers, None) == spread(numbers, 12) == numbers


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """The folder and the answer of a quickly made case of the grid."""
    specs = case_specs("deleted", 1)
    at = next(i for i, s in enumerate(specs, 1) if s.effects[0][0] == "ambient_drift")
    folder = tmp_path_factory.mktemp("deleted")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mopro.blind.cases.case.equivalents", lambda *_: ["radiation"])
        number, seal = make(1, "deleted", folder, frozenset([f"{at:03d}"]), sample=1)
    assert len(seal) == 64
    document = json.loads((folder / "answers.json").read_text())
    assert document["grid"] == "deleted"
    return folder / number, document["cases"][number]


def test_the_answer_states_what_to_leave_out_and_what_is_right(case):
    folder, answer = case
    assert (answer["without"], answer["equivalent"]) == (["ambient_drift"], ["radiation"])
    assert answer["visible_sigma"] > 20
    assert answer["variables"] == ["T", "t"]
    assert "ambient_drift" not in (folder / "experiment.toml").read_text()


@pytest.mark.parametrize(
    ("verdict", "names", "expected", "leaves"),
    [
        ("named", ["ambient_drift", "thermocouple_lag"], "family", (0, MARGIN)),
        ("named", ["convection_scale", "thermocouple_lag"], "wrong", (MARGIN, np.inf)),
        ("unexplained", ["ambient_drift", "thermocouple_lag"], "wrong", None),
    ],
)
def test_the_set_that_is_named_is_fitted_by_the_reference_plant(
    case, verdict, names, expected, leaves
):
    """With the hidden effect itself in it, the set leaves nothing; a lag that is not there is 0."""
    folder, answer = case
    reply = {"verdict": verdict, "effects": [{"name": name} for name in names], "files": {}}
    judged = judge(folder.name, with_named_set(answer, reply, folder, 1), reply)
    assert judged.outcome == expected
    assert judged.leaves is None if leaves is None else leaves[0] <= judged.leaves < leaves[1]


def test_answers_of_older_cases_state_no_runs_and_are_judged_as_they_were(case):
    folder, answer = case
    older = {key: value for key, value in answer.items() if key != "runs"}
    reply = {"verdict": "named", "effects": [{"name": "ambient_drift"}, {"name": "hum"}]}
    assert with_named_set(older, reply, folder, 1) == older


def test_the_question_leaves_it_out_and_a_verdict_is_kept_for_the_same_question(case, monkeypatch):
    folder, answer = case
    asked = []

    def reconcile(module, words, patience_s):
        asked.append(words)
        reply = json.dumps({"verdict": "none", "effects": []}).encode()
        return CompletedProcess([module, *words], 0, reply, b"")

    monkeypatch.setattr("mopro.blind.scoring.verdict_source.run_module", reconcile)
    source, file = VerdictSource(), folder / "experiment.toml"
    for without in (without_of(answer), without_of(answer), [], []):
        source.ask(folder.name, file, without)
    (folder / "verdict.json").unlink()
    assert [words[-2:] for words in asked] == [
        ["--without", "ambient_drift"],
        [str(file), "--json"],
    ]


ANSWER = {
    "group": "deleted", "sensor": "laser", "strange": None, "offsets": [0.0],
    "effects": [{"name": "viscous_drag", "parameters": {"b": 5.0}, "total_sigma": 50.0}],
    "without": ["viscous_drag"], "equivalent": ["trigger_delay"], "variables": ["v"],
    "visible_sigma": 50.0,
}  # fmt: skip


def outcome(verdict, *names, family=(), visible=50.0, **others):
    effects = [{"name": name, "indistinguishable_from": list(family)} for name in names]
    reply = {"verdict": verdict, "effects": effects, **others}
    return judge("001", ANSWER | {"visible_sigma": visible}, reply).outcome


def test_names_are_right_only_if_equivalent():
    assert outcome("named", "trigger_delay") == "family"
    assert outcome("ambiguous", "hum", family=["trigger_delay"]) == "family"
    assert outcome("named", "hum") == "wrong"
    assert outcome("unexplained", "hum") == "wrong"
    assert outcome("named", "trigger_delay", "hum") == "wrong"


def test_without_a_name_the_variable_counts():
    right, wrong = {"variable": "v"}, {"variable": "x mod"}
    assert outcome("unexplained", remainder=right) == "right"
    assert outcome("unexplained", remainder=wrong) == "unexplained"
    assert outcome("unexplained", remainder=wrong, drafts=[{"of": "v"}]) == "right"
    assert outcome("unexplained", remainder={"description": "a line"}) == "unexplained"
    assert outcome("none") == "none"
    assert outcome("none", visible=3.0) == "right"
    assert outcome("failed") == "failed"


def test_the_table_of_the_grid():
    named = {"verdict": "named", "effects": [{"name": "hum"}]}
    unknown = {"verdict": "unexplained", "effects": [], "remainder": {"variable": "v"}}
    cases = [judge(f"{i:03d}", ANSWER, unknown) for i in range(49)]
    cases.append(judge("050", ANSWER, named))
    score = Score(tuple(cases), (), "deleted")
    assert [(r.target, r.reached, r.met) for r in score.rows()[:2]] == [
        ("≤ 8%", "2.0% (1 of 50)", True),
        ("≥ 75%", "98.0% (49 of 50)", True),
    ]
    assert score.wrong() == [cases[-1]]
