"""Every error that mopro raises for a person to read.

A fault in a program is a `Diagnostic`: data with a place, so that a file's faults are
reported together. The exceptions carry them to whoever asked for the work.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from mopro.source import Source, Span
from mopro.text import visible

MOST_SHOWN = 50  # findings of one text that a report shows in full


class Severity(StrEnum):
    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Diagnostic:
    """One finding: which rule, where, what is wrong, and what to do about it."""

    rule: str
    message: str
    span: Span
    severity: Severity = Severity.ERROR
    hint: str | None = None

    def __post_init__(self) -> None:
        """Make visible what a file or a reply may have brought into the words."""
        object.__setattr__(self, "message", visible(self.message))
        if self.hint is not None:
            object.__setattr__(self, "hint", visible(self.hint))

    def render(self, source: Source) -> str:
        """`file:line:col: message [rule]`, the line, a caret and the hint."""
        kind = "" if self.severity is Severity.ERROR else f"{self.severity}: "
        text = f"{visible(source.name)}:{self.span}: {kind}{self.message} [{self.rule}]"
        if source.line(self.span.line):
            text += "\n" + source.excerpt(self.span)
        if self.hint:
            text += f"\n  {self.hint}"
        return text


def render_all(diagnostics: Sequence[Diagnostic], source: Source) -> str:
    """The findings in order of place, at most fifty of them in full."""
    ordered = sorted(diagnostics, key=lambda d: d.span)
    shown = [d.render(source) for d in ordered[:MOST_SHOWN]]
    if len(ordered) > MOST_SHOWN:
        shown.append(f"{source.name}: and {len(ordered) - MOST_SHOWN} more")
    return "\n".join(shown)


class MoproError(Exception):
    """Base of all errors meant for the person at the machine.

    `rule` is a stable name for scripts to match. Notes added to the error on its way
    (`add_note`) are part of what is shown.
    """

    rule = "failed"

    def __init__(self, message: str, rule: str | None = None) -> None:
        super().__init__(message)
        self.rule = rule or self.rule

    def render(self) -> str:
        notes = getattr(self, "__notes__", ())
        return visible("\n".join([f"{self} [{self.rule}]", *notes]))


class LocatedError(MoproError):
    """Findings at places of one text, all of them."""

    def __init__(self, source: Source, diagnostics: Iterable[Diagnostic]) -> None:
        self.source = source
        self.diagnostics = tuple(diagnostics)
        super().__init__(render_all(self.diagnostics, source))

    def render(self) -> str:
        return str(self)


class SourceError(LocatedError):
    """The text is not a program of the language."""


class MotionError(LocatedError):
    """The program is well formed but asks for motion that must be refused."""


class RunError(LocatedError):
    """A run that was begun and cannot be carried on, at the line that was running."""


class ModelError(LocatedError):
    """A machine file that cannot be used."""


class DataError(MoproError):
    """A recording or data file that cannot be read or written."""

    rule = "bad-data"


class DataFileError(LocatedError, DataError):
    """Findings at places of a data file."""


class LinkError(MoproError):
    """The conversation with a controller failed; `rule` says in which way."""

    rule = "link-failed"


class PortError(LinkError):
    """The port itself cannot be used: nothing was said yet."""

    rule = "no-port"


class VerifyError(LinkError):
    """The program read back from the controller differs from the one sent."""

    rule = "read-back-differs"


class Interrupted(KeyboardInterrupt):
    """A signal asked this process to end; its text says which.

    A class of its own, because CPython ends a `python -m` process by SIGINT whatever its exit
    code is, once a plain KeyboardInterrupt has left any `exec` of a text (as numba runs).
    """
