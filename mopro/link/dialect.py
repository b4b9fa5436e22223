"""Dialect files: all that is taken to be true of a controller's wire format.

Both ends read the same file: the host to speak, the virtual controller to answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from importlib import resources
from typing import Any

from mopro.link.frame import CHECKSUMS, Check
from mopro.link.template import Template
from mopro.source import Source
from mopro.tomlfile import TomlReader, parse_toml, read_named

ORIGINS = ("assumed", "manual")
STATES = (
    *("idle", "running", "done", "stopping", "stopped"),
    *("expired", "limit", "overheated", "silent"),
)
# A controller without a word for these says the one on the right.
_ELSE = {"silent": "stopped"}

# statement -> the fields that it must have; those in _OPTIONAL may be left out.
_STATEMENTS: dict[str, set[str]] = {
    "identify": set(),
    "begin": {"name"},
    "end": set(),
    "list": {"name"},
    "commit": {"scratch", "name"},
    "run": {"name"},
    "run_for": {"name", "milliseconds"},
    "stop": set(),
    "status": set(),
    "motion": set(),
    "position": set(),
    "measured": set(),
    "moves": {"first"},
    "heartbeat": {"milliseconds"},
}
_OPTIONAL = {"identify", "commit", "run_for", "measured", "moves", "heartbeat"}
# reply line -> the fields that it must have, those that it may have
_REPLIES: dict[str, tuple[set[str], set[str]]] = {
    "identify": ({"text"}, set()),
    "list": ({"text"}, {"index"}),
    "status": ({"state"}, {"statement", "completed"}),
    "motion": ({"moving_1", "moving_2"}, set()),
    "position": ({"position_1", "position_2"}, set()),
    "measured": ({"position_1", "position_2"}, set()),
    "moves": ({"index", "complete", "lag", "margin", "lost", "slipped"}, set()),
}


def _text(empty: bool = False, among: tuple[str, ...] = ()) -> Any:
    return field(metadata={"type": str, "empty": empty, "among": among})


def _number(low: float, high: float, whole: bool = True) -> Any:
    return field(metadata={"type": int if whole else float, "low": low, "high": high})


@dataclass(frozen=True)
class Line:
    """How bytes and lines go over the wire; `window` and `longest` count bytes."""

    baud: int = _number(50, 4_000_000)
    data_bits: int = _number(7, 8)
    parity: str = _text(among=("none", "even", "odd"))
    stop_bits: int = _number(1, 2)
    handshake: str = _text(among=("none", "xon-xoff", "rts-cts"))
    end: str = _text()
    reply_end: str = _text()
    longest: int = _number(16, 4096)
    window: int = _number(1, 1_000_000)

    @property
    def bits_per_byte(self) -> int:
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits


@dataclass(frozen=True)
class Conversation:
    """How the controller shows that it heard, has done, or will not."""

    echo: bool = field(metadata={"type": bool})
    refuse: Template = field(metadata={"type": Template})
    prompt: str = _text(empty=True)
    attention: str = _text(empty=True)
    acknowledge: str = _text(empty=True)
    busy: str = _text(empty=True)
    reply_timeout_s: float = _number(0.01, 60, whole=False)
    retries: int = _number(0, 100)


@dataclass(frozen=True)
class Names:
    """Where programs are kept on the controller."""

    scratch: str = _text()
    main: str = _text()


@dataclass(frozen=True)
class Dialect:
    """A dialect file's content; statements and replies by their name in the file."""

    name: str
    origin: str
    about: str
    line: Line
    conversation: Conversation
    check: Check | None
    statements: Mapping[str, Template]
    replies: Mapping[str, Template]
    states: Mapping[str, str]
    names: Names

    def knows(self, statement: str) -> bool:
        return statement in self.statements

    def word_of(self, state: str) -> str:
        """What the controller calls `state`."""
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
    return _Reader(source, parse_toml(source)).dialect()


