"""Kernels composed for sets of effects, plain or compiled, each made once in a process."""

from __future__ import annotations

import functools
import threading
from typing import TypeVar

from mopro.plant.kernel.effect_terms import TermSet
from mopro.plant.kernel.equation_of_motion import parts_of
from mopro.plant.kernel.integrate import Integrate, Rates, integrate_of, rates_of
from mopro.process.garbage import garbage_left

_T = TypeVar("_T")
_ONE_AT_A_TIME = threading.Lock()


def as_it_stands(function: _T) -> _T:
    """Prepare a function for plain Python: return it unchanged."""
    return function


def kernel(terms: TermSet, nominal: bool, compiled: bool) -> Integrate:
    """`integrate` of a set of effects; plain Python, or the same compiled, with the same bits.

    Two sets are the same if their effects are of the same classes in the same order,
    whatever their values. nominal: nothing is recorded of the drive (see motion.Parts).
    """
    with _ONE_AT_A_TIME:
        return _compiled(terms, nominal) if compiled else _plain(terms, nominal)


@functools.cache
def rates(terms: TermSet) -> Rates:
    """Rates of change of the state under a set of effects, in plain Python."""
    return rates_of(parts_of(terms, False, as_it_stands))


@functools.cache
def _plain(terms: TermSet, nominal: bool) -> Integrate:
    return integrate_of(parts_of(terms, nominal, as_it_stands), as_it_stands)


@functools.cache
def _compiled(terms: TermSet, nominal: bool) -> Integrate:
    # numba makes so many objects that searching them for garbage would take a sixth.
    with garbage_left():
        from mopro.plant.kernel.compiled import compiled

        return compiled(terms, nominal, _plain(terms, nominal))
