"""Tables on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

from mopro.cli.say import say_styled
from mopro.text import visible

_PIPED_WIDTH = 160


def print_table(columns: Sequence[str], rows: Iterable[Sequence[str]], most: int) -> None:
    """Print `rows` under `columns`, at most `most` of them: the first and the last ones."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    table = Table(box=box.SIMPLE, pad_edge=False)
    for index, column in enumerate(columns):
        # In a narrow terminal figures go on in the next line; names stay whole if they can.
        table.add_column(column, overflow="fold", no_wrap=not index)
    left_out = len(rows) - most
    for index, row in enumerate(rows):
        if left_out > 0 and index == most // 2:
            table.add_row(*[f"... {left_out} more", *[""] * (len(columns) - 1)])
        if left_out <= 0 or index < most // 2 or index >= len(rows) - most // 2:
            table.add_row(*(Text(visible(cell)) for cell in row))
    console = Console(width=None if sys.stdout.isatty() else _PIPED_WIDTH)
    with console.capture() as drawn:
        console.print(table)
    say_styled(drawn.get())
