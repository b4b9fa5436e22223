"""The second reader of programs against mopro's own, and profiles against closed forms."""

import math

import pytest

from helpers.paths import PROGRAMS
from mopro import compile as compile_program
from mopro.blind.reference.listing import duration_s, profile_segments, timeline
from mopro.blind.reference.motor import INCH_M, THESIS
from mopro.language.load import load
from mopro.motion import plan

FILES = sorted(PROGRAMS.rglob("*.CMD"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_both_readers_see_the_same_moves(file):
    text = load(file).text
    until_s = 60.0
    ours = timeline(text, until_s=until_s)
    theirs = plan(compile_program(text), until_s)
    strokes = [(m, s) for m in theirs.moves for s in m.strokes if s.length_u]
    strokes = [pair for pair in strokes if pair[0].start_s < until_s]
    assert len(ours.strokes) >= len(strokes) > 0
    for mine, (move, stroke) in zip(ours.strokes, strokes, strict=False):
        assert mine.start_s == pytest.approx(move.start_s, abs=1e-9)
        assert mine.duration_s == pytest.approx(move.profile.duration_s, abs=1e-9)
        assert mine.start_m == pytest.approx(stroke.start_u * THESIS.microstep_m, abs=1e-12)
        assert mine.displacement_m == pytest.approx(stroke.length_u * THESIS.microstep_m, abs=1e-12)
    if theirs.complete:
        assert ours.duration_s == pytest.approx(theirs.duration_s, abs=1e-9)


@pytest.mark.parametrize("parabolic", [False, True])
@pytest.mark.parametrize("distance", [0.1, 1.0, 2.0, 5.0, 15.0])
def test_segments_add_up_to_the_distance_and_end_at_rest(distance, parabolic):
    x = v = 0.0
    for lasts, start_v, a, j in profile_segments(distance, 20.0, 250.0, parabolic):
        assert start_v == pytest.approx(v, abs=1e-9)
        x += lasts * (start_v + lasts * (a / 2 + lasts * j / 6))
        v = start_v + lasts * (a + lasts * j / 2)
    assert x == pytest.approx(distance, rel=1e-12)
    assert v == pytest.approx(0.0, abs=1e-9)


def test_durations_are_those_of_the_corrected_tables():
    assert duration_s(profile_segments(15.0, 40.0, 600.0, True)) == pytest.approx(
        0.463889, abs=1e-6
    )
    assert duration_s(profile_segments(1.0, 40.0, 250.0, False)) == pytest.approx(
        2 * math.sqrt(1 / 250)
    )
    assert duration_s(profile_segments(1.0, 40.0, 250.0, True)) == pytest.approx(math.sqrt(6 / 250))


def test_what_is_no_statement_is_refused():
    with pytest.raises(ValueError, match="line 2"):
        timeline("UU012500/1\nHOME1\n")


def test_a_move_on_a_moving_axis_is_refused():
    with pytest.raises(ValueError, match="while it moves"):
        timeline("UU012500/1\nVEL1 5.0\nACC1 0.1\nMRI1 5.0\nMRI1 5.0\n")


def test_the_letter_o_and_several_statements_on_a_line():
    line = timeline("UU012500/1 VELO 10.0 ACCO 0.1\nMR1 2.0 MR2 -1.0 GO WX1 WX2 WT500")
    assert [s.axis for s in line.strokes] == [1, 2]
    assert line.strokes[1].displacement_m == pytest.approx(-1.0 * INCH_M)
    assert line.strokes[0].duration_s == line.strokes[1].duration_s
    assert line.duration_s == pytest.approx(line.strokes[0].duration_s + 0.5)
