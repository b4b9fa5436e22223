"""Fixes, each kept only if the program that it leaves is what its rule promises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mopro.errors import MotionError, SourceError
from mopro.lint.check import lint, subject_of
from mopro.lint.rule import Finding, Rule
from mopro.lint.rules import RULES
from mopro.lint.settings import Settings
from mopro.source import Source

# A fix may uncover the next finding; more often than this it would be going in circles.
_MOST_PASSES = 10


def fixed(source: Source, settings: Settings) -> Source:
    """`source` with every fix that keeps its promise."""
    for _ in range(_MOST_PASSES):
        better = source
        for name in dict.fromkeys(f.rule for f in _fixable(source, settings)):
            better = _fix_rule(better, RULES[name], settings)
        if better == source:
            return source
        source = better
    return source


def applied(source: Source, findings: Sequence[Finding]) -> Source:
    """`source` with the fixes of `findings` put in, unchecked."""
    lines = source.lines_with_ends
    end = source.line_end
    for finding in sorted(findings, key=lambda f: f.span, reverse=True):
        span = finding.span
        line = lines[span.line - 1]
        text = (finding.fix or "").replace("\n", end)
        lines[span.line - 1] = line[: span.column - 1] + text + line[span.end_column - 1 :]
    return replace(source, text="".join(lines))


def _fixable(source: Source, settings: Settings) -> list[Finding]:
    return [f for f in lint(source, settings) if f.fix is not None and RULES[f.rule].promise]


def _fix_rule(source: Source, rule: Rule, settings: Settings) -> Source:
    """All fixes of one rule at once if that keeps its promise, else those one by one that do."""
    findings = [f for f in _fixable(source, settings) if f.rule == rule.name]
    together = applied(source, findings)
    if _keeps_promise(rule, source, together, settings):
        return together
    for finding in reversed(findings):
        alone = applied(source, [finding])
        if _keeps_promise(rule, source, alone, settings):
            source = alone
    return source


def _keeps_promise(rule: Rule, before: Source, after: Source, settings: Settings) -> bool:
    assert rule.promise is not None, "only rules with a promise are fixed"
    try:
        return rule.promise(subject_of(before, settings), subject_of(after, settings))
    except (SourceError, MotionError):
        return False
