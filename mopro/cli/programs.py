"""A program file for a command, its warnings told."""

from __future__ import annotations

import click

from mopro.api import compile_file
from mopro.errors import render_all
from mopro.program import Program


def compiled_program(file: str, grammar: str) -> Program:
    """The program in `file`; warnings go to stderr, errors are raised."""
    program = compile_file(file, grammar)
    if program.warnings:
        click.echo(render_all(program.warnings, program.source), err=True)
    return program
