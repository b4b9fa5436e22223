"""Dialect files: the wire format of a controller, as TOML.

Host and virtual controller read the same file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from mopro.link.template import Check, Template, template
from mopro.source import Source
from mopro.tomlfile import Document, Value, read_named
from mopro.tomlfile.schema import (
    Reader,
    flag,
    number,
    one_of,
    record,
    section,
    stated,
    table_in,
    text,
    whole,
)

ORIGINS = ("assumed", "manual")
_NO_ORIGIN = f"expected an origin: one of {', '.join(ORIGINS)}"
_TEXT = text(ascii_only=True)
STATES = (
    *("idle", "running", "done", "stopping", "stopped"),
    *("expired", "limit", "overheated", "silent"),
)
# A controller without a word for these says the one on the right.
_ELSE = {"silent": "stopped"}

# statement -> the fields that it must have, those that it may have; a file may leave those
# in _OPTIONAL out.
_STATEMENTS: dict[str, tuple[set[str], set[str]]] = {
    "identify": (set(), set()),
    "begin": ({"name"}, set()),
    "end": (set(), set()),
    "list": ({"name"}, set()),
    "commit": ({"scratch", "name"}, set()),
    "run": ({"name"}, set()),
    "run_for": ({"name", "milliseconds"}, set()),
    "stop": (set(), set()),
    "status": (set(), set()),
    "motion": (set(), set()),
    "position": (set(), set()),
    "measured": (set(), set()),
    "sample": (set(), set()),
    "moves": ({"first"}, set()),
    "heartbeat": ({"milliseconds"}, set()),
    "speed": (set(), set()),
}
_OPTIONAL = {
    *("identify", "commit", "run_for", "measured", "sample", "moves", "heartbeat", "speed"),
}  # fmt: skip
# reply line -> the fields that it must have, those that it may have
_REPLIES: dict[str, tuple[set[str], set[str]]] = {
    "identify": ({"text"}, set()),
    "list": ({"text"}, {"index"}),
    "status": ({"state"}, {"statement", "completed"}),
    "motion": ({"moving_1", "moving_2"}, set()),
    "position": ({"position_1", "position_2"}, set()),
    "measured": ({"position_1", "position_2"}, set()),
    "sample": ({"position_1", "position_2", "measured_1", "measured_2"}, {"statement"}),
    "moves": ({"index", "complete", "lag", "margin", "lost", "slipped"}, set()),
    "speed": ({"speed"}, set()),
}


@dataclass(frozen=True)
class Line:
    """[line]: the serial settings and the line ends; `window` and `longest` are in bytes."""

    baud: int = stated(whole(50, 4_000_000))
    data_bits: int = stated(whole(7, 8))
    parity: str = stated(one_of("none", "even", "odd"))
    stop_bits: int = stated(whole(1, 2))
    handshake: str = stated(one_of("none", "xon-xoff", "rts-cts"))
    end: str = stated(_TEXT)
    reply_end: str = stated(_TEXT)
    longest: int = stated(whole(16, 4096))
    window: int = stated(whole(1, 1_000_000))

    @property
    def bits_per_byte(self) -> int:
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits


@dataclass(frozen=True)
class Conversation:
    """[conversation]: echo, prompt, acknowledgement and refusal, time limit (s), retries."""

    echo: bool = stated(flag)
    refuse: Template = stated(template())
    prompt: str = stated(text(empty=True, ascii_only=True))
    attention: str = stated(text(empty=True, ascii_only=True))
    acknowledge: str = stated(text(empty=True, ascii_only=True))
    busy: str = stated(text(empty=True, ascii_only=True))
    reply_timeout_s: float = stated(number(0.01, 60))
    retries: int = stated(whole(0, 100))


@dataclass(frozen=True)
class Names:
    """[names]: the programs that mopro stores on the controller."""

    scratch: str = stated(_TEXT)
    main: str = stated(_TEXT)


def _conversation(value: Value) -> Conversation:
    talk = record(Conversation)(value)
    if not (talk.prompt or talk.acknowledge):
        message = "expected a prompt or an acknowledge: else nothing tells that a line is done"
        value.report(message, at="acknowledge")
    return talk


def _templates(known: Mapping[str, tuple[set[str], set[str]]]) -> Reader[Mapping[str, Template]]:
    """A section of templates, each with fields that it must have and those that it may have."""

    def read(value: Value) -> Mapping[str, Template]:
        table = table_in(value)
        table.only(known)
        found = {}
        for key, (needs, allows) in known.items():
            if key in table or key not in _OPTIONAL:
                missing = f"[{table.name}] has no {key}"
                found[key] = table.need(key, template(needs, allows), missing)
        return {key: template for key, template in found.items() if template is not None}

    return read


def _states(value: Value) -> Mapping[str, str]:
    table = table_in(value)
    table.only(STATES)
    words = {
        key: table.need(key, _TEXT, f"[states] has no {key}")
        for key in STATES
        if key in table or key not in _ELSE
    }
    often = Counter(words.values())
    for key, word in words.items():
        if word is not None and often[word] > 1:
            table.report(f"two states are called {word}", at=key)
    return {key: word for key, word in words.items() if word is not None}


@dataclass(frozen=True)
class Dialect:
    """A dialect file's content; statements and replies by their name in the file."""

    name: str = stated(_TEXT)
    origin: str = stated(
        one_of(*ORIGINS, message=_NO_ORIGIN, rule="missing-origin"), absent="missing-origin"
    )
    about: str = stated(_TEXT)
    line: Line = section(record(Line))
    conversation: Conversation = section(_conversation)
    statements: Mapping[str, Template] = section(_templates(_STATEMENTS))
    replies: Mapping[str, Template] = section(_templates(_REPLIES))
    states: Mapping[str, str] = section(_states)
    names: Names = section(record(Names))
    check: Check | None = section(record(Check), default=None)

    def knows(self, statement: str) -> bool:
        return statement in self.statements

    @property
    def measures(self) -> bool:
        """True if the controller measures positions."""
        return self.knows("measured") or self.knows("sample")

    def word_of(self, state: str) -> str:
        """The controller's word for `state`."""
        return self.states[state if state in self.states else _ELSE[state]]

    def state_of(self, word: str) -> str | None:
        """The state that the controller calls `word`."""
        return next((state for state, w in self.states.items() if w == word), None)

    def wrapped_length(self, body: str) -> int:
        """Bytes on the wire of a line to the controller, at most."""
        frame = self.check.overhead if self.check else 0
        return len(body) + frame + len(self.line.end)


