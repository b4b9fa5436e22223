"""Hypothesis strategies: profiles, program texts as people write them, programs."""

from __future__ import annotations

from dataclasses import fields
from fractions import Fraction
from typing import get_type_hints

from hypothesis import strategies as st

import mopro
from mopro.language import ast
from mopro.language.parse import statement_kinds
from mopro.motion import Profile, plan_profile
from mopro.program import Program
from mopro.program.statements import decimal

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
