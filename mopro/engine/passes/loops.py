"""Passes that leave a trace, sequences of passes, and loops of passes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mopro.engine.state import State

Pass = Callable[[State], State]


@dataclass(frozen=True)
class Traced:
    """A pass: `change` on a copy of the state; the state it is given stays as it was.

    The answer's trace says what the pass did.
    """

    change: Pass

    @property
    def __name__(self) -> str:
        return self.change.__name__

    def __call__(self, state: State) -> State:
        return self.change(state.own()).traced(self.__name__, state)


def a_pass(change: Pass) -> Traced:
    """Decorator of a function from state to state that is a pass."""
    return Traced(change)


@dataclass(frozen=True)
class Loop(ABC):
    """A pass that takes `passes`, once or more."""

    passes: tuple[Pass, ...]

    @abstractmethod
    def __call__(self, state: State) -> State:
        """The state after the last of them."""


def in_turn(passes: Sequence[Pass], state: State) -> State:
    """The state after `passes`, each from where the one before has led."""
    for each in passes:
        known = each if isinstance(each, Traced | Loop) else Traced(each)
        state = known(state)
    return state


@dataclass(frozen=True)
class _UntilStable(Loop):
    def __call__(self, state: State) -> State:
        while True:
            before = state.fit.key
            state = in_turn(self.passes, state)
            if state.fit.key == before:
                return state


def until_stable(*passes: Pass) -> Loop:
    """`passes` in turn, again and again until the effects of the answer stay."""
    return _UntilStable(passes)


@dataclass(frozen=True)
class _Where(Loop):
    holds: Callable[[State], bool]

    def __call__(self, state: State) -> State:
        return in_turn(self.passes, state) if self.holds(state) else state


def where(holds: Callable[[State], bool], *passes: Pass) -> Loop:
    """`passes` in turn where `holds` is true of the state."""
    return _Where(passes, holds)
