"""All rules, in the order in which they are explained."""

from __future__ import annotations

from mopro.lint.rule import Rule
from mopro.lint.rules import comments, language, motion, physics, text, travel

_ALL = (
    *language.RULES,
    *text.RULES,
    *motion.RULES,
    *physics.RULES,
    *travel.RULES,
    *comments.RULES,
)
RULES: dict[str, Rule] = {rule.name: rule for rule in _ALL}
