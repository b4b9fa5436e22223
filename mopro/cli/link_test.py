"""`mopro link-test`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from mopro.cli.link import baud_option, connected_session, dialect_option, trace_option
from mopro.cli.main import EXIT_FAILED
from mopro.cli.terminal.options import Quantity
from mopro.cli.terminal.outputs import keep_inputs
from mopro.cli.terminal.say import say


@click.command()
@click.option("--port", required=True, metavar="URL", help="Where the controller is.")
@dialect_option()
@baud_option()
@click.option(
    "--deadline",
    type=Quantity("time", "s", positive=True),
    default=60.0,
    show_default=True,
    help="Give up after this.",
)
@trace_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    port: str, dialect: str, baud: int | None, deadline: float, trace: Path | None, as_json: bool
) -> int:
    """Walk through a dialect on a live controller and say what matches. Moves nothing.

    Overwrites the controller's scratch program. Exits with 1 if anything does not match.

    Example: mopro link-test --port /dev/ttyUSB0 --dialect mine.toml --trace link.log
    """
    from mopro.link.probe import probe

    keep_inputs([("--trace", trace)], [("--dialect", dialect)])
    steps = []
    with connected_session(port, dialect, baud, trace) as session:
        session.give(deadline)
        for step in probe(session):
            steps.append(step)
            if not as_json:
                say(f"{'matched' if step.matched else 'NOT AS SAID':<12} {step.name}: {step.said}")
    if as_json:
        say(json.dumps([asdict(step) for step in steps], indent=1))
    return 0 if all(step.matched for step in steps) else EXIT_FAILED
