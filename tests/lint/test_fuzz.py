"""The short form of bench/lint_fuzz.py."""

import random

import pytest

from helpers.lint_fuzz import check_input, fuzz_input
from mopro.errors import SourceError
from mopro.language import source_from_bytes
from mopro.lint import Settings, lint


@pytest.mark.parametrize("seed", range(4))
def test_nothing_but_findings_inside_the_file(seed):
    source = random.Random(seed)
    for number in range(500):
        check_input(fuzz_input(source), number)


@pytest.mark.parametrize("blank", ["\x1e", "\x1c", "\x85", "\xa0", "\u2003"])
def test_white_space_of_others_is_text_that_does_not_belong(blank):
    (found,) = lint(source_from_bytes(f"WT1\n{blank}\n".encode(), "x"), Settings())
    assert (found.rule, str(found.span)) == ("unknown-mnemonic", "2:1")


def test_inputs_are_of_every_kind():
    source = random.Random(1)
    compiles = broken = refused = 0
    for _ in range(400):
        try:
            text = source_from_bytes(fuzz_input(source), "x")
        except SourceError:
            refused += 1
            continue
        found = {f.severity for f in lint(text, Settings(select=frozenset({"unknown-mnemonic"})))}
        broken += bool(found)
        compiles += not found
    assert min(compiles, broken) > 50
    assert refused > 0
