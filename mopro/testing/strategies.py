"""Hypothesis strategies: profiles, program texts as people write them, programs."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import strategies as st

import mopro
from mopro.motion import Profile, plan_profile
from mopro.program import Program
from mopro.program.text import decimal

_AXES = st.sampled_from("012")
_LABELS = ("B1", "LOOP", "x_2")


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


def _statements() -> st.SearchStrategy[str]:
    """One statement in canonical form but for its numbers."""
    whole = st.integers(1, 99999).map(str)
    any_number, positive = decimals(), decimals(positive=True)
    return st.one_of(
        st.builds("UU{}0{}/{}".format, _AXES, whole, whole),
        st.builds("VEL{} {}".format, _AXES | st.just("O"), positive),
        st.builds("ACC{} {}".format, _AXES | st.just("O"), positive),
        st.builds("PARA{}{}".format, _AXES, st.sampled_from("+-")),
        st.builds("MRI{} {}".format, _AXES, any_number),
        st.builds("MR{} {}".format, _AXES, any_number),
        st.just("GO"),
        st.builds("WX{}".format, _AXES),
        st.builds("WT{}".format, st.integers(0, 10**6)),
        st.sampled_from(_LABELS).map("JUMP {}".format),
    )


@st.composite
def program_texts(draw: st.DrawFn) -> str:
    """Programs of the attested language with the oddities of DOS files; all compile.

    They need not make sense as motion.
    """
    body = draw(st.lists(_statements(), max_size=20))
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


def programs() -> st.SearchStrategy[Program]:
    """Compiled programs of `program_texts`."""
    return program_texts().map(mopro.compile)
