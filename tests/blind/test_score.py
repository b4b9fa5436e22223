"""Scores of fabricated replies."""

import json
import math

import pytest
from click.testing import CliRunner

from mopro.blind.cases.make import make
from mopro.blind.scoring.judge import FollowUp, judge, pair_key
from mopro.blind.scoring.score import Score, page
from mopro.blind.scoring.scored_cases import add_proposed_run
from mopro.cli.blind import command

HIDDEN = {"name": "viscous_drag", "parameters": {"b": 5.0}, "total_sigma": 50.0}
OTHER = {"name": "detent_force", "parameters": {"Fd": 4.0, "phi": 3.1}, "total_sigma": 30.0}


def answer(*effects, group="single", strange=None, offsets=(0.0,)):
    return {"group": group, "sensor": "laser", "effects": list(effects), "strange": strange,
            "offsets": list(offsets)}  # fmt: skip


def reply(verdict, *names, family=(), ci=None, **others):
    effects = [
        {"name": name, "indistinguishable_from": list(family), "parameters": ci or {}}
        for name in names
    ]
    return {"verdict": verdict, "effects": effects, **others}


def outcome(truth, said):
    return judge("001", truth, said).outcome


def test_right_family_wrong_none_and_unexplained():
    truth = answer(HIDDEN)
    assert outcome(truth, reply("named", "viscous_drag")) == "right"
    assert outcome(truth, reply("ambiguous", "trigger_delay", family=["viscous_drag"])) == "family"
    assert outcome(truth, reply("ambiguous", "viscous_drag", family=["trigger_delay"])) == "right"
    assert outcome(truth, reply("named", "trigger_delay")) == "wrong"
    assert outcome(truth, reply("named", "viscous_drag", "detent_force")) == "wrong"
    assert outcome(truth, reply("none")) == "none"
    assert outcome(truth, reply("unexplained")) == "unexplained"
    assert outcome(truth, reply("unexplained", "detent_force")) == "wrong"
    assert outcome(truth, {"verdict": "failed"}) == "failed"
    assert outcome(truth, {}) == "failed"


def test_a_set_of_effects_that_does_as_well_is_right_if_it_is_the_hidden_one():
    both = answer(HIDDEN, OTHER, group="pair", offsets=[1e-4])
    sets = [["hum", "backlash"], ["detent_force", "viscous_drag", "sensor_offset"]]
    assert outcome(both, reply("ambiguous", "hum", "backlash", alternatives=sets)) == "family"
    assert outcome(both, reply("ambiguous", "viscous_drag", alternatives=sets)) == "family"
    assert outcome(both, reply("ambiguous", "hum", "backlash", alternatives=sets[:1])) == "wrong"
    none = answer(group="none")
    assert outcome(none, reply("ambiguous", "hum", alternatives=[["hum"], []])) == "wrong"


def test_nothing_hidden():
    nothing = answer(group="none")
    assert outcome(nothing, reply("none")) == "right"
    assert outcome(nothing, reply("named", "hum")) == "wrong"
    assert outcome(nothing, reply("unexplained")) == "unexplained"


def test_two_effects_must_both_be_named_and_each_once():
    both = answer(HIDDEN, OTHER, group="pair")
    assert outcome(both, reply("named", "detent_force", "viscous_drag")) == "right"
    assert outcome(both, reply("named", "viscous_drag")) == "partly"
    assert outcome(both, reply("named", "viscous_drag", "hum")) == "wrong"
    twice = reply("ambiguous", "trigger_delay", "start_delay", family=["viscous_drag"])
    assert outcome(both, twice) == "wrong"


def test_an_effect_below_the_sensor_s_resolution_may_go_unnamed_but_not_misnamed():
    faint = answer(HIDDEN | {"total_sigma": 3.0})
    assert outcome(faint, reply("none")) == "right"
    assert outcome(faint, reply("named", "viscous_drag")) == "right"
    assert outcome(faint, reply("named", "hum")) == "wrong"


def test_off_the_catalogue():
    strange = answer(group="off catalogue", strange={"name": "local_bump"})
    said = judge("1", strange, reply("unexplained", remainder={"description": "a bump at 3 in"}))
    assert said.outcome == "right"
    assert said.described
    assert not judge("1", strange, reply("unexplained", remainder={"description": None})).described
    assert outcome(strange, reply("named", "periodic_error")) == "wrong"
    assert outcome(strange, reply("unexplained", "viscous_drag")) == "wrong"
    assert outcome(strange, reply("none")) == "none"


def test_an_offset_that_is_there_is_no_wrong_name():
    said = reply("named", "viscous_drag", "sensor_offset")
    assert outcome(answer(HIDDEN, offsets=[2e-4]), said) == "right"
    assert outcome(answer(HIDDEN), said) == "wrong"


