"""What the states of a run mean for its end: all sequences, contradictions, another controller."""

from dataclasses import replace

import pytest

import mopro
from helpers.bench_of_link import DIALECTS, SHORT, bench
from helpers.endings import trial
from helpers.model_of_controller import sequences, told
from mopro.link import load_dialect
from mopro.link.course import TABLE, Awaited, Course, Step, contradiction
from mopro.link.dialect import STATES

AT_REST = [state for state in STATES if state not in ("running", "stopping")]


def without_run_for(dialect):
    """A dialect whose loops are cut by a stop of the host."""
    language = load_dialect(dialect)
    known = {key: s for key, s in language.statements.items() if key != "run_for"}
    return replace(language, statements=known)


LANGUAGES = [*map(load_dialect, DIALECTS), *map(without_run_for, DIALECTS)]


@pytest.mark.parametrize("looping", [False, True], ids=["whole", "cut"])
@pytest.mark.parametrize("language", LANGUAGES, ids=lambda d: f"{d.name}, {d.knows('run_for')}")
def test_no_sequence_of_words_leaves_motion_or_tells_a_cut_run_as_whole(language, looping):
    """`bench/endings.py --words 5` has all sequences of five."""
    ends = 0
    for said, ended in sequences(3, language, looping):
        assert not ended.still_moves, said
        assert ended.is_complete or ended.trouble is not None, said
        ends += ended.trouble is None
    assert ends > 0, "the truth alone is told as a whole run"
    assert told((), language, looping).trouble is None


@pytest.mark.parametrize("word", STATES)
@pytest.mark.parametrize("dialect", DIALECTS)
def test_one_odd_word_between_two_of_a_run_is_trouble(dialect, word):
    """Also a stop is sent. A word that no dialect file has is damage, and asked for again."""
    language = load_dialect(dialect)
    ended = told(["running", word], language)
    if word == "running" or word not in language.states:
        assert ended.trouble is None
    else:
        assert "stop: sent and acknowledged" in ended.trouble


@pytest.mark.parametrize("kind", ["odd status word", "another controller"])
@pytest.mark.parametrize("seed", [3, 4])
def test_on_a_line_with_bytes_too(kind, seed):
    assert not trial(kind, seed).failures


@pytest.mark.parametrize("awaited", Awaited)
def test_a_state_of_rest_stays(awaited):
    for before in AT_REST:
        for now in STATES:
            assert (contradiction(before, now) is None) == (before == now)
    assert contradiction("stopping", "running")
    assert contradiction("stopping", "done")
    course = Course(awaited, 1.0)
    assert course.see("stopping", 0.5) is Step.GO_ON
    assert isinstance(course.see("running", 0.6), str)


@pytest.mark.parametrize(("awaited", "word"), [("PROGRAM", "done"), ("CUT", "expired")])
def test_the_end_asked_for_is_seen_twice_and_not_before_its_time(awaited, word):
    course = Course(Awaited[awaited], 10.0)
    assert course.see("running", 9.0) is Step.GO_ON
    assert course.see(word, 9.9) is Step.GO_ON
    assert course.see(word, 9.95) is Step.GO_ON
    assert course.see(word, 10.0) is Step.END
    early = Course(Awaited[awaited], 10.0)
    assert isinstance(early.see(word, 9.6), str)


def test_a_cut_whose_braking_began_too_early_is_another_ending():
    course = Course(Awaited.CUT, 10.0)
    assert course.see("stopping", 5.0) is Step.GO_ON
    assert "before the planned end" in course.see("expired", 10.5)


def test_every_state_has_an_entry_for_whatever_is_awaited():
    assert all(set(TABLE[awaited]) == set(STATES) for awaited in Awaited)
    ends = {(a, s) for a in Awaited for s in STATES if Step.END in TABLE[a][s]}
    assert ends == {(Awaited.PROGRAM, "done"), (Awaited.CUT, "expired")}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_digit_that_was_damaged_once_ends_no_run(dialect):
    joined = bench(dialect)
    do, samples = joined.station.device.do, []

    def damaged(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        samples.extend([statement] * (statement == "sample"))
        if statement == "sample" and len(samples) == 3:
            return [rows[0] | {"position_2": 900_000}]
        return rows

    joined.station.device.do = damaged
    recording = joined.run(mopro.compile(SHORT))
    assert recording.run.trouble is None
    assert abs(recording["command_2_m"]).max() == 0


def test_a_controller_that_is_faster_by_its_own_word_is_in_time():
    """As `mopro serve --speed` does."""
    joined = bench()
    joined.station.device.speed = 1000.0
    trouble = joined.run(mopro.compile(SHORT)).run.trouble
    assert trouble is None


@pytest.mark.parametrize("late_s", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_answer_to_the_start_that_comes_late_makes_no_end_early(dialect, late_s):
    joined = bench(dialect)
    injector, reply = joined.station.injector, joined.station.injector.reply

    def late(data):
        started = joined.station.device.state == "running" and not waited
        if started:
            waited.append(late_s)
        return (late_s, data) if started else reply(data)

    waited = []
    injector.reply = late
    assert (
        joined.run(mopro.compile("UU012500/1\nVEL0 10.0\nACC0 0.1\nWT3000\n")).run.trouble is None
    )
    assert waited == [late_s]


def test_an_answer_to_the_start_that_is_lost_makes_no_end_early():
    joined = bench("checked")
    injector, reply = joined.station.injector, joined.station.injector.reply

    def lost(data):
        first = joined.station.device.state == "running" and not dropped
        dropped.extend([data] * first)
        return (0.0, b"") if first else reply(data)

    dropped = []
    injector.reply = lost
    assert (
        joined.run(mopro.compile("UU012500/1\nVEL0 10.0\nACC0 0.1\nWT3000\n")).run.trouble is None
    )
    assert dropped


@pytest.mark.parametrize("seed", [2, 5, 6])
def test_a_stop_that_another_controller_heard_is_not_confirmed(seed):
    done = trial("another controller", seed)
    assert not done.failures
    assert not done.begun or "NOT CONFIRMED" in done.told


@pytest.mark.parametrize("baud", [300, 1200])
def test_a_slow_line_has_time_to_tell_of_many_moves(baud):
    moves = "MRI1 0.05\nWX1\nMRI1 -0.05\nWX1\n" * 10
    language = load_dialect("checked")
    language = replace(language, line=replace(language.line, baud=baud))
    program = mopro.compile(f"UU012500/1\nVEL1 2.0\nACC1 0.1\n{moves}")
    run = bench(language).run(program).run
    assert run.trouble is None
    assert len(run.moves) == 20
