"""The answer at a glance: what it says for each verdict, in words."""

import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from mopro.engine import Estimate, Named, Series, Verdict
from mopro.engine.residuals.remainder import Remainder
from mopro.engine.verdict import BelowResolution, Draft, Gap, OddRun, RunGap
from mopro.errors import DataError
from mopro.experiment.glance import glance_of
from mopro.experiment.system import Proposal, Repaired

DRAG = Named(
    "viscous_drag", "", {"b": Estimate(9.0, "N s/m", (8.5, 9.5), False)}, [], {}, {}, 10.0, 8.0,
    True,
)  # fmt: skip
EITHER = dataclasses.replace(
    DRAG,
    indistinguishable_from=["trigger_delay", "start_delay"],
    rivals={"trigger_delay": 0.25, "start_delay": 4.0},
)
STEPS = dataclasses.replace(
    DRAG, name="lost_steps", parameters={"n": Estimate(3.0, "1", (math.nan, math.nan), False)}
)
DRAFT = Draft("bend", "force", "x", "2 * x**2", "N", 30.0, True)
AS_IT_IS = RunGap("a.csv", "laser", "in", 2e-5, 2e-5, None, 2e-5)
REPAIRED = RunGap("a.csv", "laser", "in", 3e-4, 2e-5, 4e-5, 2e-5)


def glance(word, *effects, runs=(REPAIRED,), counts=(100,), left=None, proposal=None, **more):
    """The glance of a verdict on `runs` of so many samples; `left` is what stays unexplained."""
    terms, repaired = more.pop("terms", {}), Repaired("", (), (), more.pop("fault", None))
    held_out = runs[0].held_out_rms
    gap = Gap("in", runs[0].before_rms, runs[0].after_rms, runs[0].noise_rms, held_out, runs)
    remainder = left or Remainder(False, None, 0.5)
    more.setdefault("held_out_on", "within one run")
    verdict = Verdict(word, effects, (), more.pop("faint", ()), (), gap, remainder, {}, **more)
    data = tuple(
        Series(run.run, run.sensor, run.unit, np.zeros(count), run.noise_rms)
        for run, count in zip(runs, counts, strict=True)
    )
    system = SimpleNamespace(series=data, terms=terms, runs=("a.csv", "b.csv"))
    return glance_of(verdict, system, repaired, proposal, "Measure something else.")


def told(*args, **more):
    return {label: list(map(str, lines)) for label, lines in glance(*args, **more).rows()}


def test_nothing_hidden_is_a_gap_without_a_repair_and_nothing_to_do():
    assert told("none", runs=(AS_IT_IS,)) == {
        "Gap, RMS": ["laser: without a repair 2e-05 in → noise alone 2e-05 in"],
        "Next": ["Nothing is to be repaired."],
    }


def test_an_effect_is_told_with_its_interval_its_gap_and_what_to_try():
    said = told("named", DRAG)
    assert said["Effects"] == ["viscous_drag: b = 9 N s/m (95 %: 8.5 to 9.5)"]
    assert said["Gap, RMS"] == [
        "laser: before the repair 0.0003 in → after the repair 2e-05 in → "
        "held out within one run 4e-05 in → noise alone 2e-05 in"
    ]
    assert "mopro compare UNSEEN.toml --apply MACHINE.toml" in said["Next"][0]
    assert "Cannot tell" not in said


def test_alternatives_are_told_with_what_would_part_them():
    said = told("ambiguous", EITHER)
    assert said["Cannot tell"] == [
        "viscous_drag from trigger_delay (ΔEBIC +0.25), start_delay (ΔEBIC +4)"
    ]
    assert said["Next"] == ["Measure something else."]
    program = Proposal("MRI1 2", "", 1.5, {"trigger_delay": 7.25, "start_delay": 80.0}, {})
    assert told("ambiguous", EITHER, proposal=program)["Next"] == [
        "Run the program under “The next experiment” with 1.5 kg: it should separate "
        "trigger_delay by 7.25 σ, start_delay by 80 σ."
    ]


def test_a_term_that_would_do_as_well_is_beside_the_effect_and_not_told_from_it():
    said = told("ambiguous", DRAG, drafts=(DRAFT,))
    assert said["Effects"][1].startswith("Not listed, would do as well: a term of x in the force")
    assert said["Cannot tell"] == ["viscous_drag from a term that is not listed"]