class _Reader(TomlReader):
    """Takes a dialect file's data apart."""

    def dialect(self) -> Dialect:
        own = {"name", "origin", "about"}
        sections = {"line", "conversation", "check", "statements", "replies", "states", "names"}
        self._known("", self._data, own | sections)
        texts: dict[str, Any] = {key: self._plain_text("", self._data, key) for key in sorted(own)}
        if texts["origin"] not in ORIGINS:
            message = f"expected an origin: one of {', '.join(ORIGINS)}"
            self._report("missing-origin", message, "", "origin")
        parts: dict[str, Any] = {
            "line": self._record("line", Line),
            "conversation": self._record("conversation", Conversation),
            "names": self._record("names", Names),
            "check": self._record("check", Check) if "check" in self._data else None,
            "statements": self._statements(),
            "replies": self._replies(),
            "states": self._states(),
        }
        self._consistent(parts)
        self._check()
        return Dialect(**texts, **parts)

    def _table(self, section: str) -> dict[str, Any]:
        table = self._data.get(section)
        if isinstance(table, dict):
            return table
        self._report("missing-key", f"expected a section [{section}]", "", section)
        return {}

    def _plain_text(
        self, section: str, table: dict[str, Any], key: str, empty: bool = False
    ) -> str:
        value = table.get(key)
        if not isinstance(value, str) or not (value or empty):
            self._report("bad-value", f'expected {key} = "text"', section, key)
            return ""
        if not value.isascii():
            self._report("bad-value", f"{key} must be plain ASCII", section, key)
        return value

    def _record(self, section: str, kind: type[Any]) -> Any:
        table = self._table(section)
        parts = fields(kind)
        self._known(section, table, {f.name for f in parts})
        before = len(self._found)
        values = {f.name: self._value(section, table, f) for f in parts}
        return kind(**values) if len(self._found) == before else None

    def _value(self, section: str, table: dict[str, Any], part: Field[Any]) -> Any:
        kind = part.metadata["type"]
        if part.name not in table:
            self._report("missing-key", f"[{section}] has no {part.name}", section, part.name)
            return None
        value = table[part.name]
        if kind is str:
            text = self._plain_text(section, table, part.name, part.metadata["empty"])
            among = part.metadata["among"]
            if among and text not in among:
                message = f"expected {part.name}: one of {', '.join(among)}"
                self._report("bad-value", message, section, part.name)
            return text
        if kind is Template:
            return self._template(section, table, part.name, part.metadata.get("needs", set()))
        if kind is bool:
            if not isinstance(value, bool):
                self._report(
                    "bad-value", f"expected {part.name}: true or false", section, part.name
                )
            return value
        low, high = part.metadata["low"], part.metadata["high"]
        numbers = int if kind is int else (int, float)
        if isinstance(value, bool) or not isinstance(value, numbers) or not low <= value <= high:
            what = "a whole number" if kind is int else "a number"
            message = f"expected {part.name}: {what} from {low:g} to {high:g}"
            self._report("bad-value", message, section, part.name)
        return value

    def _template(
        self,
        section: str,
        table: dict[str, Any],
        key: str,
        needs: set[str],
        allows: set[str] | None = None,
    ) -> Template | None:
        try:
            template = Template(self._plain_text(section, table, key))
        except ValueError as error:
            self._report("bad-template", f"{key}: {error}", section, key)
            return None
        missing = needs - template.fields
        surplus = template.fields - needs - allows if allows is not None else set()
        if missing or surplus:
            wanted = ", ".join(f"{{{name}}}" for name in sorted(needs)) or "no field"
            self._report("bad-template", f"{key}: expected {wanted} in it", section, key)
        return template

    def _statements(self) -> dict[str, Template]:
        table = self._table("statements")
        self._known("statements", table, _STATEMENTS)
        found = {}
        for key, needs in _STATEMENTS.items():
            if key in table:
                found[key] = self._template("statements", table, key, needs, set())
            elif key not in _OPTIONAL:
                self._report("missing-key", f"[statements] has no {key}", "statements", key)
        return {key: template for key, template in found.items() if template is not None}

    def _replies(self) -> dict[str, Template]:
        table = self._table("replies")
        self._known("replies", table, _REPLIES)
        found = {}
        for key, (needs, allows) in _REPLIES.items():
            if key in table:
                found[key] = self._template("replies", table, key, needs, allows)
            elif key not in _OPTIONAL or key in self._data.get("statements", {}):
                self._report("missing-key", f"[replies] has no {key}", "replies", key)
        return {key: template for key, template in found.items() if template is not None}

    def _states(self) -> dict[str, str]:
        table = self._table("states")
        self._known("states", table, STATES)
        for state in STATES:
            if state not in table and state not in _ELSE:
                self._report("missing-key", f"[states] has no {state}", "states", state)
        words = {key: self._plain_text("states", table, key) for key in STATES if key in table}
        for key, word in words.items():
            if list(words.values()).count(word) > 1:
                self._report("bad-value", f"two states are called {word}", "states", key)
        return words

    def _consistent(self, parts: dict[str, Any]) -> None:
        talk, check = parts["conversation"], parts["check"]
        if talk is not None and not (talk.prompt or talk.acknowledge):
            message = "expected a prompt or an acknowledge: else nothing tells that a line is done"
            self._report("bad-value", message, "conversation", "acknowledge")
        if check is not None and check.checksum not in CHECKSUMS:
            message = f"expected checksum: one of {', '.join(CHECKSUMS)}"
            self._report("bad-value", message, "check", "checksum")
        if check is not None and not check.form.text.endswith("{check}"):
            self._report("bad-template", "form: expected {check} at its end", "check", "form")
