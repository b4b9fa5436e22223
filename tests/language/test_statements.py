"""Each statement of the grammars is known to all that handle statements."""

import pytest

import mopro
from helpers.paths import ROOT
from helpers.site import module_of_docs
from mopro.language import ast, parse
from mopro.language.format import format_source
from mopro.language.parse import GRAMMARS, grammar_path, statement_kinds
from mopro.lint import Settings
from mopro.lsp.open_text import Document, hover
from mopro.motion import plan
from mopro.program import statements
from mopro.source import Source

DOCS = module_of_docs("generated").expanded((ROOT / "docs" / "language.md").read_text("utf-8"))
EACH = pytest.mark.parametrize("kind", statement_kinds("extended"), ids=lambda kind: kind.rule())
SETUP = ("UU012500/1", "VEL0 5.0", "ACC0 0.25", "WT1", "MR1 1.0")
TRAVEL_U = dict.fromkeys((1, 2), (-50_000.0, 50_000.0))


def test_the_extended_grammar_has_a_class_for_every_statement_and_no_other():
    assert statement_kinds("extended") == list(ast.STATEMENTS.values())
    assert set(statement_kinds("attested")) < set(statement_kinds("extended"))


def test_each_alternative_of_the_grammar_files_has_its_class():
    for file in GRAMMARS.values():
        lines = grammar_path(file).read_text("ascii").splitlines()
        rules = {line.partition(":")[0] for line in lines if line[:1].islower() and ":" in line}
        assert rules - {"line"} <= set(ast.STATEMENTS)


@EACH
def test_an_example_is_of_its_kind_and_in_the_canonical_layout(kind):
    source = Source("x.CMD", f"{kind.form}\n")
    (statement,) = parse(source, "extended").statements
    assert type(statement) is kind
    assert format_source(source, "extended") == source
    assert kind.form.startswith(kind.mnemonic())


@EACH
def test_it_is_lowered_written_planned_and_explained(kind):
    lines = [*SETUP, kind.form] if kind is ast.Label else [":B1", *SETUP, kind.form]
    source = Source("x.CMD", "\n".join(lines))
    program = mopro.compile(source.text, grammar="extended")
    assert program.ops[-1].written_as() is kind
    assert mopro.compile(statements.canonical(program), grammar="extended") == program
    assert plan(program, for_s=1.0, travel_u=TRAVEL_U).duration_s <= 1.0
    document = Document(source, Settings(grammar="extended"))
    assert kind.meaning in hover(document, len(lines))


@EACH
def test_it_is_in_the_documentation_and_assumed_unless_attested(kind):
    assert f"`{kind.mnemonic()}" in DOCS
    assert ("(assumed)" in kind.meaning) == (kind not in statement_kinds("attested"))
