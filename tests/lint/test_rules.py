"""Each rule finds its mistake where it is, and not the near miss; its texts can be trusted."""

import re
from dataclasses import replace

import pytest

from helpers.paths import DATA, ROOT
from mopro.language import ast, load
from mopro.language.parse import statement_kinds
from mopro.lint import Settings, lint
from mopro.lint.config import lengths
from mopro.lint.output import explain
from mopro.lint.rules import RULES
from mopro.source import Source
from mopro.text import visible

FAULTY = DATA / "lint"
EXPECTATION = re.compile(r"; expect (?:(\d+:\d+) )?.*?(?: with (.*))?$")


def settings_of(options):
    words = (options or "").split()
    given = dict(zip(words[::2], words[1::2], strict=True))
    select = frozenset(given["--select"].split(",")) if "--select" in given else None
    start = lengths(dict([given["--start"].split("=")])) if "--start" in given else {}
    return Settings(grammar=given.get("--grammar", "attested"), select=select, start_m=start)


def rule_settings(rule):
    select = None if rule.default else frozenset({rule.name})
    return replace(rule.example, select=select)


@pytest.mark.parametrize("name", RULES)
def test_bad_program_gives_exactly_its_finding(name):
    source = load(FAULTY / "bad" / f"{name}.CMD")
    place, options = EXPECTATION.match(source.line(1)).groups()
    found = lint(source, settings_of(options))
    assert [(str(f.span), f.rule) for f in found] == [(place, name)]


@pytest.mark.parametrize("name", RULES)
def test_near_miss_gives_nothing(name):
    source = load(FAULTY / "near" / f"{name}.CMD")
    options = EXPECTATION.match(source.line(1))[2]
    assert lint(source, settings_of(options)) == []


def test_every_data_file_belongs_to_a_rule():
    for folder in ("bad", "near"):
        assert {path.stem for path in (FAULTY / folder).iterdir()} == set(RULES)


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda r: r.name)
def test_examples_of_the_explanation_do_what_it_says(rule):
    bad = lint(Source("bad", rule.bad), rule_settings(rule))
    assert [f.rule for f in bad] == [rule.name]
    assert bad[0].severity is rule.severity
    assert lint(Source("good", rule.good), rule_settings(rule)) == []
    assert visible(rule.bad) in explain(rule)
    assert rule.good in explain(rule)


@pytest.mark.parametrize("path", sorted((ROOT / "programs").glob("*.CMD")), ids=lambda p: p.stem)
def test_programs_of_the_thesis_give_only_what_is_explained(path):
    """`expected` has a line `place rule: why it is true` for each finding."""
    lines = (FAULTY / "expected" / f"{path.stem}.txt").read_text("utf-8").splitlines()
    expected = [line.partition(":  ")[0] for line in lines]
    assert all(line.partition(":  ")[2] for line in lines)
    found = lint(load(path), Settings(select=frozenset(RULES)))
    assert [f"{f.span} {f.rule}" for f in found] == expected


STATEMENTS = [kind.form for kind in statement_kinds("extended") if kind is not ast.Label]
BEFORE = "UU012500/1\nVEL0 5.0\nACC0 0.25\n"


def comments_told(line):
    """The findings about comments in a program with this line, with `unreachable` and the like."""
    asked = Settings(grammar="extended", select=frozenset({"statement-in-comment"}))
    return [f for f in lint(Source("x", f"{BEFORE}{line}\n"), asked) if f.rule in asked.select]


@pytest.mark.parametrize("statement", STATEMENTS)
@pytest.mark.parametrize(
    "written", ["WT1;{}", "WT1 ; {}", "WT1;;\t{}", "WT1; {};WX1", "WT1;{} ; the second", "wt1;{}  "]
)
@pytest.mark.parametrize("letters", [str.upper, str.lower])
def test_a_statement_behind_a_semicolon_is_told(statement, written, letters):
    line = written.format(letters(statement))
    (found,) = comments_told(line)
    assert (found.span.line, found.span.column) == (4, line.index(";") + 1)
    assert f"`{letters(statement)}`" in found.message


@pytest.mark.parametrize("statement", STATEMENTS)
@pytest.mark.parametrize(
    "written",
    [";{}", "  ; {}", "WT1 ; {} would be too long", "WT1 ; then {}", "WT1 ; was: {}", "WT1 ; ({})"],
)
def test_a_line_out_of_use_and_words_with_a_statement_in_them_are_not(statement, written):
    assert comments_told(written.format(statement)) == []


@pytest.mark.parametrize(
    "words",
    ["", "40 in/s", "VEL is 5 in/s", "wait", "go home", "go!", "to the left", "1", "15.0", "stop",
     "axis 1", "mopro: allow stall", "MRI", "ACC 250", "B1", "home", "Move 1", "up ; and down"],
)  # fmt: skip
def test_prose_is_no_statement(words):
    assert comments_told(f"WT1 ; {words}") == []


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.CMD")), ids=lambda p: p.stem)
def test_no_program_of_the_repository_has_one(path):
    source = load(path)
    rule = "statement-in-comment"
    told = [f.rule for f in lint(source, Settings(grammar="extended", select=frozenset({rule})))]
    assert (rule in told) is (path == FAULTY / "bad" / f"{rule}.CMD")
