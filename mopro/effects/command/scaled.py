"""Exact multiples of a program's numbers."""

from __future__ import annotations

from fractions import Fraction


def scaled(value: Fraction, e: float) -> Fraction:
    """`value` and the share `e` of it more."""
    return value * (1 + Fraction(e))
