"""Objects as a person in a notebook meets them: dir(), pages and pictures, words for slips."""

import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import mopro
from helpers.paths import PROGRAMS
from mopro.engine import Candidate, Parameter, Series
from mopro.experiment.comparison import Comparison

ODD = "<script>alert('1')</script>&\x1b\u202e"
TEXT = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 1.0\nWX1\n"


class Tags(HTMLParser):
    """The tags of a fragment; each that is opened is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.seen = [], set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def program():
    return mopro.compile(TEXT, "P.CMD")


@pytest.fixture(scope="module")
def recording(program):
    return mopro.emulate(program)


@pytest.fixture(scope="module")
def verdict():
    times = np.linspace(0.0, 1.0, 200)
    noise = 0.1 * np.random.default_rng(1).standard_normal(200)

    def simulate(settings):
        return [settings.get(ODD, {}).get("b", 0.0) * np.sin(9 * times)]

    effects = [Candidate(ODD, (Parameter("b", "N", -9, 9, starts=(1.0,)),))]
    measured = simulate({ODD: {"b": 3.0}})[0] + noise
    return mopro.reconcile(simulate, effects, [Series(ODD, ODD, "N", measured, 0.1, times)])


def test_dir_lists_the_public_names_and_each_is_there():
    code = (
        "import sys, mopro\nnames = [n for n in dir(mopro) if not n.startswith('_')]\n"
        "assert names == mopro.__all__, names\n"
        "assert not {'numpy', 'matplotlib'} & set(sys.modules)\n"
        "for name in names: getattr(mopro, name)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_wrong_name_is_answered_with_the_right_ones():
    with pytest.raises(AttributeError, match=r"no attribute 'emulat': its names are .*, emulate,"):
        _ = mopro.emulat


def test_objects_show_themselves_as_well_formed_html(program, recording, verdict):
    comparison = mopro.open_experiment(PROGRAMS / "thermal" / "experiment.toml").compare()
    machine = mopro.load_machine("chow1992").with_effects({"viscous_drag": {"b": 9.0}})
    for shown, words in (
        (program, "MRI1 1.0"), (recording, "1 move in"), (comparison, "disagreement"),
        (machine, "pull_out_force"), (verdict, "Verdict: named"),
    ):  # fmt: skip
        text = shown._repr_html_()
        assert words in text
        assert Tags(text).seen <= {"div", "strong", "p", "pre", "table", "thead", "tbody", "tr",
                                   "th", "td"}  # fmt: skip


def test_no_text_of_others_becomes_markup(recording, verdict):
    program = mopro.compile("; " + ODD[:-2] + "\n" + TEXT, ODD)
    run = replace(recording.run, program=ODD)
    odd = replace(recording, header=replace(recording.header, program=ODD), run=run)
    place_free = Comparison(ODD, (), ())
    for shown in (program, odd, verdict, place_free):
        text = shown._repr_html_()
        assert "<script" not in text
        assert "&lt;script&gt;" in text
        assert "\x1b" not in text
        assert "\u202e" not in text


def test_long_lists_are_cut_and_it_is_said(recording):
    (move,) = recording.run.moves
    moves = tuple(replace(move, line=line % 20) for line in range(500))
    text = replace(recording, run=replace(recording.run, moves=moves))._repr_html_()
    assert ">19 × 25</td>" not in text
    assert ">7 × 25</td>" in text
    assert "… and 8 more" in text
    assert len(text) < 10_000
    assert "… and 61 more lines" in mopro.compile("\n".join(["GO"] * 101))._repr_html_()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p, r: mopro.emulate(TEXT), "expects a Program, not str: mopro.compile"),
        (lambda p, r: mopro.emulate(p, machine=3), "machine is int: expected a built-in name"),
        (lambda p, r: mopro.emulate(p, effects=["backlash"]), r'\{"viscous_drag": \{"b": 9.0\}\}'),
        (lambda p, r: mopro.emulate(p, effects={"backlash": 1}), "names with their parameters"),
        (lambda p, r: mopro.compile(PROGRAMS / "LVDT3.CMD"), "compile_file"),
    ],
)
def test_arguments_of_another_kind_get_words(call, words, program, recording):
    with pytest.raises(TypeError, match=words):
        call(program, recording)


def test_a_mistyped_column_names_the_nearest_and_all(recording):
    with pytest.raises(KeyError) as caught:
        _ = recording["positon_1_m"]
    words = "there is no column 'positon_1_m': did you mean 'position_1_m'? There are time_s, "
    assert str(caught.value).startswith(words)
    with pytest.raises(KeyError, match=re.escape("no column 0. There are")):
        _ = recording[0]
    assert len(repr(recording)) < 2000
