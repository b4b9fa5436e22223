"""Definition of a rule: the source of its findings, explanation and docs page."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import StrEnum

from mopro.errors import Diagnostic, Severity
from mopro.lint.subject import Settings, Subject
from mopro.source import Span


class Stage(StrEnum):
    """Stage of a check; a rule runs only if the earlier stages accept the program."""

    LANGUAGE = "language"
    TEXT = "text"
    MOTION = "motion"
    PHYSICS = "physics"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `fix` is the replacement text of its span."""

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
FixCheck = Callable[[Subject, Subject], bool]


@dataclass(frozen=True)
class Rule:
    """A kind of finding about a program.

    `bad` and `good` are whole programs with and without the finding. `check` yields the
    findings; those of a rule without one come from the compiler or the schedule. `fix` makes
    the replacement text from the program and the finding. `example` are the settings of the
    examples. `fix_check` compares the program before and after a fix, which is applied only if
    it returns True. A rule that is not `default` runs only if selected by name.
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
    fix_check: FixCheck | None = None
    default: bool = True
    example: Settings = field(default_factory=Settings)

    def at(
        self, span: Span, message: str, hint: str | None = None, fix: str | None = None
    ) -> Finding:
        return Finding(self.name, message, span, self.severity, hint, fix)
