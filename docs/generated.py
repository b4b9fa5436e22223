"""Text of pages that the program itself states: effects, rules, commands and their options.

A page has `<!-- generated: NAME -->` on a line of its own where the text belongs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import click

from mopro.cli.main import group
from mopro.effects.document import markdown as effects
from mopro.lint.explain import page as rules

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


TEXTS = {"commands": commands, "effects": effects, "rules": rules}


def expanded(markdown: str) -> str:
    """`markdown` with what its marks name in their place; KeyError for an unknown name."""
    return _MARK.sub(lambda mark: _TITLE.sub("", TEXTS[mark[1]]()), markdown)
