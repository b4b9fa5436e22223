"""The work of lint grows with the number of lines: counted in calls, not in seconds."""

import difflib
import importlib
import sys

import pytest

from mopro.lint import Settings, lint
from mopro.lint import stall_margins as margins
from mopro.motion import plan
from mopro.motion.track import Track
from mopro.program.compile import compile as compile_text
from mopro.source import Source

HEAD = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
LINES = 120


LOWER = importlib.import_module("mopro.program.lower")


def back_and_forth(count):
    return "".join(f"MRI1 {(-1) ** n * (1 + n / 10_000):.4f} ; {n}\nWX1\n" for n in range(count))


def unawaited(count):
    return "".join(f"MRI1 1.{n}\n" for n in range(count))


def without_labels(count):
    return "".join(f":B{n}\nWT{n + 1}\nJUMP C{n}\n" for n in range(count))


def turned_endless(count):
    return "".join(f"MC1 {n % 9 + 1}.5\nWT{200 + n}\nST1\nWX1\n" for n in range(count))


def calls(work):
    """Calls of functions in `work`."""
    counted = 0

    def count(frame, event, argument):
        nonlocal counted
        counted += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
    return counted


@pytest.mark.parametrize("text", [back_and_forth, unawaited], ids=lambda text: text.__name__)
def test_calls_grow_with_the_number_of_lines(text):
    def linted(count):
        return calls(lambda: lint(Source("P.CMD", HEAD + text(count))))

    linted(LINES)  # what is made once
    few, many = linted(LINES), linted(4 * LINES)
    assert many < 1.15 * 4 * few


class Watched(list):
    """A list that counts how many of its items are looked at."""

    looked_at = 0

    def __iter__(self):
        return self._counted(super().__iter__())

    def __reversed__(self):
        return self._counted(super().__reversed__())

    @classmethod
    def _counted(cls, items):
        for item in items:
            cls.looked_at += 1
            yield item


def test_the_end_of_an_endless_motion_looks_at_that_motion_alone(monkeypatch):
    monkeypatch.setattr(Watched, "looked_at", 0)
    monkeypatch.setattr(Track, "__init__", lambda track: setattr(track, "segments", Watched()))
    plan(compile_text(HEAD + turned_endless(LINES), grammar="extended"))
    assert 2 * LINES <= Watched.looked_at <= 6 * LINES


def test_labels_are_compared_up_to_a_bound(monkeypatch):
    asked = []
    monkeypatch.setattr(difflib, "get_close_matches", lambda key, *_, **__: asked.append(key) or [])
    monkeypatch.setattr(LOWER, "_MOST_COMPARED", 10 * LINES)
    found = lint(Source("P.CMD", without_labels(LINES)))
    assert len(asked) == 10
    assert len([f for f in found if f.rule == "unknown-label"]) == LINES


def test_proposals_are_emulated_up_to_a_bound(monkeypatch):
    asked = []

    def emulated(laden, motions, compiled=None):
        asked.append(motions)
        return tuple((0.5, False) for _ in motions)

    monkeypatch.setattr(margins, "emulated", emulated)
    monkeypatch.setattr(margins, "MOST_EMULATED_S", 20.0)
    only = Settings(select=frozenset({"slower-than-needed"}))
    found = lint(Source("P.CMD", HEAD + back_and_forth(LINES)), only)
    assert 10 < len(asked) < 20
    assert f"from here on {LINES - len(asked)} statements" in found[-1].message
    assert found[-1].span.line == 3 + 2 * len(asked) + 1
