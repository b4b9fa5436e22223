"""Answers of the diagnosis, and in what two of them differ."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mopro.engine.verdict import Estimate, Verdict
from mopro.errors import DataError, SourceError
from mopro.experiment.conclusion import diagnose
from mopro.experiment.opened import open_experiment
from mopro.formula import factor_of

Names = frozenset[str]
NAMES, WORD, NUMBERS, REFUSED = "names", "word", "numbers", "refused"
# Changes under which the signs of numbers turn, the parts of a wave share its size anew, or numbers
# may be others.
_TURNED, _ANY_NUMBERS = ("sign",), ("twice",)
_REPHASED = ("sign", "time", "place")


@dataclass(frozen=True)
class Number:
    """A number of an effect with its 95 % interval, in SI."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, estimate: Estimate) -> Number:
        factor = factor_of(estimate.unit or "1")
        return cls(estimate.value * factor, *(end * factor for end in estimate.ci95))


@dataclass(frozen=True)
class Answer:
    """What was told of an experiment: the verdict's word, the names, and those that do as well.

    `numbers`: of each effect and parameter. `sigmas`: size of each effect. `took_s`: seconds.
    `refused`: the reason, where there is no verdict.
    """

    word: str
    names: Names = frozenset()
    as_well: frozenset[Names] = frozenset()
    numbers: Mapping[tuple[str, str], Number] | None = None
    sigmas: Mapping[str, float] | None = None
    took_s: float = 0.0

    @classmethod
    def of(cls, verdict: Verdict, took_s: float) -> Answer:
        return cls(
            verdict.verdict,
            frozenset(effect.name for effect in verdict.effects),
            frozenset(map(frozenset, verdict.alternatives)),
            {
                (effect.name, name): Number.of(estimate)
                for effect in verdict.effects
                for name, estimate in effect.parameters.items()
            },
            {effect.name: effect.sigmas for effect in verdict.effects},
            took_s,
        )

    def __str__(self) -> str:
        sizes = self.sigmas or {}
        names = [f"{name} ({sizes.get(name, 0):.3g} σ)" for name in sorted(self.names)]
        others = [" + ".join(sorted(own)) for own in sorted(self.as_well, key=sorted)]
        shown = f"{self.word}: {', '.join(names) or 'no name'}"
        return f"{shown} (or {'; or '.join(others)})" if others else shown


def answered(path: Path) -> Answer:
    """The answer on the experiment in file `path`, as a user would ask."""
    begun = time.perf_counter()
    try:
        verdict = diagnose(open_experiment(path, allow_python=True).system)[1]
    except (SourceError, DataError) as error:
        return Answer(f"{REFUSED}: {str(error).strip().splitlines()[0]}")
    return Answer.of(verdict, time.perf_counter() - begun)


def differences(one: Answer, other: Answer, change: str) -> dict[str, str]:
    """What differs between an answer and that on a changed copy: NAMES, WORD, NUMBERS or REFUSED.

    Names are the same if one answer has those of the other, as effects or as an alternative;
    numbers, if one of two is in the interval of the other.
    """
    if other.word.startswith(REFUSED) or one.word.startswith(REFUSED):
        return {} if one.word == other.word else {REFUSED: other.word}
    found = {}
    if not _names_agree(one, other):
        found[NAMES] = f"{one} -> {other}"
    if one.word != other.word:
        found[WORD] = f"{one.word} -> {other.word}"
    if change not in _ANY_NUMBERS and (numbers := list(_apart(one, other, change))):
        found[NUMBERS] = "; ".join(numbers)
    return found


def _names_agree(one: Answer, other: Answer) -> bool:
    return one.names in {other.names, *other.as_well} or other.names in one.as_well


def _apart(one: Answer, other: Answer, change: str) -> Iterator[str]:
    """Numbers of effects in both answers that are not in the interval of each other."""
    first, second = (_sizes(answer, change) for answer in (one, other))
    for key in sorted(first.keys() & second.keys()):
        a, b = first[key], second[key]
        ends = (a.low, a.high, b.low, b.high)
        inside = a.low <= b.value <= a.high or b.low <= a.value <= b.high
        near = math.isclose(a.value, b.value, rel_tol=1e-6)
        if all(map(math.isfinite, ends)) and not inside and not near:
            widths = [f"{n.value:.5g} ({n.low:.5g} to {n.high:.5g})" for n in (a, b)]
            yield f"{' '.join(key)} {' -> '.join(widths)}"


def _sizes(answer: Answer, change: str) -> dict[tuple[str, str], Number]:
    """The numbers that a change should leave: of a wave its size, where its phase is another."""
    numbers = dict(answer.numbers or {})
    if change in _REPHASED:
        for effect, name in list(numbers):
            if name[:1] == "s" and (effect, pair := "c" + name[1:]) in numbers:
                numbers[effect, name] = _size(numbers[effect, name], numbers.pop((effect, pair)))
    if change in _TURNED:
        return {key: _turned(n) if n.value < 0 else n for key, n in numbers.items()}
    return numbers


def _size(s: Number, c: Number) -> Number:
    size = math.hypot(s.value, c.value)
    wide = max(s.high - s.low, c.high - c.low) / 2
    return Number(size, size - wide, size + wide)


def _turned(n: Number) -> Number:
    return Number(-n.value, -n.high, -n.low)
