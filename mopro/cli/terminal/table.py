"""Tables and Markdown on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from mopro.cli.terminal.say import has_colours, is_terminal, say, say_styled
from mopro.text import visible

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

_PIPED_WIDTH = 160
# Spaces between columns: as many as leave the table within the terminal. Left and right of the
# one that is always there.
_GAPS = ((0, 1), (0, 1, 0, 0), (0, 0))


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    most: int,
    styles: Sequence[str] = (),
    width: int | None = None,
) -> None:
    """Print `rows` under `columns`, at most `most` of them: the first and the last ones.

    `styles` are rich's styles of the rows, shown in colour. The table is at most as wide as
    the terminal, and `width` where there is none; an empty line follows it.
    """
    from rich.measure import Measurement

    rows = list(rows)
    console = _console(width)
    for padding in _GAPS:
        table = _table(columns, rows, most, styles, padding)
        if Measurement.get(console, console.options, table).maximum < console.width:
            break
    _show(console, table)
    say()


def _table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    most: int,
    styles: Sequence[str],
    padding: tuple[int, ...],
) -> RenderableType:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE, show_edge=False, pad_edge=False, padding=padding)  # type: ignore[arg-type]
    for index, column in enumerate(columns):
        # In a narrow terminal figures go on in the next line; names stay whole if they can.
        table.add_column(column, overflow="fold", no_wrap=not index)
    left_out = len(rows) - most
    for index, row in enumerate(rows):
        if left_out > 0 and index == most // 2:
            table.add_row(*[f"... {left_out} more", *[""] * (len(columns) - 1)])
        if left_out <= 0 or index < most // 2 or index >= len(rows) - most // 2:
            style = styles[index] if styles else None
            table.add_row(*(Text(visible(cell)) for cell in row), style=style)
    return table


def print_markdown(text: str) -> None:
    """Print Markdown with its tables laid out on a terminal, elsewhere as it is."""
    if not is_terminal(sys.stdout):
        say(text, nl=False)
        return
    from rich.markdown import Markdown

    _show(_console(None), Markdown(visible(text)))


def _console(width: int | None) -> Console:
    from rich.console import Console

    if sys.stdout.isatty():
        return Console(force_terminal=has_colours(sys.stdout))
    return Console(width=width or _PIPED_WIDTH)


def _show(console: Console, drawn: RenderableType) -> None:
    with console.capture() as shown:
        console.print(drawn)
    say_styled(shown.get())
