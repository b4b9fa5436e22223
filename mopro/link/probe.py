"""Test of a dialect on a live controller, step by step.

Nothing is moved: the only program that runs waits for a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mopro.errors import LinkError
from mopro.language import parse
from mopro.link.flash import upload, verify
from mopro.link.session import Refused, Session
from mopro.program import Program, lower
from mopro.source import Source

_PROGRAM = "UU012500/1\nVEL1 1.5\nACC1 0.25\nPARA1+\nWT100\n"
_RUN_S = 10.0


@dataclass(frozen=True)
class Step:
    """One step: its name, `matched` if the controller did as the dialect says, its answer."""

    name: str
    matched: bool
    said: str


def probe(session: Session) -> Iterator[Step]:
    """Try each part of the session's dialect in turn; after a failed opening, nothing more."""
    program = lower(parse(Source("link-test", _PROGRAM)))
    opening = _tried("open", lambda: _opened(session))
    yield opening
    if not opening.matched:
        return
    scratch = session.dialect.names.scratch
    steps: list[tuple[str, Callable[[], str]]] = [
        ("refuse", lambda: _refusal(session)),
        ("begin, statements, end, list", lambda: _loaded(session, program)),
        ("position", lambda: str(session.one("position"))),
        ("motion", lambda: str(session.one("motion"))),
        ("run, status", lambda: _ran(session, scratch)),
        ("stop", lambda: str(session.ask("stop") or "acknowledged")),
    ]
    if session.dialect.knows("identify"):
        steps.insert(0, ("identify", lambda: str(session.one("identify")["text"])))
    if session.dialect.knows("measured"):
        steps.insert(4, ("measured", lambda: str(session.one("measured"))))
    if session.dialect.knows("sample"):
        steps.insert(4, ("sample", lambda: str(session.one("sample"))))
    if session.dialect.knows("commit"):
        steps.append(("commit", lambda: _committed(session, program)))
    for name, action in steps:
        yield _tried(name, action)


def _tried(name: str, action: Callable[[], str]) -> Step:
    try:
        return Step(name, True, action())
    except LinkError as error:
        return Step(name, False, str(error))


def _opened(session: Session) -> str:
    session.open()
    return "answers"


def _refusal(session: Session) -> str:
    """Run a program of an impossible name, which must be refused; returns the refusal."""
    try:
        session.ask("run", name="0")
    except Refused as refused:
        return f"code {refused.code}: {refused.reason}"
    raise LinkError("a program named 0 was not refused", "not-refused")


def _loaded(session: Session, program: Program) -> str:
    upload(session, program, session.dialect.names.scratch, lambda done: None)
    return f"{len(program.ops)} statements stored and read back equal"


def _ran(session: Session, scratch: str) -> str:
    session.ask("run", again=False, name=scratch)
    seen: list[str] = []
    until_s = session.port.now_s() + _RUN_S
    while session.port.now_s() < until_s:
        word = session.one("status")["state"]
        state = session.dialect.state_of(word)
        if state is None:
            raise LinkError(f"the status `{word}` is in no [states]", "unknown-state")
        if state not in seen:
            seen.append(state)
        if state not in ("running", "stopping"):
            return ", then ".join(seen)
    raise LinkError(f"still {seen[-1]} after {_RUN_S:g} s", "no-end")


def _committed(session: Session, program: Program) -> str:
    """Commit the scratch program to its own name, which changes no other, and verify it."""
    scratch = session.dialect.names.scratch
    session.ask("commit", scratch=scratch, name=scratch)
    verify(session, program, scratch)
    return "copied and read back equal"
