"""`mopro thesis`."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from mopro.cli.terminal.say import say

_NAMES = ["3.2", "3.3", "4.1", "4.2", "4.3", "4.4", "4.5"]
_COLUMNS = ("row", "quantity", "printed", "computed", "deviation", "note")
_MOST_ROWS = 200


@click.command()
@click.argument("name", metavar="[TABLE]", type=click.Choice(_NAMES), required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(name: str | None, as_json: bool) -> None:
    """Print the source's tables beside what mopro computes.

    Tables 3.2, 3.3, 4.1 to 4.5; all of them without a name. Misprinted formulas are
    evaluated as printed, and marked.

    Example: mopro thesis 3.2
    """
    from mopro.cli.terminal.table import print_table
    from mopro.thesis import table

    tables = {key: table(key) for key in ([name] if name else _NAMES)}
    if as_json:
        say(json.dumps([asdict(row) for rows in tables.values() for row in rows], indent=1))
        return
    for key, rows in tables.items():
        say(f"Table {key}")
        cells = [
            [r.row, r.quantity, _cell(r.printed), _cell(r.computed), _share(r.deviation), r.note]
            for r in rows
        ]
        print_table(_COLUMNS, cells, _MOST_ROWS)


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _share(deviation: float | None) -> str:
    return "" if deviation is None else f"{deviation:+.3%}"
