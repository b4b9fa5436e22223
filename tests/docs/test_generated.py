"""Text that pages take from the program: all of it, in its place."""

import csv
import re

import pytest

from helpers.paths import ROOT
from helpers.site import module_of_docs
from mopro.cli.main import COMMANDS
from mopro.effects.registry import own_effects
from mopro.lint.rules import RULES

GENERATED = module_of_docs("generated")
PAGES = {path.name: path.read_text("utf-8") for path in sorted((ROOT / "docs").glob("*.md"))}
FOUND = {"effects.md": own_effects(), "lint.md": RULES}


@pytest.mark.parametrize("name", FOUND)
def test_a_page_has_each_of_its_kind_once(name):
    headings = re.findall(r"^### ([\w-]+)$", GENERATED.expanded(PAGES[name]), re.MULTILINE)
    assert sorted(headings) == sorted(FOUND[name])


def test_the_page_of_commands_has_the_help_of_each():
    text = GENERATED.expanded(PAGES["commands.md"])
    assert {re.split(r"[ \n]", part)[0] for part in text.split("### mopro ")[1:]} == set(COMMANDS)
    assert "--allow-python" in text


def test_each_text_stands_on_one_page_under_one_title():
    marks = re.findall(r"<!-- generated: (\w+) -->", "".join(PAGES.values()))
    assert sorted(marks) == sorted(GENERATED.TEXTS)
    for text in PAGES.values():
        assert len(re.findall(r"^# ", GENERATED.expanded(text), re.MULTILINE)) == len(
            re.findall(r"^# ", text, re.MULTILINE)
        )


def test_a_mark_of_no_text_is_an_error():
    with pytest.raises(KeyError, match="nonsense"):
        GENERATED.expanded("<!-- generated: nonsense -->\n")


FIGURES = sorted((ROOT / "docs" / "data" / "figures").glob("*.csv"))


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("path", FIGURES, ids=lambda path: path.stem)
def test_figures_have_a_command_and_a_commit_and_stand_on_a_page(path):
    for row in rows_of(path):
        assert None not in row
        assert None not in row.values()
        assert re.match(
            r"python bench/|sh examples/|mopro |OMP_NUM_THREADS=1 mopro ", row["measured by"]
        )
        assert row.get("commit") or re.fullmatch("[0-9a-f]{7}", row["recorded in"])
    mark = f"<!-- table: data/figures/{path.name}"
    assert [text for text in PAGES.values() if mark in text]


def test_a_table_has_the_rows_asked_for_and_not_where_they_come_from():
    whole, present = (
        GENERATED.table("data/figures/seeds.csv", *only) for only in ((), ("present", "yes"))
    )
    assert len(whole.splitlines()) > len(present.splitlines()) > 10
    assert whole.splitlines()[0] == "| present | grid | part | seed | commit | cases | outcome |"
    assert "bench/" not in whole
    assert present.splitlines()[0] == "| grid | part | seed | commit | cases | outcome |"


def test_counts_of_a_target_give_its_share():
    for row in rows_of(ROOT / "docs" / "data" / "figures" / "targets.csv"):
        if found := re.fullmatch(r"([\d.]+)% \((\d+) of (\d+)\)", row["reached"]):
            share, part, whole = map(float, found.groups())
            assert whole == float(row["cases"]), row
            assert share == pytest.approx(100 * part / whole, abs=0.051), row
