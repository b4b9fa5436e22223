"""`mopro compile`."""

from __future__ import annotations

import json

import click

from mopro.cli.programs import compiled_program
from mopro.cli.terminal.options import grammar_option, program_argument
from mopro.cli.terminal.say import say


@click.command()
@program_argument()
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--canonical", is_flag=True, help="Print the statements as they go to a controller.")
def command(file: str, grammar: str, as_json: bool, canonical: bool) -> None:
    """Print the motion IR of a program.

    Example: mopro compile programs/TEMP2.CMD
    """
    from mopro.program import statements

    program = compiled_program(file, grammar)
    if as_json:
        say(json.dumps(statements.as_json(program), indent=1))
    else:
        say(statements.canonical(program) if canonical else statements.listing(program), nl=False)
