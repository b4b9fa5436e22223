"""`mopro init`."""

from __future__ import annotations

from pathlib import Path

import click

from mopro.cli.terminal.say import say


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
def command(folder: Path) -> None:
    """Make a folder to start in: a program, a machine, an experiment and a README.

    The commands of its README run as they stand, in the folder. No file is overwritten.

    Example: mopro init first && cd first
    """
    from mopro.starter import start

    for file in start(folder):
        say(str(file))
    say(f"next: cd {folder}, and the commands of README.md")
