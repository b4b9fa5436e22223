"""Options of commands that read a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from mopro.logs import Asked

_TIME_UNITS = ("s", "ms", "us", "ns", "min", "h")


def log_options() -> Callable[[Any], Any]:
    """Options for facts that a log may not state: its times, its words for a missing reading."""
    options = [
        click.option("--time", metavar="COLUMN", help="The column of times."),
        click.option("--time-unit", type=click.Choice(_TIME_UNITS), help="Unit of the times."),
        click.option(
            "--rate",
            type=click.FloatRange(0, min_open=True),
            metavar="HZ",
            help="Rows a second, for a log without times.",
        ),
        click.option(
            "--missing",
            multiple=True,
            metavar="VALUE",
            help="A word or number for a missing reading.",
        ),
    ]

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def asked_of(
    time: str | None, time_unit: str | None, rate: float | None, missing: tuple[str, ...]
) -> Asked:
    """The options as the reader of logs takes them."""
    from mopro.logs import Asked

    if time is not None and rate is not None:
        raise click.UsageError("--time and --rate exclude each other: state one of them")
    return Asked(time, time_unit, rate, missing)