@pytest.mark.parametrize(
    ("interval", "inside"), [([4.5, 5.5], True), ([5.5, 4.5], True), ([5.1, 5.5], False)]
)
def test_coverage(interval, inside):
    said = reply("named", "viscous_drag", ci={"b": {"value": 5, "unit": "", "ci95": interval}})
    (covered,) = judge("1", answer(HIDDEN), said).covered
    assert covered.inside is inside
    assert covered.main


@pytest.mark.parametrize(("unit", "inside"), [("in", True), ("m", False)])
def test_an_interval_in_a_sensor_s_unit_is_compared_in_metres(unit, inside):
    hidden = {"name": "sensor_offset", "parameters": {"o": 0.0254}, "total_sigma": 50.0}
    ci = {"o": {"value": 1.0, "unit": unit, "ci95": [0.9, 1.1]}}
    (covered,) = judge("1", answer(hidden), reply("named", "sensor_offset", ci=ci)).covered
    assert covered.inside is inside


def test_a_hidden_zero_is_right_as_a_calibration():
    hidden = {"name": "sensor_offset", "parameters": {"o": 0.0254}, "total_sigma": 50.0}
    zero = reply("named", "sensor_offset")["effects"]
    assert outcome(answer(hidden), reply("none", calibration=zero)) == "right"
    assert outcome(answer(hidden), reply("none", calibration=[])) == "none"


def test_angles_are_covered_whichever_turn_they_are_told_in():
    turn = 2 * math.pi
    for shift in (-turn, 0.0, turn):
        for low, high, inside in ((3.0, 3.2, True), (3.12, 3.3, False), (3.0, 3.1, True)):
            ci = {"phi": {"value": 3.1, "unit": "rad", "ci95": [low + shift, high + shift]}}
            (covered,) = judge("1", answer(OTHER), reply("named", "detent_force", ci=ci)).covered
            assert covered.inside is inside, (low, high, shift)
            assert not covered.main


def test_the_table_counts():
    right = reply("named", "viscous_drag", gap={"before_rms": 3, "after_rms": 1, "noise_rms": 1},
                  seconds=10.0)  # fmt: skip
    cases = [judge(f"{i:03d}", answer(HIDDEN), right) for i in range(49)]
    left = answer(HIDDEN) | {"named_leaves": 24.3}
    cases.append(judge("049", left, reply("named", "hum", seconds=100.0)))
    cases.append(judge("050", answer(group="none"), reply("none")))
    score = Score(tuple(cases), ())
    rows = {row.what: row for row in score.rows()}
    clear = rows["one effect, 20 σ or more: right name or family"]
    assert (clear.count, clear.reached, clear.met) == (50, "98.0% (49 of 50)", True)
    assert rows["one effect, 8 σ or more: a wrong name"].met is False
    assert rows["nothing hidden: none"].met is True
    assert rows["two effects, each 20 σ or more: all right"].met is None
    assert "worst 100.0 s" in rows["time of a case with the laser"].reached
    assert rows["time of a case with the laser"].met is False
    assert [j.number for j in score.wrong()] == ["049"]
    assert score.confusion()["viscous_drag"] == {"right": 49, "wrong: hum": 1}
    text = page(score)
    assert "| 049 | single | laser | viscous_drag | 50 | named | hum | 24 |" in text
    assert json.loads(json.dumps(score.as_json()))["cases"][0]["outcome"] == "right"


def after(first, promised, second):
    """A follow-up of a case that hides a viscous drag."""
    truth = answer(HIDDEN)
    sigmas = {pair_key("viscous_drag", rival): sigma for rival, sigma in promised.items()}
    others = {pair_key("start_delay", "trigger_delay"): 0.1}
    return FollowUp(judge("1", truth, first), sigmas | others, judge("1", truth, second))


def test_alternatives_predicted_to_be_distinguishable_are_counted_one_by_one():
    """Alternatives to the hidden effect count, whichever of the family was named first."""
    family = reply("ambiguous", "trigger_delay", family=["viscous_drag", "start_delay"])
    promised = {"trigger_delay": 8.0, "start_delay": 8.0}
    settled = after(family, promised, reply("named", "viscous_drag"))
    assert (settled.named, settled.all_distinguishable, settled.excluded()) == (
        True,
        True,
        [True, True],
    )
    halved = reply("ambiguous", "viscous_drag", family=["trigger_delay"])
    assert after(family, promised, halved).excluded() == [True, False]
    half = {"trigger_delay": 0.3, "start_delay": 8.0}
    twins = after(family, half, halved)
    assert (twins.named, twins.all_distinguishable, twins.excluded()) == (False, False, [True])
    wrong = after(family, promised, reply("named", "hum"))
    assert (wrong.named, wrong.excluded()) == (False, [False, False])
    nothing = after(family, {}, {"verdict": "failed"})
    assert (nothing.all_distinguishable, nothing.excluded()) == (False, [])
    score = Score((), (settled, twins, nothing))
    rows = {row.what: row for row in score.rows()}
    every = rows["ambiguous, named once the proposed experiment (if any) is run"]
    assert (every.count, every.reached) == (3, "33.3% (1 of 3)")
    reach = rows["the same, if each alternative was predicted to differ by 6 σ"]
    assert (reach.count, reach.met) == (1, True)
    gone = rows["alternatives predicted to differ by 6 σ: excluded"]
    assert (gone.count, gone.met) == (3, True)
    shown = page(Score((), (settled,)))
    assert "| 1 | laser | viscous_drag | trigger_delay/viscous_drag/start_delay |" in shown
    assert "| start_delay 8, trigger_delay 8 | viscous_drag |" in shown
    assert json.loads(json.dumps(score.as_json()))["followed"][1]["promised"]


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """Two quick cases of the smoke grid, one with nothing hidden."""
    folder = tmp_path_factory.mktemp("ground")
    list(make(1, "smoke", folder, frozenset(["006", "008"])))
    return folder


