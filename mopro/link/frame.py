"""Numbered lines with a checksum."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import xor

from mopro.link.template import Template, template
from mopro.tomlfile.schema import one_of, stated, text, whole


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
    resend: str = stated(text(ascii_only=True))
    hello: str = stated(text(ascii_only=True))

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
