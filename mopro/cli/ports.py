"""`mopro ports`."""

from __future__ import annotations

import json

import click

from mopro.cli.terminal.say import say


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool) -> None:
    """List the serial ports of this machine.

    Example: mopro ports --json
    """
    from mopro.link.transport import available_ports

    ports = available_ports()
    if as_json:
        rows = [{"device": device, "description": text} for device, text in ports]
        say(json.dumps(rows, indent=1))
        return
    for device, text in ports:
        say(f"{device}  {text}")
    if not ports:
        say("no serial ports; a virtual controller: mopro serve", err=True)
