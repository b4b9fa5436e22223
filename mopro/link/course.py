"""The course of a run: what each state that the controller reports means for the run's end.

`TABLE` has a row for each thing that the host may wait for and each state, with what follows
before its time and at it. The order of states counts too: a controller that runs, brakes or has
ended does not go back (`contradiction`). docs/link.md shows the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from mopro.errors import LinkError
from mopro.link.dialect import STATES

UNDER_WAY = ("running", "stopping")


class Awaited(Enum):
    """The end of a run as it was asked for."""

    PROGRAM = "the program's end"
    CUT = "the controller's own cut (`run_for`)"
    HOST = "the host's cut by a stop"


class Step(Enum):
    """The next act of the host; every other entry of the table is trouble, in words."""

    GO_ON = "go on"
    # To be seen once more, not before the planned end.
    END = "end"
    STOP = "stop"


Entry = Step | str


class Contradiction(LinkError):
    """A state or a position that does not belong to this run, or that ends it unasked."""

    rule = "contradiction"


# Assumed: both clocks are ceramic resonators or better, which are off by less than 1 % each.
_CLOCKS_APART = 0.02
# The start and the state are each known to within an answer on a slow line.
_ANSWERS_S = 0.1

_GO_ON, _END, _STOP = Step.GO_ON, Step.END, Step.STOP
_EARLY = (
    "the controller says `{}` before the planned end: is it another controller, or a virtual one "
    "of another --speed whose dialect has no statement `speed`?"
)
_NOT_ASKED = "the controller says `{}`, which this run cannot end with: is it another controller?"
# Causes that end a run whenever they come.
CAUSES = {
    "idle": "the controller knows of no run: it was reset, or it is another controller",
    "stopped": "the controller was told to stop by someone else",
    "limit": "a limit switch opened",
    "overheated": "the motor is overheated",
    "silent": "the controller heard nothing from this computer and stopped by itself",
}


def _row(**entries: tuple[Entry, Entry]) -> Mapping[str, tuple[Entry, Entry]]:
    """Entries before their time and at it by state; a state not named ends no such run."""
    causes: dict[str, tuple[Entry, Entry]] = {s: (text, text) for s, text in CAUSES.items()}
    row = causes | {"stopping": (_GO_ON, _GO_ON)} | entries
    return {state: row.get(state, (_NOT_ASKED.format(state),) * 2) for state in STATES}


TABLE: Mapping[Awaited, Mapping[str, tuple[Entry, Entry]]] = {
    Awaited.PROGRAM: _row(running=(_GO_ON, _GO_ON), done=(_EARLY.format("done"), _END)),
    Awaited.CUT: _row(running=(_GO_ON, _GO_ON), expired=(_EARLY.format("expired"), _END)),
    Awaited.HOST: _row(running=(_GO_ON, _STOP)),
}


def contradiction(before: str, after: str) -> str | None:
    """Why a controller that was in the state `before` cannot be in `after`; None if it can.

    A running one may do anything, a braking one ends in a state of rest, but not at the program's
    end, and a state of rest stays.
    """
    may_follow = before == after or before == "running"
    may_follow |= before == "stopping" and after not in ("running", "done")
    if may_follow:
        return None
    return f"the controller says `{after}` after `{before}`, which contradicts: is it another one?"


class Course:
    """The states of one run as the host sees them.

    `due_s` is the planned time of what is `awaited`, in seconds of the host's clock from the
    start.
    """

    def __init__(self, awaited: Awaited, due_s: float) -> None:
        self._awaited = awaited
        self._due_s = due_s
        self._earliest_s = due_s * (1 - _CLOCKS_APART) - _ANSWERS_S
        self._state = "running"
        # When the present state, or the braking that led to it, was first seen.
        self._since_s = 0.0

    def see(self, state: str, at_s: float, most_s: float | None = None) -> Entry:
        """The entry for `state`, seen `at_s` seconds after the start: a step, or trouble in words.

        `most_s` (s) is how long ago the run may have begun, where its answer came late.
        """
        if trouble := contradiction(self._state, state):
            return trouble
        seen_before = state == self._state
        if not seen_before and self._state != "stopping":
            self._since_s = at_s if most_s is None else most_s
        self._state = state
        moment_s = at_s if state == "running" else self._since_s
        early = moment_s < (self._due_s if state == "running" else self._earliest_s)
        entry = TABLE[self._awaited][state][0 if early else 1]
        if entry is _END and not (seen_before and at_s >= self._due_s):
            return _GO_ON
        return entry

    def may_rest_in(self, state: str, most_s: float) -> bool:
        """True if the controller of this run may rest in `state` after a stop.

        One that knows of no run, or whose run has ended before it can have, is another one.
        """
        if state in ("done", "expired"):
            return TABLE[self._awaited][state][1] is _END and most_s >= self._earliest_s
        return state != "idle"
