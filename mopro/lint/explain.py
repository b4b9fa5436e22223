"""Explanations of the rules as Markdown, one by one and together."""

from __future__ import annotations

from mopro.lint.rule import Rule, Stage
from mopro.lint.rules import RULES
from mopro.text import visible

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
