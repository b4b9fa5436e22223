"""`mopro fmt`."""

from __future__ import annotations

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.terminal.options import grammar_option
from mopro.cli.terminal.say import say
from mopro.cli.texts import read_text, show_difference, write_text
from mopro.errors import MoproError


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--check", is_flag=True, help="Change nothing; exit with 1 if a file would change.")
@click.option("--diff", is_flag=True, help="Change nothing; show what would change.")
@grammar_option()
def command(files: tuple[str, ...], check: bool, diff: bool, grammar: str) -> int:
    """Write programs in the canonical layout; comments and meaning stay as they are.

    FILE may be - to read standard input and write standard output. A file that does not
    parse is left as it is. With --check or --diff the exit code is 1 if a file would change.

    Example: mopro fmt --diff programs/LVDT3.CMD
    """
    code = 0
    for file in files:
        try:
            changed = _format_file(file, check, diff, grammar)
        except MoproError as error:
            say(error.render(), err=True)
            code = EXIT_BAD_INPUT
            continue
        code = max(code, EXIT_FAILED if changed and (check or diff) else 0)
    return code


def _format_file(file: str, check: bool, diff: bool, grammar: str) -> bool:
    """Format one file, or tell what that would do; whether its layout was another."""
    from mopro.language.format import format_source

    source, tail = read_text(file)
    tidy = format_source(source, grammar)
    changed = tidy != source
    if diff:
        show_difference(source, tidy)
    if check and changed:
        say(f"{source.name}: would change", err=True)
    if not check and not diff and (changed or file == "-"):
        write_text(file, tidy, tail)
    return changed