@pytest.mark.parametrize(
    ("left", "more", "said"),
    [
        ({}, {}, "Look for a cause of this shape"),
        ({"only_size": True}, {}, "State the noise that the data show"),
        (
            {},
            {"drafts": (DRAFT,), "terms": {"bend": None}},
            "Write what is not listed into the machine",
        ),
        ({}, {"drafts": (DRAFT,)}, "Look for a cause of this shape"),
    ],
    ids=["a shape", "the scatter alone", "a term that a file can state", "a term that it cannot"],
)
def test_what_to_do_about_something_unexplained(left, more, said):
    remainder = Remainder(True, "a law of x", 0.0, **left)
    answer = glance("unexplained", runs=(AS_IT_IS,), left=remainder, **more)
    assert answer.sentence.startswith("Unexplained: what is left looks like a law of x")
    assert [line[: len(said)] for line in answer.next] == [said]


def test_a_run_that_alone_disagrees_is_looked_at_first():
    odd = OddRun("b.csv", 40.0, 1.0, "a law of x", "x")
    first, second = told("named", DRAG, odd_run=odd)["Next"]
    assert first.startswith("b.csv disagrees (40 σ)")
    assert second.startswith("Try the machine file")


def test_a_machine_s_file_that_cannot_be_written_is_to_be_mended_first():
    first, second = told("named", DRAG, fault=DataError("w2 was not written"))["Next"]
    assert first.startswith("Mend the machine's file")
    assert second.startswith("Try the machine file")


def test_what_is_no_property_of_the_machine_is_measured_again():
    (said,) = told("named", dataclasses.replace(STEPS, run="c.csv"))["Next"]
    assert said.startswith("Measure again")
    assert told("named", dataclasses.replace(STEPS, run="c.csv"), DRAG)["Next"][0].startswith("Try")


def test_the_gap_of_a_sensor_is_that_of_all_samples_of_its_runs():
    other = dataclasses.replace(REPAIRED, run="b.csv", before_rms=0.0, held_out_rms=None)
    warm = RunGap("a.csv", "wire", "C", 3.0, 1.0, 1.5, None)
    said = told("named", DRAG, runs=(REPAIRED, other, warm), counts=(300, 100, 5))
    assert said["Gap, RMS"] == [
        f"laser, 2 runs: before the repair {3e-4 * math.sqrt(3 / 4):.3g} in → "
        "after the repair 2e-05 in → held out within one run unknown → noise alone 2e-05 in",
        "wire: before the repair 3 K → after the repair 1 K → held out within one run 1.5 K → "
        "noise alone unknown",
    ]
    assert said["Cannot tell"] == ["how much of what is left is noise: its size is unknown"]


def test_samples_that_do_not_count_have_no_weight_in_the_gap():
    wild = np.arange(4) < 3
    one, two = (
        Series(run, "laser", "in", np.zeros(4), 1.0, wild=own)
        for run, own in (("a.csv", None), ("b.csv", wild))
    )
    runs = (RunGap("a.csv", "laser", "in", 1.0, 1.0, None, 1.0),
            RunGap("b.csv", "laser", "in", 2.0, 2.0, None, 1.0))  # fmt: skip
    verdict = Verdict("none", (), (), (), (), Gap("in", 1.0, 1.0, 1.0, None, runs),
                      Remainder(False, None, 0.5), {})  # fmt: skip
    system = SimpleNamespace(series=(one, two), terms={}, runs=())
    (chain,) = glance_of(verdict, system, Repaired("", (), ()), None, "").gap
    assert chain.steps[0].rms == f"{math.sqrt((4 * 1 + 1 * 4) / 5):.3g} in"


def test_what_was_nearly_seen_comes_first_of_what_was_too_faint():
    faint = tuple(BelowResolution(f"effect_{i}", float(i), 9.0) for i in range(8))
    assert told("none", runs=(AS_IT_IS,), faint=faint)["Cannot tell"] == [
        "whether there is effect_7, effect_6, effect_5, effect_4, effect_3, effect_2 and 2 more: "
        "below the resolution of these data"
    ]


@pytest.mark.parametrize(
    ("on", "said"),
    [("other runs", "held out in other runs"), ("within one run", "held out within one run")],
)  # fmt: skip
def test_what_the_held_out_figure_is_of_is_told(on, said):
    (chain,) = glance("named", DRAG, held_out_on=on).gap
    assert [str(step) for step in chain.steps][2] == f"{said} 4e-05 in"


def test_the_json_has_the_words_of_the_lines():
    answer = json.loads(json.dumps(glance("named", DRAG).as_json()))
    assert answer["verdict"] == "named"
    assert answer["effects"] == [
        {"effect": "viscous_drag", "sizes": ["b = 9 N s/m (95 %: 8.5 to 9.5)"]}
    ]
    assert answer["gap"][0]["steps"][0] == {"of": "before the repair", "rms": "0.0003 in"}
