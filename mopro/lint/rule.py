"""What a rule is: one definition from which finding, explanation and docs page come."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import StrEnum

from mopro.errors import Diagnostic, Severity
from mopro.lint.settings import Settings
from mopro.lint.subject import Subject
from mopro.source import Span


class Stage(StrEnum):
    """How much of a program must be right before a rule can be asked."""

    LANGUAGE = "language"
    TEXT = "text"
    MOTION = "motion"
    PHYSICS = "physics"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `fix` is the text that should stand in the place of its span."""

    rule: str
    message: str
    span: Span
    severity: Severity
    hint: str | None = None
    fix: str | None = None

    @classmethod
    def of(cls, diagnostic: Diagnostic, fix: str | None = None) -> Finding:
        d = diagnostic
        return cls(d.rule, d.message, d.span, d.severity, d.hint, fix)

    @property
    def diagnostic(self) -> Diagnostic:
        return Diagnostic(self.rule, self.message, self.span, self.severity, self.hint)


Check = Callable[["Rule", Subject], Iterable[Finding]]
Promise = Callable[[Subject, Subject], bool]


@dataclass(frozen=True)
class Rule:
    """One thing to be told about a program.

    `bad` and `good` are whole programs that do and do not give rise to the rule. `check`
    finds it; a rule without one is reported by the compiler or the schedule, and `fix`
    makes its replacement text from the program and the finding. `example` are the settings
    under which the examples hold. `promise` tells whether
    a fixed program is what the fix says: it is asked each time before one is kept. A
    rule that is not `default` is asked only by name.
    """

    name: str
    stage: Stage
    severity: Severity
    what: str
    why: str
    bad: str
    good: str
    check: Check | None = None
    fix: Callable[[Subject | None, Diagnostic], str | None] | None = None
    promise: Promise | None = None
    default: bool = True
    example: Settings = field(default_factory=Settings)

    def at(
        self, span: Span, message: str, hint: str | None = None, fix: str | None = None
    ) -> Finding:
        return Finding(self.name, message, span, self.severity, hint, fix)