def answers_of(ground):
    return json.loads((ground / "answers.json").read_text())


def test_the_command_scores_kept_replies(ground, tmp_path):
    for number, case in answers_of(ground)["cases"].items():
        said = reply("named", *(e["name"] for e in case["effects"]))
        said = said if case["effects"] else reply("none")
        (tmp_path / f"{number}.json").write_text(json.dumps(said))
    args = ["score", str(ground), "--answers-from", str(tmp_path), "--report"]
    done = CliRunner().invoke(command, [*args, str(tmp_path / "score.md")])
    assert done.exit_code == 0, done.output
    assert "| nothing hidden: none | ≥ 99% | 1 | 100.0% (1 of 1) | yes |" in done.output
    assert (tmp_path / "score.md").read_text() == done.output
    as_json = CliRunner().invoke(command, [*args[:-1], "--json"])
    assert {c["outcome"] for c in json.loads(as_json.output)["cases"]} == {"right"}


def test_only_some_cases_and_those_must_exist(mopro, ground, tmp_path):
    (tmp_path / "008.json").write_text(json.dumps(reply("none")))
    args = ["score", str(ground), "--answers-from", str(tmp_path), "--json", "--cases"]
    done = CliRunner().invoke(command, [*args, "8"])
    assert [c["number"] for c in json.loads(done.output)["cases"]] == ["008"]
    other = mopro("blind", "score", str(ground), "--cases", "9")
    assert other.returncode == 2
    assert "there is no case 009" in other.stderr


def test_a_proposed_experiment_becomes_one_more_run(ground, tmp_path):
    document = answers_of(ground)
    number, case = next((n, c) for n, c in document["cases"].items() if c["effects"])
    text = "UU012500/1\nVEL1 10.0\nACC1 0.1\nMRI1 3.0\nWX1\nWT100\n"
    file = add_proposed_run(1, number, case, text, ground / number, tmp_path)
    assert file.read_text().count("[[run]]") == 3
    assert (tmp_path / "proposed.CMD").read_text() == text
    rows = (tmp_path / "proposed.csv").read_text().splitlines()
    assert rows[0] == "time_s,position_1_in"
    assert float(rows[-1].split(",")[1]) == pytest.approx(3.0, abs=0.01)
    with pytest.raises(ValueError, match="no statement"):
        add_proposed_run(1, number, case, "SEEK1+\n", ground / number, tmp_path)


def test_bad_input_is_named(mopro, ground, tmp_path):
    nowhere = mopro("blind", "score", str(tmp_path))
    assert nowhere.returncode == 2
    assert "answers.json" in nowhere.stderr
    assert "Traceback" not in nowhere.stderr
    (tmp_path / "answers.json").write_text("{}")
    assert mopro("blind", "score", str(tmp_path)).returncode == 2
    shelf = mopro("blind", "score", str(ground), "--report", str(tmp_path / "missing" / "score.md"))
    assert (shelf.returncode, "Traceback" in shelf.stderr) == (2, False)
    assert "missing" in shelf.stderr
    assert not list(ground.glob("*/verdict.json")), "nothing was asked"
    options = ("--seed", 1, "--grid", "smoke", "--cases", 99, "--out", tmp_path)
    beyond = mopro("blind", "make", *options)
    assert beyond.returncode == 2
    assert "cases 1 to 12" in beyond.stderr


def test_a_case_that_was_changed_is_refused(mopro, ground, tmp_path):
    list(make(1, "smoke", tmp_path, frozenset(["008"])))
    data = tmp_path / "008" / "run1.csv"
    data.write_text(data.read_text().replace("0.0000", "0.0001", 1))
    done = mopro("blind", "score", str(tmp_path))
    assert done.returncode == 2
    assert "run1.csv: not what was made" in done.stderr
