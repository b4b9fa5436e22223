"""All rules, in the order in which they are explained."""

from __future__ import annotations

from mopro.lint.rule import Rule
from mopro.lint.rules import language, motion, physics, text

RULES: dict[str, Rule] = {
    rule.name: rule for rule in (*language.RULES, *text.RULES, *motion.RULES, *physics.RULES)
}
