"""Hypothesis strategies and invariants for tests of mopro and of packages built on it.

Needs Hypothesis, which `mopro[test]` installs. Strategies: profiles, program texts as people write
them, programs.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import fields
from fractions import Fraction
from itertools import pairwise
from typing import get_type_hints

from hypothesis import strategies as st

import mopro
from mopro.language import ast
from mopro.language.parse import statement_kinds
from mopro.motion import Profile, plan_profile
from mopro.motion.profile import State
from mopro.program import Program
from mopro.program.statements import decimal

__all__ = ["check_profile", "profiles", "program_texts", "programs"]

_AXES = st.sampled_from("012O")
_LABELS = ("B1", "LOOP", "x_2")
# Statements that are refused with an operand of 0, or below.
_NOT_ZERO = (ast.Units, ast.Velocity, ast.Acceleration, ast.Seek)


def profiles(parabolic: bool | None = None) -> st.SearchStrategy[Profile]:
    """Profiles of any shape, with sizes over nine decades, and those at a change of shape."""
    size = st.floats(1e-3, 1e6)
    kind = st.booleans() if parabolic is None else st.just(parabolic)
    free = st.builds(plan_profile, size, size, size, kind)
    return st.one_of(free, st.builds(_at_change_of_shape, size, size, kind))


def _at_change_of_shape(velocity: float, acceleration: float, parabolic: bool) -> Profile:
    """The shortest move that reaches its velocity."""
    distance = (8 / 3 if parabolic else 1) * velocity**2 / acceleration
    return plan_profile(distance, velocity, acceleration, parabolic)


def decimals(positive: bool = False) -> st.SearchStrategy[str]:
    """Numbers as programs write them."""
    tenths = st.integers(1 if positive else -(10**6), 10**6)
    exact = st.builds(lambda n, d: decimal(Fraction(n, 10**d)), tenths, st.integers(0, 5))
    return exact | st.sampled_from(("15.", ".5", "8", "+2.50") + (() if positive else ("-.25",)))


def _statements(grammar: str) -> st.SearchStrategy[str]:
    """One statement of `grammar` in canonical form but for its operands; no labels."""
    kinds = [kind for kind in statement_kinds(grammar) if kind is not ast.Label]
    return st.one_of(*map(_statement, kinds))


def _statement(kind: type[ast.Statement]) -> st.SearchStrategy[str]:
    types = get_type_hints(kind)
    of_type: dict[type[ast.Operand], st.SearchStrategy[str]] = {
        ast.Axis: _AXES,
        ast.Number: decimals(positive=kind in _NOT_ZERO),
        ast.Whole: st.builds(
            "{}{}".format, st.sampled_from(("", "0")), st.integers(kind in _NOT_ZERO, 10**6)
        ),
        ast.Switch: st.sampled_from("+-"),
        ast.Name: st.sampled_from(_LABELS),
    }
    operands = [of_type[types[field.name]] for field in fields(kind) if field.name != "span"]
    return st.builds(kind.layout.format, *operands)


@st.composite
def program_texts(draw: st.DrawFn, grammar: str = "attested") -> str:
    """Programs of the language with the oddities of DOS files; all compile.

    They need not make sense as motion.
    """
    body = draw(st.lists(_statements(grammar), max_size=20))
    for label in _LABELS:
        body.insert(draw(st.integers(0, len(body))), f":{label}")
    end = draw(st.sampled_from(("\n", "\r\n", "\r")))
    lines = [draw(_dressed(statement)) for statement in body]
    return end.join(lines) + draw(st.sampled_from(("", end, end + end)))


def _dressed(statement: str) -> st.SearchStrategy[str]:
    """The statement in either letter case, indented, and with a comment or none."""
    blank = st.sampled_from(("", " ", "\t", " \f"))
    comment = st.one_of(
        st.just(""),
        st.text(st.characters(codec="cp437", exclude_characters="\n\r\x1a\0"), max_size=20).map(
            ";{}".format
        ),
    )
    case = st.sampled_from((str, str.lower, str.upper))
    return st.builds(
        lambda before, letters, after, note: before + letters(statement) + after + note,
        blank, case, blank, comment,
    )  # fmt: skip


def programs(grammar: str = "attested") -> st.SearchStrategy[Program]:
    """The programs that `program_texts` compile to."""
    return program_texts(grammar).map(lambda text: mopro.compile(text, grammar=grammar))


# -- invariants of velocity profiles of any shape ---------------------------------------------

# Rounding of a few operations on numbers of the profile's own size, and of a time.
_ROUNDING = 1e-9
_TIME_ROUNDING = 4 * sys.float_info.epsilon


def check_profile(profile: Profile, fractions: Iterable[float] = (0.1, 0.37, 0.5, 0.81)) -> None:
    """Raise AssertionError naming the invariant that `profile` breaks.

    A profile ends exactly on its target and at rest, exceeds neither its velocity nor its
    acceleration nor its peak, is continuous where its segments join, and is symmetric in time.
    `fractions` are the times at which this is checked, as parts of the duration.
    """
    end = profile.state(profile.duration_s)
    _hold(end.position == profile.distance, "does not end on its target")
    _hold(end.velocity == 0, "does not end at rest")
    _hold(profile.state(0.0).position == 0, "does not begin at 0")
    segments = profile.segments()
    for before, after in pairwise(segments):
        _hold(before.end_s == after.start_s, "has a gap in time")
        left, right = before.state(before.end_s), after.state(after.start_s)
        _hold(_close(left.position, right.position, profile.distance), "jumps in position")
        _hold(_same_velocity(profile, left, right), "jumps in velocity")
    for fraction in fractions:
        _check_at(profile, fraction * profile.duration_s)


def _check_at(profile: Profile, t: float) -> None:
    state, mirrored = profile.state(t), profile.state(profile.duration_s - t)
    v_most, a_most = profile.velocity, profile.acceleration
    _hold(-_ROUNDING * v_most <= state.velocity <= v_most * (1 + _ROUNDING), "exceeds its velocity")
    _hold(state.velocity <= profile.peak_velocity * (1 + _ROUNDING), "exceeds its peak velocity")
    _hold(abs(state.acceleration) <= a_most * (1 + _ROUNDING), "exceeds its acceleration")
    whole = state.position + mirrored.position
    _hold(_close(whole, profile.distance, profile.distance), "is not symmetric in position")
    _hold(_same_velocity(profile, state, mirrored), "is not symmetric in velocity")


def _same_velocity(profile: Profile, one: State, other: State) -> bool:
    rounding = profile.acceleration * profile.duration_s * _TIME_ROUNDING
    rounding += _ROUNDING * profile.peak_velocity
    return abs(one.velocity - other.velocity) <= rounding


def _close(a: float, b: float, scale: float) -> bool:
    return math.isclose(a, b, rel_tol=0, abs_tol=_ROUNDING * max(abs(scale), abs(a)))


def _hold(holds: bool, broken: str) -> None:
    if not holds:
        raise AssertionError(f"the profile {broken}")