def builtin_dialects() -> list[str]:
    """The names that `load_dialect` knows without a file."""
    folder = resources.files("mopro.link") / "dialects"
    return sorted(
        p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml")
    )


def load_dialect(name_or_path: str) -> Dialect:
    """The built-in dialect of that name, or the one in that file; else ModelError."""
    if name_or_path in builtin_dialects():
        file = resources.files("mopro.link") / "dialects" / f"{name_or_path}.toml"
        return read_dialect(Source(f"{name_or_path}.toml", file.read_text("utf-8")))
    return read_dialect(read_named("dialect", name_or_path, builtin_dialects()))


def read_dialect(source: Source) -> Dialect:
    """The dialect that `source` describes; ModelError with all findings, by line."""
    return Document(source).read(_dialect)


def _dialect(root: Value) -> Dialect:
    _answered(root)
    return record(Dialect)(root)


def _answered(root: Value) -> None:
    """Note each optional statement that the file has without its reply."""
    statements, replies = (root.data.get(key) for key in ("statements", "replies"))
    if isinstance(statements, dict) and isinstance(replies, dict):
        for key in sorted((_OPTIONAL & _REPLIES.keys() & statements.keys()) - replies.keys()):
            root["replies"].report(f"[replies] has no {key}", "missing-key")
