"""Commands on program files: `mopro compile`, `mopro fmt`, `mopro lsp`; `mopro lint` has its own.

Texts that a command changes are read and written byte for byte.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.options import grammar_option, program_argument
from mopro.cli.say import say, say_bytes, say_findings, say_json
from mopro.errors import MoproError, render_all
from mopro.language import parse
from mopro.language.load import MOST_BYTES, load_bytes, source_from_bytes
from mopro.program import Program, lower
from mopro.source import Source


def read_text(file: str) -> tuple[Source, bytes]:
    """The text in `file` (`-`: standard input), and the bytes from its Ctrl-Z on."""
    if file == "-":
        data, name = sys.stdin.buffer.read(MOST_BYTES + 1), "<stdin>"
    else:
        data, name = load_bytes(file), file
    source = source_from_bytes(data, name)
    return source, data[len(source.encoded) :]


def write_text(file: str, source: Source, tail: bytes) -> None:
    """Write `source` in its own encoding with `tail` behind it; `-` is standard output."""
    data = source.encoded + tail
    if file == "-":
        say_bytes(data)
        return
    from mopro.files import write

    write(Path(file), data)


def show_difference(before: Source, after: Source) -> None:
    from difflib import unified_diff

    ends = (before.lines_with_ends, after.lines_with_ends)
    old, new = ([line.rstrip("\r\n") for line in lines] for lines in ends)
    for line in unified_diff(old, new, before.name, f"{before.name} (fixed)", lineterm=""):
        say(line)


# -- programs ---------------------------------------------------------------------------------


def compiled_program(file: str, grammar: str) -> Program:
    """The program in `file` (`-`: standard input); warnings go to stderr, errors are raised."""
    program = lower(parse(read_text(file)[0], grammar))
    if program.warnings:
        say_findings(render_all(program.warnings, program.source), err=True)
    return program


def refuse_unrunnable(program: Program, machine: str, for_s: float | None = None) -> None:
    """MotionError for what a run would refuse, before a controller hears of it."""
    from mopro.machine import DEFAULT_LOOP_S, load_machine
    from mopro.motion import plan

    if program.loops_forever and for_s is None:
        for_s = DEFAULT_LOOP_S
    plan(program, for_s, load_machine(machine).travel_u())


# -- mopro compile ----------------------------------------------------------------------------


@click.command()
@program_argument()
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--canonical", is_flag=True, help="Print the statements as they go to a controller.")
def compile_file(file: str, grammar: str, as_json: bool, canonical: bool) -> None:
    """Print the motion IR of a program.

    Example: mopro compile programs/TEMP2.CMD
    """
    from mopro.program import statements

    program = compiled_program(file, grammar)
    if as_json:
        say_json(statements.as_json(program))
    else:
        say(statements.canonical(program) if canonical else statements.listing(program), nl=False)


# -- mopro fmt --------------------------------------------------------------------------------


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--check", is_flag=True, help="Change nothing; exit with 1 if a file would change.")
@click.option("--diff", is_flag=True, help="Change nothing; show what would change.")
@grammar_option()
def fmt(files: tuple[str, ...], check: bool, diff: bool, grammar: str) -> int:
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


# -- mopro lsp --------------------------------------------------------------------------------


@click.command()
def lsp() -> int:
    """Serve an editor over standard input and output (language server protocol).

    Needs the extra `lsp`: pip install 'mopro[lsp]'.

    Example: mopro lsp
    """
    try:
        from mopro.lsp.language_server import LibraryWarnings, Messages, server
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise click.UsageError("this needs more: pip install 'mopro[lsp]'") from error
    import logging

    logging.getLogger().addHandler(LibraryWarnings(partial(say, err=True)))
    messages = Messages(sys.stdin.buffer)
    server.start_io(messages)  # type: ignore[arg-type]
    if messages.fault is not None:
        say(f"mopro: the editor sent {messages.fault} [bad-message]", err=True)
        return EXIT_BAD_INPUT
    return 0
