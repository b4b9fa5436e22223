"""Runs the rules on a program text, and applies their fixes."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

from mopro.errors import Diagnostic, MotionError, Severity, SourceError
from mopro.language import ast, parse
from mopro.language.ast import Tree
from mopro.language.parse import parse_what_can_be
from mopro.lint.rule import Finding, Rule, Settings, Stage, Subject
from mopro.lint.rules import RULES
from mopro.process.garbage import garbage_left
from mopro.program import Program, examine, lower
from mopro.source import Source, Span

# -- findings ---------------------------------------------------------------------------------
# Runs the rules on a program text.


_ALLOW = re.compile(r";\s*mopro:\s*allow\b[\s:]*([A-Za-z0-9_\-, \t]*)", re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z0-9_\-]+")


class Allow(NamedTuple):
    """Suppression of `rule` in `line`, stated at `span`."""

    rule: str
    line: int
    span: Span


def allows(tree: ast.Tree) -> Iterator[Allow]:
    """Suppressions by comments, for their own line or the next one with a statement."""
    lines = [statement.span.line for statement in tree.statements]
    for comment in tree.comments:
        match = _ALLOW.match(comment.text)
        if match is None:
            continue
        index = bisect_left(lines, comment.span.line)
        line = lines[index] if index < len(lines) else comment.span.line
        for name in _NAME.finditer(match[1]):
            start = comment.span.column + match.start(1) + name.start()
            yield Allow(name[0].lower(), line, Span(comment.span.line, start, start + len(name[0])))


def why_unused(allow: Allow, known: Collection[str]) -> tuple[str, str | None]:
    """Message and hint for a suppression without a finding."""
    if allow.rule in known:
        return f"{allow.rule} is allowed here, but there is none", "remove the comment"
    from difflib import get_close_matches

    near = get_close_matches(allow.rule, list(known), n=1)
    return f"no rule is called {allow.rule}", f"did you mean `{near[0]}`?" if near else None


# Findings that may only follow from another fault of the text.
_FOLLOWS_FROM_OTHERS = {"loop-without-time", "unknown-label"}


def lint(
    source: Source,
    settings: Settings | None = None,
    on_share: Callable[[float], None] = lambda share: None,
) -> list[Finding]:
    """The findings about `source` in order of place; ModelError for an unusable machine.

    `on_share` is told which share of the steps is done: reading, compiling, motion, each check.
    """
    with garbage_left():
        return _findings(source, settings or Settings(), on_share)


def _findings(
    source: Source, settings: Settings, on_share: Callable[[float], None]
) -> list[Finding]:
    asked = asked_rules(settings)
    steps = 3 + sum(rule.check is not None for rule in asked.values())
    shares = (n / steps for n in count(1))

    def step() -> None:
        on_share(next(shares))

    tree, faults = _read(source, settings.grammar)
    step()
    ops, refusals = examine(tree)
    step()
    compiles = not faults and all(d.severity is not Severity.ERROR for d in refusals)
    subject = Subject(tree, Program(ops, tree.source), settings) if compiles else None
    findings = [_with_fix(d, subject) for d in _first_causes(faults, refusals)]
    if subject is not None:
        findings += _found_by_rules(subject, asked, step)
    findings = [f for f in findings if f.rule in asked or f.rule not in RULES]
    return sorted(_allowed(findings, tree, asked), key=lambda f: (f.span, f.rule))


def subject_of(source: Source, settings: Settings) -> Subject:
    """The program in `source` as a Subject; SourceError if it does not compile."""
    tree = parse(source, settings.grammar)
    return Subject(tree, lower(tree), settings)


def asked_rules(settings: Settings) -> dict[str, Rule]:
    chosen = settings.select
    return {
        name: rule
        for name, rule in RULES.items()
        if (rule.default if chosen is None else name in chosen) and name not in settings.ignore
    }


def _read(source: Source, grammar: str) -> tuple[Tree, tuple[Diagnostic, ...]]:
    try:
        return parse(source, grammar), ()
    except SourceError as error:
        return parse_what_can_be(source, grammar)[0], error.diagnostics


def _first_causes(*groups: tuple[Diagnostic, ...] | list[Diagnostic]) -> list[Diagnostic]:
    """The findings of all groups without those that may only follow from an earlier group."""
    causes: list[Diagnostic] = []
    for group in groups:
        earlier = bool(causes)
        causes += [d for d in group if not (earlier and d.rule in _FOLLOWS_FROM_OTHERS)]
    return causes


def _found_by_rules(
    subject: Subject, asked: dict[str, Rule], step: Callable[[], None]
) -> Iterator[Finding]:
    """Findings of each stage, as long as no earlier stage refuses the program."""
    for rule in _checks(asked, Stage.TEXT):
        yield from rule.check(rule, subject)  # type: ignore[misc]
        step()
    if all(rule.stage not in (Stage.MOTION, Stage.PHYSICS) for rule in asked.values()):
        return
    refused = [d for d in subject.survey.findings if d.rule != "loop-without-time"]
    refused = refused or list(subject.survey.findings)
    step()
    yield from (_with_fix(d, subject) for d in refused)
    if refused:
        return
    for stage in (Stage.MOTION, Stage.PHYSICS):
        for rule in _checks(asked, stage):
            yield from rule.check(rule, subject)  # type: ignore[misc]
            step()


def _checks(asked: dict[str, Rule], stage: Stage) -> list[Rule]:
    return [rule for rule in asked.values() if rule.stage is stage and rule.check]


def _with_fix(diagnostic: Diagnostic, subject: Subject | None) -> Finding:
    rule = RULES.get(diagnostic.rule)
    fix = rule.fix(subject, diagnostic) if rule and rule.fix else None
    return Finding.of(diagnostic, fix)


def _allowed(findings: list[Finding], tree: Tree, asked: dict[str, Rule]) -> list[Finding]:
    """Findings that no comment suppresses, and one for each comment that suppresses none."""
    places = {(f.rule, f.span.line) for f in findings}
    allowed = set()
    unused: list[Finding] = []
    rule = asked.get("unused-allow")
    for allow in allows(tree):
        if (allow.rule, allow.line) in places:
            allowed.add((allow.rule, allow.line))
        elif rule and (allow.rule in asked or allow.rule not in RULES):
            unused.append(rule.at(allow.span, *why_unused(allow, RULES)))
    return [f for f in findings if (f.rule, f.span.line) not in allowed] + unused


# -- fixes ------------------------------------------------------------------------------------
# Applies fixes, each only if the changed program passes the rule's check.

# A fix may uncover the next finding; more passes than this would mean an endless cycle.
_MOST_PASSES = 10
# Lines compiled for the checks of one rule's fixes in one pass. What is not
# tried by then stays a finding.
_MOST_CHECKED = 2_000_000


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
    """All fixes of one rule that pass its check, in as large groups as pass together."""
    findings = [f for f in _fixable(source, settings) if f.rule == rule.name]
    before = _compiled(source, settings)
    groups, checked = [findings], 0
    # Later places first, so that those still to come stay where they are.
    while before is not None and groups and checked < _MOST_CHECKED:
        group = groups.pop()
        after = applied(source, group)
        checked += len(after.lines)
        better = _passing(rule, before, _compiled(after, settings))
        if better is None and len(group) > 1:
            half = len(group) // 2
            groups += [group[:half], group[half:]]
        source, before = (after, better) if better is not None else (source, before)
    return source


def _compiled(source: Source, settings: Settings) -> Subject | None:
    try:
        return subject_of(source, settings)
    except SourceError:
        return None


def _passing(rule: Rule, before: Subject, after: Subject | None) -> Subject | None:
    """The fixed program `after`, if it compiles and passes the check of `rule`."""
    assert rule.fix_check is not None, "only rules with a check are fixed"
    try:
        return after if after is not None and rule.fix_check(before, after) else None
    except MotionError:
        # A program that cannot be planned is compared with nothing.
        return None
