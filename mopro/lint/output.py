"""Output of lint: explanations of its rules, and findings as text, JSON, SARIF, annotations."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from mopro.errors import Severity, render_all
from mopro.lint.rule import Finding, Rule, Stage
from mopro.lint.rules import RULES
from mopro.source import Source
from mopro.text import visible

# -- explanations -----------------------------------------------------------------------------
# Explanations of the rules as Markdown, one by one and together.


_STAGES = {
    Stage.LANGUAGE: "The language: a program with one of these errors does not compile",
    Stage.TEXT: "The text",
    Stage.MOTION: "The motion",
    Stage.PHYSICS: "The machine and its payload",
}
_HEAD = """\
# Rules of `mopro lint`

This list is what `mopro lint --explain all` prints; the tests run its examples. To
suppress a finding that is known and intended, write `; mopro: allow RULE` on its line or on
a line of its own above.
"""


def explain(rule: Rule) -> str:
    """One rule as Markdown."""
    traits = [str(rule.severity)]
    if rule.fix_check:
        traits.append("fixed by `--fix`")
    if not rule.default:
        traits.append("only if selected by name")
    return (
        f"### {rule.name}\n\n{rule.what} ({', '.join(traits)})\n\n{rule.why}\n\n"
        f"Found in\n\n```\n{visible(rule.bad)}```\n\nand not in\n\n```\n{rule.good}```\n"
    )


def page() -> str:
    """All rules as Markdown."""
    parts = [_HEAD]
    for stage, title in _STAGES.items():
        parts.append(f"## {title}\n")
        parts += [explain(rule) for rule in RULES.values() if rule.stage is stage]
    return "\n".join(parts)


# -- findings ---------------------------------------------------------------------------------
# Formats findings as text, JSON, SARIF or GitHub annotations.

SARIF_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"
_GITHUB = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}


class Report(NamedTuple):
    """The findings about one file."""

    source: Source
    findings: list[Finding]


def as_text(reports: Iterable[Report]) -> str:
    """Text in the style of compilers: place, message, rule, line, caret, hint."""
    blocks = [
        render_all([f.diagnostic for f in report.findings], report.source)
        for report in reports
        if report.findings
    ]
    return "\n".join(blocks)


def summary(reports: Sequence[Report]) -> str:
    """The closing line: `3 warnings, 1 note in 2 files`."""
    found = Counter(f.severity for report in reports for f in report.findings)
    counts = ", ".join(_counted(found[kind], str(kind)) for kind in Severity if found[kind])
    return f"{counts or 'no findings'} in {_counted(len(reports), 'file')}"


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}{'' if count == 1 else 's'}"


def as_json(reports: Iterable[Report]) -> str:
    import json

    rows = [_row(report.source, f) for report in reports for f in report.findings]
    return json.dumps(rows, indent=1)


def _row(source: Source, finding: Finding) -> dict[str, Any]:
    return {
        "file": source.name,
        "line": finding.span.line,
        "column": finding.span.column,
        "end_line": finding.span.line,
        "end_column": finding.span.end_column,
        "rule": finding.rule,
        "severity": str(finding.severity),
        "message": finding.message,
        "fix": finding.fix,
    }


def as_github(reports: Iterable[Report]) -> str:
    """Workflow commands that GitHub shows beside the lines of a pull request."""
    return "\n".join(_annotation(r.source, f) for r in reports for f in r.findings)


def _annotation(source: Source, finding: Finding) -> str:
    span = finding.span
    message = f"{finding.message}\n{finding.hint}" if finding.hint else finding.message
    place = f"file={_property(source.name)},line={span.line},endLine={span.line}"
    columns = f"col={span.column},endColumn={span.end_column}"
    title = f"title={_property(finding.rule)}"
    return f"::{_GITHUB[finding.severity]} {place},{columns},{title}::{_escaped(message)}"


def _escaped(text: str) -> str:
    return visible(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")


def as_sarif(reports: Iterable[Report]) -> str:
    """A log of SARIF 2.1.0 with one run."""
    import json
    from importlib.metadata import version

    order = {name: index for index, name in enumerate(RULES)}
    driver = {
        "name": "mopro",
        "semanticVersion": version("mopro"),
        "rules": [_sarif_rule(name) for name in RULES],
    }
    results = [_sarif_result(r.source, f, order) for r in reports for f in r.findings]
    run = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}
    return json.dumps({"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _sarif_rule(name: str) -> dict[str, Any]:

    rule = RULES[name]
    return {
        "id": name,
        "shortDescription": {"text": rule.what},
        "fullDescription": {"text": rule.why},
        "help": {"text": f"{rule.what} {rule.why}", "markdown": explain(rule)},
        "defaultConfiguration": {"enabled": rule.default, "level": str(rule.severity)},
    }


def _sarif_result(source: Source, finding: Finding, order: dict[str, int]) -> dict[str, Any]:
    from urllib.parse import quote

    text = f"{finding.message} ({finding.hint})" if finding.hint else finding.message
    uri = quote(os.fsencode(source.name.replace("\\", "/")))
    region = {
        "startLine": finding.span.line,
        "startColumn": finding.span.column,
        "endLine": finding.span.line,
        "endColumn": finding.span.end_column,
    }
    result: dict[str, Any] = {
        "ruleId": finding.rule,
        "level": str(finding.severity),
        "message": {"text": text},
        "locations": [{"physicalLocation": {"artifactLocation": {"uri": uri}, "region": region}}],
    }
    if finding.rule in order:
        result["ruleIndex"] = order[finding.rule]
    if finding.fix is not None:
        change = {"deletedRegion": region, "insertedContent": {"text": finding.fix}}
        result["fixes"] = [
            {"artifactChanges": [{"artifactLocation": {"uri": uri}, "replacements": [change]}]}
        ]
    return result


FORMATS: dict[str, Callable[[Iterable[Report]], str]] = {
    "text": as_text,
    "json": as_json,
    "sarif": as_sarif,
    "github": as_github,
}
