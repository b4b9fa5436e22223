"""What a program does that its author would want to know before the machine moves."""

from mopro.lint.check import lint
from mopro.lint.rule import Finding, Rule
from mopro.lint.settings import Settings

__all__ = ["Finding", "Rule", "Settings", "lint"]
