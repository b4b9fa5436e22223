"""Lint: findings about a program before it runs, from its text to the motor's margins."""

from mopro.lint.check import lint
from mopro.lint.rule import Finding, Rule, Settings

__all__ = ["Finding", "Rule", "Settings", "lint"]
