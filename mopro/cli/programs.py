"""Reads a program file for a command, and prints its warnings."""

from __future__ import annotations

from mopro.cli.terminal.say import say_findings
from mopro.cli.texts import read_text
from mopro.errors import render_all
from mopro.language import parse
from mopro.program import Program, lower


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
