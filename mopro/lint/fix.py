"""Applies fixes, each only if the changed program passes the rule's check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mopro.errors import MotionError, SourceError
from mopro.lint.check import lint, subject_of
from mopro.lint.rule import Finding, Rule
from mopro.lint.rules import RULES
from mopro.lint.settings import Settings
from mopro.source import Source

# A fix may uncover the next finding; more passes than this would mean an endless cycle.
_MOST_PASSES = 10


def fixed(source: Source, settings: Settings) -> Source:
    """`source` with every fix that passes its check."""
    for _ in range(_MOST_PASSES):
        better = source
        for name in dict.fromkeys(f.rule for f in _fixable(source, settings)):
            better = _fix_rule(better, RULES[name], settings)
        if better == source:
            return source
        source = better
    return source


def applied(source: Source, findings: Sequence[Finding]) -> Source:
    """`source` with the fixes of `findings` applied, unchecked."""
    lines = source.lines_with_ends
    end = source.line_end
    for finding in sorted(findings, key=lambda f: f.span, reverse=True):
        span = finding.span
        line = lines[span.line - 1]
        text = (finding.fix or "").replace("\n", end)
        lines[span.line - 1] = line[: span.column - 1] + text + line[span.end_column - 1 :]
    return replace(source, text="".join(lines))


def _fixable(source: Source, settings: Settings) -> list[Finding]:
    return [f for f in lint(source, settings) if f.fix is not None and RULES[f.rule].fix_check]


def _fix_rule(source: Source, rule: Rule, settings: Settings) -> Source:
    """All fixes of one rule together if they pass its check, else each that passes alone."""
    findings = [f for f in _fixable(source, settings) if f.rule == rule.name]
    together = applied(source, findings)
    if _passes_check(rule, source, together, settings):
        return together
    for finding in reversed(findings):
        alone = applied(source, [finding])
        if _passes_check(rule, source, alone, settings):
            source = alone
    return source


def _passes_check(rule: Rule, before: Source, after: Source, settings: Settings) -> bool:
    assert rule.fix_check is not None, "only rules with a check are fixed"
    try:
        return rule.fix_check(subject_of(before, settings), subject_of(after, settings))
    except (SourceError, MotionError):
        return False
