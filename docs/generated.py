"""Text of pages that the program states, and tables of figures that are kept as data.

A page has a mark on a line of its own where the text belongs: `<!-- generated: NAME -->` for effects,
rules or commands; `<!-- table: data/NAME.csv -->` for a table, or `<!-- table: data/NAME.csv COLUMN=VALUE -->`
for those rows of it, without that column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import click

from mopro.cli.main import group
from mopro.effects.document import markdown as effects
from mopro.lint.explain import page as rules

_TABLE = re.compile(r"^<!-- table: ([\w/]+\.csv)(?: (\w+)=(\w+))? -->$", re.MULTILINE)
# Columns that say where a figure comes from; they stay in the file.
_ORIGIN = {"measured by", "recorded in"}
_MARK = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)
_TITLE = re.compile(r"\A# .*\n+")
_WIDTH = 90


def commands() -> str:
    """The help of every command, a heading and a block for each."""
    return "\n".join(
        f"### {context.command_path}\n\n```\n{context.get_help()}\n```\n"
        for context in _leaves(_context(group, "mopro", None))
    )


def _context(command: click.Command, name: str, parent: click.Context | None) -> click.Context:
    return click.Context(command, parent, name, terminal_width=_WIDTH)


def _leaves(context: click.Context) -> Iterator[click.Context]:
    command = context.command
    if not isinstance(command, click.Group):
        yield context
        return
    for name in command.list_commands(context):
        child = command.get_command(context, name)
        assert child is not None, name
        yield from _leaves(_context(child, name, context))


def table(name: str, column: str | None = None, value: str | None = None) -> str:
    """The CSV file `name`, from docs/, as Markdown; KeyError for a column that it does not have."""
    with open(Path(__file__).parent / name, encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if column is None or row[column] == value]
    heads = [head for head in rows[0] if head not in _ORIGIN | {column}]
    lines = [heads, ["---"] * len(heads), *([row[head] for head in heads] for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


TEXTS = {"commands": commands, "effects": effects, "rules": rules}


def expanded(markdown: str) -> str:
    """`markdown` with what its marks name in their place; KeyError for an unknown name."""
    markdown = _TABLE.sub(lambda mark: table(*mark.groups()), markdown)
    return _MARK.sub(lambda mark: _TITLE.sub("", TEXTS[mark[1]]()), markdown)
