"""Storing a program on a controller, verified by reading it back.

The program goes to a scratch place, is read back and compared, and only then is it
copied to its own place, where it is compared once more. Until that copy the old program
stays as it was, and all of it may be done again at any time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from mopro.errors import SourceError, VerifyError
from mopro.language import parse
from mopro.link.session import Damaged, Refused, Session
from mopro.program import Program, lower
from mopro.program.statements import statement
from mopro.source import Source

# Passes over the wire: up, back, and back again after the copy.
_PASSES = 3
_SPARE_S = 20.0
_SPARE_FACTOR = 2.5

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Flashed:
    """The result of a flash; `seconds` on the port's clock."""

    name: str
    statements: int
    seconds: float
    retried: int


def statements_of(program: Program) -> list[str]:
    """The program as the lines that go to a controller."""
    return [statement(op) for op in program.ops]


def flash(
    session: Session, program: Program, name: str, progress: Progress = lambda done, total: None
) -> Flashed:
    """Make `program` the one stored under `name`; VerifyError, Refused or LinkError if not.

    `progress(done, total)` counts statements over all passes.
    """
    lines = statements_of(program)
    total = _PASSES * len(lines)
    started_s = session.port.now_s()
    scratch = session.dialect.names.scratch
    upload(session, program, scratch, lambda n: progress(n, total))
    if session.dialect.knows("commit"):
        session.ask("commit", scratch=scratch, name=name)
    else:
        upload(session, program, name, lambda n: progress(len(lines) + n, total))
    verify(session, program, name)
    progress(total, total)
    seconds = session.port.now_s() - started_s
    return Flashed(name, len(lines), seconds, session.retried)


def allowed_s(session: Session, program: Program) -> float:
    """The time in seconds that a flash may take before it counts as failed."""
    size = sum(session.dialect.wrapped_length(text) for text in statements_of(program))
    return _SPARE_S + _SPARE_FACTOR * _PASSES * 2 * size * session.byte_s


def upload(session: Session, program: Program, name: str, done: Callable[[int], None]) -> None:
    """Store `program` under `name` and verify it; damaged transfers are repeated."""
    check_size(session, program)
    tries = session.dialect.conversation.retries
    refused = ""
    while True:
        try:
            _download(session, program, name, done)
            verify(session, program, name)
            return
        except (Damaged, VerifyError, Refused) as error:
            # A refusal may be of a line that was damaged on its way, or by a controller that
            # was reset in between: it counts when it comes again.
            if tries == 0 or (isinstance(error, Refused) and str(error) == refused):
                raise
            refused = str(error)
            tries -= 1
            session.retried += 1
            session.open()


def check_size(session: Session, program: Program) -> None:
    """Refuse what cannot be a download: nothing, or a line longer than the controller's."""
    lines = statements_of(program)
    if not lines:
        raise VerifyError("the program is empty: there is nothing to store", "empty")
    longest = session.dialect.line.longest
    for op, text in zip(program.ops, lines, strict=True):
        if len(text) > longest:
            message = f"line {op.span.line} `{text[:40]}...` has {len(text)} characters: "
            raise VerifyError(f"{message}the controller takes {longest}", "too-long")


def _download(session: Session, program: Program, name: str, done: Callable[[int], None]) -> None:
    lines = statements_of(program)
    taken = 0

    def count(n: int) -> None:
        nonlocal taken
        taken = n
        done(n)

    session.ask("begin", name=name)
    try:
        session.stream(lines, count)
    except Refused as refused:
        where = f"{program.source.name}:{program.ops[taken].span.line}"
        message = f"{where}: the controller refused `{lines[taken]}`: {refused.reason}"
        error = Refused(lines[taken], refused.code, refused.reason)
        error.args = (message,)
        raise error from refused
    session.ask("end", again=False)


def read_back(session: Session, name: str) -> list[str]:
    """The lines that the controller has stored under `name`."""
    return [str(row["text"]) for row in session.ask("list", name=name)]


def verify(session: Session, program: Program, name: str) -> None:
    """VerifyError unless what is stored under `name` is `program`, statement by statement.

    A difference counts when it is read twice: the reply can be damaged too.
    """
    difference = differences(program, read_back(session, name))
    if difference:
        difference = differences(program, read_back(session, name))
    if difference:
        at, ours, theirs = difference[0]
        if at == 0:
            raise VerifyError(f"the controller has nothing under {name}", "empty")
        place = program.ops[min(at, len(program.ops)) - 1].span.line
        message = (
            f"read-back differs at statement {at} (line {place} of {program.name}): "
            f"sent `{ours}`, the controller has `{theirs}`"
        )
        raise VerifyError(message, "read-back-differs")


def differences(program: Program, stored: Sequence[str]) -> list[tuple[int, str, str]]:
    """Statement number, ours and theirs, wherever they do not mean the same.

    A controller may write numbers in its own way: what counts is the meaning. Nothing
    stored at all is told as number 0.
    """
    if not stored:
        return [(0, "", "")]
    pairs = zip_longest(statements_of(program), stored, fillvalue="(nothing)")
    return [
        (at, ours, theirs)
        for at, (ours, theirs) in enumerate(pairs, start=1)
        if ours != theirs and not _same_meaning(ours, theirs)
    ]


def _same_meaning(ours: str, theirs: str) -> bool:
    """True if two single statements lower to the same; jumps compare by their text."""
    try:
        first, second = (
            lower(parse(Source("<line>", text), "extended")).ops for text in (ours, theirs)
        )
    except SourceError:
        return False
    return first == second


def stored_program(session: Session, name: str, grammar: str) -> Program:
    """The program stored under `name`; VerifyError if it is none."""
    lines = read_back(session, name)
    if not lines:
        raise VerifyError(f"the controller has nothing under {name}", "empty")
    source = Source(f"{name} on the controller", "".join(f"{line}\n" for line in lines))
    try:
        return lower(parse(source, grammar))
    except SourceError as error:
        raise VerifyError(f"what is stored is no program:\n{error}", "bad-program") from error
