"""The `[rows]` of an experiment file: what an import did with the rows of the log."""

from __future__ import annotations

from dataclasses import dataclass

from mopro.logs.log import Rows
from mopro.text import visible
from mopro.tomlfile import Value
from mopro.tomlfile.schema import table_in

_MOST = 50


@dataclass(frozen=True)
class KeptRows:
    """The ledger of the log's rows, and what is to be checked about their order."""

    rows: Rows
    checks: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines that a command on the experiment repeats."""
        lost = (f"rows of the log: {self.rows}",) if self.rows.to_check else ()
        return tuple(f"CHECK: {visible(words)}" for words in (*lost, *self.checks))


def kept_rows(value: Value) -> KeptRows:
    """The table `[rows]`; it is refused where its numbers do not add up."""
    table = table_in(value)
    table.only({"read", "used", "left_out", "check"})
    data = table.data
    left_out, checks = data.get("left_out", []), data.get("check", [])
    if not _are(left_out, dict) or not _are(checks, str):
        raise value.refused("expected left_out = [{ why = ..., count = ... }], check = [...]")
    reasons = {str(e.get("why", "")): e.get("count") for e in left_out}
    numbers = (data.get("read"), data.get("used"), *reasons.values())
    if not all(isinstance(n, int) and not isinstance(n, bool) and n >= 0 for n in numbers):
        raise value.refused("expected whole numbers of rows that were read, used and left out")
    if data["read"] != data["used"] + sum(reasons.values()) or 0 in reasons.values():
        raise value.refused("the rows that were used and left out are not those that were read")
    return KeptRows(Rows(data["read"], reasons), tuple(checks))


def _are(entries: object, kind: type) -> bool:
    """True for a list of not too many entries of one kind."""
    return isinstance(entries, list) and len(entries) <= _MOST and all(
        isinstance(entry, kind) for entry in entries
    )  # fmt: skip
