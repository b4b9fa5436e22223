"""Completion of arguments in a shell: names that are built in, and files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    Items = list[CompletionItem]


def machine_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.machine import builtin_machines

    return _or_file(builtin_machines(), incomplete)


def dialect_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.link import builtin_dialects

    return _or_file(builtin_dialects(), incomplete)


def instrument_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.experiment.sawyer.raw import KINDS

    return _or_file(KINDS, incomplete)


def effect_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    """The effects of the catalogue, with what they are."""
    from mopro.effects import catalogue

    return _items({name: effect.equation() for name, effect in catalogue().items()}, "", incomplete)


def rule_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    """The rules of lint, after the last comma."""
    from mopro.lint.rules import RULES

    before, comma, last = incomplete.rpartition(",")
    return _items({name: rule.what for name, rule in RULES.items()}, before + comma, last)


def _items(words: Mapping[str, str], before: str, incomplete: str) -> Items:
    """The words that begin so, with the first line of what they mean."""
    from click.shell_completion import CompletionItem

    return [
        CompletionItem(before + word, help=text.partition("\n")[0])
        for word, text in words.items()
        if word.startswith(incomplete)
    ]


def _or_file(names: Iterable[str], incomplete: str) -> Items:
    """The `names` that begin so, or else files."""
    from click.shell_completion import CompletionItem

    found = [CompletionItem(name) for name in names if name.startswith(incomplete)]
    return [*found, CompletionItem(incomplete, type="file")]
