"""Runs that end early: the table of moves agrees with the last line that is told as completed."""

import re
from dataclasses import replace
from random import Random

import pytest

import mopro
from helpers.bench_of_link import SHORT, Hasty, Impatient, bench, without
from mopro.controller.faults import Fault, PlantFault
from mopro.link import load_dialect
from mopro.link.template import Template
from mopro.motion import plan

PARTS = {
    "move": "MRI1 {0}\nWX1\nMRI1 -{0}\nWX1\n",
    "wait in a move": "MRI1 {0}\nWT{1}\nWX1\nMRI1 -{0}\nWX1\n",
    "go": "MR1 {0}\nMR2 0.5\nGO\nWX0\nMR1 -{0}\nMR2 -0.5\nGO\nWX1\nWX2\n",
    "both": "MRI0 {0}\nWX0\nMRI0 -{0}\nWX2\n",
    "one within the other": "MRI1 {0}\nWT20\nMRI2 0.1\nWX0\nMRI2 -0.1\nMRI1 -{0}\nWX0\n",
    "wait": "WT{1}\n",
}
LANGUAGES = {
    "checked": load_dialect("checked"),
    "plain": load_dialect("plain"),
    "no account": without("checked", "moves"),
    "nothing measured": without("plain", "moves", "sample", "measured"),
    "cut by the host": without("plain", "moves", "run_for"),
}
ENDS = ("interrupted", "lost", "reset", "limit", "overheated", "stopped by another", "deadline")
FOR_S = 12.0


def written(random):
    """A program of one to four parts, or one that repeats them for ever."""
    chosen = random.choices(list(PARTS), k=random.randint(1, 4))
    parts = [PARTS[p].format(random.choice((0.5, 1, 3)), random.randint(1, 400)) for p in chosen]
    text = f"WT{random.randint(1, 200)}\n" + "".join(parts)
    loop = random.random() < 0.6
    around = (":A\n", "JUMP A\n") if loop else ("", "")
    return mopro.compile(f"UU012500/1\nVEL0 8.0\nACC0 0.25\n{around[0]}{text}{around[1]}")


def ended_early(program, language, end, at_s, speed):
    """The run of a program that `end` ends, about `at_s` after its start."""
    # The program has been stored and started by then.
    then_s = at_s + 1.0 + 0.1 * len(program.ops)
    faults = {"lost": Fault("disconnect", at_s=then_s, for_s=1e6),
              "reset": Fault("reset", at_s=then_s, for_s=0.2)}  # fmt: skip
    plant = {"limit": PlantFault("limit", at_s), "overheated": PlantFault("overheated", at_s)}
    chosen = [faults[end]] if end in faults else []
    joined = bench(language, *chosen, plant=[plant[end]] if end in plant else [], opened=False)
    if speed != 1:
        joined.session.port = Hasty(joined, speed)
    joined.session.give(120.0)
    joined.session.open()
    if end == "interrupted":
        joined.session.port = Impatient(joined.session.port, then_s / speed)
    if end == "stopped by another":
        stop_at(joined.station, then_s)
    options = {"deadline_s": then_s / speed + 9} if end == "deadline" else {}
    return joined.run(program, FOR_S if program.loops_forever else None, **options).run


def stop_at(station, at_s):
    heard, waiting = station.hear, [at_s]

    def hear(data, now_s):
        if waiting and now_s > waiting[0]:
            waiting.clear()
            station.device.do("stop", {}, now_s)
        return heard(data, now_s)

    station.hear = hear


def agree(schedule, run):
    """True if there is a time by which the told line is completed and the told moves began."""
    line = re.search(r"last completed: (?:line (\d+)|nothing)", run.trouble)[1]
    if line and int(line) in {move.line for move in run.moves if not move.complete}:
        return False
    times = {t for m in schedule.moves for t in (m.start_s, m.end_s)}
    times |= {t for t, _ in schedule.activity}
    near = (t + step for t in times for step in (-1e-9, 0.0, 1e-9))
    return any(
        schedule.lines_at(t)[1] == (int(line) if line else None)
        and sum(move.start_s <= t for move in schedule.moves) == len(run.moves)
        for t in near
    )


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("speed", [1, 4])
def test_the_moves_agree_with_the_last_completed_line(end, language, speed):
    random = Random(f"{end}, {language}, {speed}")
    program = written(random)
    run = ended_early(program, LANGUAGES[language], end, random.uniform(0, 4), speed)
    if run.trouble:
        schedule = plan(program, FOR_S if program.loops_forever else None)
        assert agree(schedule, run), (program.source.text, run.trouble, len(run.moves))


def test_a_line_whose_motion_is_under_way_is_not_completed():
    program = mopro.compile("UU012500/1\nVEL0 8.0\nACC0 0.25\nMRI1 3\nWT20\nMRI2 0.1\nWX0\n")
    schedule = plan(program)
    first, second = schedule.moves
    assert schedule.lines_at(second.start_s) == (6, None)
    assert schedule.lines_at(second.end_s) == (4, 6)
    assert schedule.lines_at(first.end_s) == (None, 4)


def test_a_status_without_completed_lines_tells_of_none():
    language = load_dialect("plain")
    joined = bench(replace(language, replies={**language.replies, "status": Template("{state}")}))
    joined.session.port = Impatient(joined.session.port, 2.0)
    run = joined.run(mopro.compile(SHORT.replace("2.0", "12.0"))).run
    assert "last completed" not in run.trouble
    assert run.moves
