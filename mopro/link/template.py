"""Lines of a controller: templates with fields, and numbered lines with a checksum."""

from __future__ import annotations

import math
import re
from binascii import crc_hqx
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field
from functools import cached_property, reduce
from operator import xor
from typing import Any

from mopro.tomlfile import Value, shown
from mopro.tomlfile.schema import Reader, one_of, stated, whole
from mopro.tomlfile.schema import text as text_reader

# -- fields -----------------------------------------------------------------------------------
# Lines with fields, such as `RN {name}`: written by one end, read by the other.


_FIELD = re.compile(r"\{([a-z_0-9]+)\}")
# Numbers with more digits than these come from no controller; and int() and float() have
# limits of their own, which they tell by raising.
MOST_DIGITS = 15
_MOST_DECIMALS = 24
_UINT = rf"\d{{1,{MOST_DIGITS}}}"
_WORD, _INT = r"[^\s,;]{1,32}", rf"[+-]?{_UINT}"
_FRACTION = rf"\d{{0,{_MOST_DECIMALS}}}"
_REAL = rf"[+-]?(?:{_UINT}\.?{_FRACTION}|\.\d{_FRACTION})(?:[eE][+-]?\d{{1,3}})?"

# field -> how it looks, how it is read
FIELDS: dict[str, tuple[str, type[Any]]] = {
    "name": (r"[A-Za-z0-9_]+", str),
    "scratch": (r"[A-Za-z0-9_]+", str),
    "text": (r".*", str),
    "state": (_WORD, str),
    "code": (_UINT, int),
    "number": (_UINT, int),
    "check": (r"[0-9A-Fa-f]+", str),
    "body": (r".*", str),
    "index": (_UINT, int),
    "count": (_UINT, int),
    "first": (_UINT, int),
    "milliseconds": (_REAL, float),
    "speed": (_REAL, float),
    "statement": (_UINT, int),
    "completed": (_UINT, int),
    "position_1": (_INT, int),
    "position_2": (_INT, int),
    "measured_1": (_INT, int),
    "measured_2": (_INT, int),
    "moving_1": (r"[01]", int),
    "moving_2": (r"[01]", int),
    "complete": (r"[01]", int),
    "slipped": (r"[01]", int),
    "lag": (_REAL, float),
    "margin": (_REAL, float),
    "lost": (_INT, int),
}


@dataclass(frozen=True)
class Template:
    """Text with `{field}`s, each of `FIELDS` and at most once."""

    text: str
    fields: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        names = _FIELD.findall(self.text)
        unknown = [name for name in names if name not in FIELDS]
        if unknown:
            raise ValueError(f"unknown field {{{unknown[0]}}}: known are {', '.join(FIELDS)}")
        if len(set(names)) < len(names):
            raise ValueError("a field stands twice")
        if re.search(r"[{}]", _FIELD.sub("", self.text)):
            raise ValueError("a brace that belongs to no {field}")
        object.__setattr__(self, "fields", frozenset(names))

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        parts = _FIELD.split(self.text)
        texts = map(re.escape, parts[::2])
        groups = [f"(?P<{name}>{FIELDS[name][0]})" for name in parts[1::2]] + [""]
        return re.compile("".join(t + g for t, g in zip(texts, groups, strict=True)), re.ASCII)

    def fill(self, values: Mapping[str, Any]) -> str:
        """The line with its fields written."""
        return _FIELD.sub(lambda match: str(values[match[1]]), self.text)

    def read(self, line: str) -> dict[str, Any] | None:
        """The fields of `line`, or None if it does not fit or holds an absurd number."""
        match = self._pattern.fullmatch(line)
        if match is None:
            return None
        values = {name: FIELDS[name][1](text) for name, text in match.groupdict().items()}
        finite = all(math.isfinite(v) for v in values.values() if isinstance(v, float))
        return values if finite else None


def template(
    needs: Set[str] = frozenset(), allows: Set[str] | None = None, ends: str = ""
) -> Reader[Template]:
    """Reader of a template with the fields `needs` and possibly `allows`, ending in `ends`.

    Any field is allowed if `allows` is None.
    """
    read_text = text_reader(ascii_only=True)
    wanted = ", ".join(f"{{{name}}}" for name in sorted(needs)) or "no field"

    def read(value: Value) -> Template:
        try:
            found = Template(read_text(value))
        except ValueError as error:
            raise value.refused(f"{value.key}: {shown(error, 300)}", "bad-template") from error
        surplus = found.fields - needs - allows if allows is not None else set()
        if needs - found.fields or surplus:
            raise value.refused(f"{value.key}: expected {wanted} in it", "bad-template")
        if not found.text.endswith(ends):
            raise value.refused(f"{value.key}: expected {ends} at its end", "bad-template")
        return found

    return read


# -- numbered lines ---------------------------------------------------------------------------
# Numbered lines with a checksum.


def _crc16(data: bytes) -> str:
    """CRC-16/XMODEM: polynomial 0x1021, from 0."""
    return f"{crc_hqx(data, 0):04X}"


CHECKSUMS: dict[str, Callable[[bytes], str]] = {
    "xor8": lambda data: f"{reduce(xor, data, 0):02X}",
    "sum8": lambda data: f"{sum(data) % 256:02X}",
    "crc16": _crc16,
}


class BadFrame(ValueError):
    """A line whose checksum or form is not that of a frame."""


@dataclass(frozen=True)
class Check:
    """Line numbers and checksums; `form` has a number, a body and, last, the check."""

    form: Template = stated(template({"number", "body", "check"}, ends="{check}"))
    checksum: str = stated(one_of(*CHECKSUMS))
    numbers: int = stated(whole(100, 1_000_000))
    resend: str = stated(text_reader(ascii_only=True))
    hello: str = stated(text_reader(ascii_only=True))

    @property
    def overhead(self) -> int:
        """Bytes that a frame adds to its body, at most."""
        return len(self.wrap("", self.numbers - 1))

    def wrap(self, body: str, number: int) -> str:
        filled = self.form.fill({"number": number, "body": body, "check": ""})
        return filled + CHECKSUMS[self.checksum](filled.encode("latin-1"))

    def unwrap(self, line: str) -> tuple[int, str]:
        """Number and body of `line`; BadFrame if it is not as it was sent."""
        read = self.form.read(line)
        if read is None or self.wrap(read["body"], read["number"]) != line:
            raise BadFrame(line)
        return read["number"], read["body"]

    def after(self, number: int, steps: int = 1) -> int:
        return (number + steps) % self.numbers

    def ahead(self, number: int, reference: int) -> int:
        """Steps from `reference` to `number`, negative if behind, modulo `numbers`."""
        half = self.numbers // 2
        return (number - reference + half) % self.numbers - half
