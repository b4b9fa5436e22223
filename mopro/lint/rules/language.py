"""Rules that the parser and the lowering report: a program with such a finding does not compile."""

from __future__ import annotations

from mopro.errors import Severity
from mopro.lint.rule import Rule, Stage, same_program


def _error(name: str, what: str, why: str, bad: str, good: str) -> Rule:
    return Rule(name, Stage.LANGUAGE, Severity.ERROR, what, why, bad, good)


RULES = (
    _error(
        "unknown-mnemonic",
        "A line that begins with no statement of the language.",
        "The controller would refuse it or, worse, read it as something else.",
        "VLE1 40.0\n",
        "VEL1 40.0\n",
    ),
    _error(
        "missing-axis",
        "A statement whose axis digit is left out.",
        "The axis stands right after the mnemonic; without it the value has no axis.",
        "VEL 40.0\n",
        "VEL1 40.0\n",
    ),
    _error(
        "incomplete-statement",
        "A statement that ends before it is complete.",
        "A missing value cannot be guessed.",
        "VEL1\n",
        "VEL1 40.0\n",
    ),
    _error(
        "unexpected-text",
        "Something that has no place in the statement.",
        "How the controller would interpret it is not known.",
        "WT100 now\n",
        "WT100 ; now\n",
    ),
    _error(
        "bad-number",
        "A value that is no plain decimal number.",
        "The language has neither exponents nor decimal commas.",
        "VEL1 4e1\n",
        "VEL1 40.0\n",
    ),
    _error(
        "too-long",
        "A number or name of more than 30 characters, or a line of more than 4096, "
        "or more than 100000 lines.",
        "No program needs them; nearly always the file is damaged.",
        "VEL1 40.0000000000000000000000000000001\n",
        "VEL1 40.0\n",
    ),
    _error(
        "empty-program",
        "A file without a statement.",
        "There is nothing to run; comments alone are no program.",
        "; to be written\n",
        "WT100\n",
    ),
    _error(
        "no-such-axis",
        "An axis digit of an axis that the controller does not have.",
        "There are axes 1 and 2, and 0 stands for both.",
        "VEL3 40.0\n",
        "VEL2 40.0\n",
    ),
    _error(
        "zero-units",
        "A user unit with a 0 in its ratio.",
        "Lengths cannot be converted to microsteps.",
        "UU012500/0\n",
        "UU012500/1\n",
    ),
    _error(
        "bad-velocity",
        "A velocity that is not greater than 0.",
        "A move at such a velocity never ends.",
        "VEL1 0.0\n",
        "VEL1 0.00008\n",
    ),
    _error(
        "bad-acceleration",
        "An acceleration that is not greater than 0.",
        "A move with it never starts.",
        "ACC1 -0.25\n",
        "ACC1 0.25\n",
    ),
    _error(
        "bad-wait",
        "A wait of more than 1000000000 ms.",
        "That is over eleven days, and almost certainly a mistake.",
        "WT2000000000\n",
        "WT2000\n",
    ),
    _error(
        "unknown-label",
        "A jump to a label that no line defines.",
        "The controller cannot continue.",
        ":B1\nWT100\nJUMP B2\n",
        ":B1\nWT100\nJUMP B1\n",
    ),
    _error(
        "duplicate-label",
        "A label that an earlier line has defined already.",
        "Which of the two a jump goes to is not known.",
        ":B1\nWT100\n:B1\nJUMP B1\n",
        ":B1\nWT100\nJUMP B1\n",
    ),
    Rule(
        "text-after-end",
        Stage.LANGUAGE,
        Severity.WARNING,
        what="Text behind a Ctrl-Z (0x1A), which ends a program.",
        why="Under DOS a Ctrl-Z ends a text. Of files that are joined with it in place the first "
        "alone is read.",
        bad="WT100\n\x1aWT200\n",
        good="WT100\nWT200\n",
    ),
    Rule(
        "letter-o-axis",
        Stage.LANGUAGE,
        Severity.WARNING,
        what="The letter O in the place of an axis digit.",
        why="It is read as 0, all axes, as the printed listings require; a "
        "controller may refuse it.",
        bad="VELO 15.0\n",
        good="VEL0 15.0\n",
        fix=lambda subject, finding: "0",
        fix_check=same_program,
    ),
)
