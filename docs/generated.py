"""Text of pages that the program states, and tables of figures that are kept as data.

A page has a mark on a line of its own where the text belongs:

    <!-- generated: NAME -->                           one of `TEXTS`
    <!-- table: data/NAME.csv -->                      a table
    <!-- table: data/NAME.csv COLUMN=VALUE -->         those rows of it, without that column
"""

from __future__ import annotations

import csv
import inspect
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import click

from mopro import stated
from mopro.cli.main import group
from mopro.effects.catalogue_page import markdown as effects
from mopro.formula.signals import SIGNALS
from mopro.language.ast import Statement
from mopro.language.parse import statement_kinds
from mopro.link.course import TABLE, Awaited, Step
from mopro.link.dialect import STATES
from mopro.lint.output import page as rules

_TABLE = re.compile(r"^<!-- table: ([\w/]+\.csv)(?: (\w+)=(\w+))? -->$", re.MULTILINE)
# Columns that say where a figure comes from; they stay in the file.
_ORIGIN = {"measured by", "recorded in"}
_CATALOGUE = Path(stated.__file__).parent / "catalogue"
_KINDS = {
    "kinematic": "kinematic",
    "kinematic, of an effort": "kinematic_effort",
    "axis": "axis",
    "thermal": "thermal",
}
_AWAITED = {awaited: awaited.value for awaited in Awaited}
_STEPS = {Step.GO_ON: "go on", Step.END: "**end**", Step.STOP: "**stop, then end**"}
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


def attested() -> str:
    """The statements that the sources show."""
    return _statements(statement_kinds("attested"))


def extended() -> str:
    """The statements of the extended grammar alone."""
    known = statement_kinds("attested")
    return _statements(kind for kind in statement_kinds("extended") if kind not in known)


def _statements(kinds: Iterable[type[Statement]]) -> str:
    rows = [[f"`{kind.form}`", kind.meaning] for kind in kinds]
    return _rows([["written", "meaning"], ["---", "---"], *rows])


def signals() -> str:
    """The functions of a signal in time that a formula may call."""
    rows = [
        [f"`{name}({', '.join([*inspect.signature(function).parameters][1:])})`", _told(function)]
        for name, function in SIGNALS.items()
    ]
    return _rows([["function", ""], ["---", "---"], *rows])


def _told(function: Callable[..., object]) -> str:
    return " ".join((inspect.getdoc(function) or "").split())


def course() -> str:
    """Meaning of each state of a controller to a run; `before / at` its time where these differ."""
    lines = [["state", *_AWAITED.values()], ["---"] * (1 + len(_AWAITED))]
    for state in STATES:
        cells = []
        for awaited in _AWAITED:
            early, due = (_STEPS.get(entry, "trouble") for entry in TABLE[awaited][state])
            cells.append(early if early == due else f"{early} / {due}")
        lines.append([state, *cells])
    return _rows(lines)


def listed() -> str:
    """The effects that are listed for each kind of machine beside the motor."""
    parts = []
    for title, name in _KINDS.items():
        entries = tomllib.loads((_CATALOGUE / f"{name}.toml").read_text("utf-8"))["effect"]
        rows = [
            f"| {e['name']}{', ' + e['form'] if e.get('form') else ''} | {e['enters']} "
            f"| `{e['formula']}` |"
            for e in entries
        ]
        parts.append(f"**{title}**\n\n| effect | enters as | formula |\n|---|---|---|\n")
        parts.append("\n".join(rows).replace("||", "\\|\\|") + "\n\n")
    return "".join(parts)


def table(name: str, column: str | None = None, value: str | None = None) -> str:
    """The CSV file `name`, from docs/, as Markdown; KeyError for a column that it does not have."""
    with open(Path(__file__).parent / name, encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if column is None or row[column] == value]
    heads = [head for head in rows[0] if head not in _ORIGIN | {column}]
    return _rows([heads, ["---"] * len(heads), *([row[head] for head in heads] for row in rows)])


def _rows(lines: Iterable[Iterable[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


TEXTS = {
    "attested": attested,
    "commands": commands,
    "course": course,
    "effects": effects,
    "extended": extended,
    "listed": listed,
    "rules": rules,
    "signals": signals,
}


def expanded(markdown: str) -> str:
    """`markdown` with what its marks name in their place; KeyError for an unknown name."""
    markdown = _TABLE.sub(lambda mark: table(*mark.groups()), markdown)
    return _MARK.sub(lambda mark: _TITLE.sub("", TEXTS[mark[1]]()), markdown)
