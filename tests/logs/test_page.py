"""docs/data/log_kinds.csv names each kind of log that went wrong with the tests that try it."""

import csv
import re

import pytest

from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "logs.md").read_text("utf-8")
with open(ROOT / "docs" / "data" / "log_kinds.csv", encoding="utf-8", newline="") as file:
    ROWS = list(csv.DictReader(file))


def test_the_page_shows_the_table():
    assert len(ROWS) > 30
    assert "<!-- table: data/log_kinds.csv -->" in PAGE


@pytest.mark.parametrize("row", ROWS, ids=[row["input"] for row in ROWS])
def test_each_row_names_tests_that_are_there(row):
    assert row["what happens now"]
    named = re.findall(r"`([^`]+)`", row["tests"])
    assert named
    assert [name for name in named if not (ROOT / "tests" / name).is_file()] == []


def test_no_row_stands_twice():
    (title,) = re.findall(r"(?m)^\| it decides \| by \|\n\|.*\n", PAGE)
    decided = [
        line.split("|")[1].strip()
        for line in PAGE.partition(title)[2].partition("\n\n")[0].splitlines()
    ]
    assert sorted(set(decided)) == sorted(decided)
    inputs = [row["input"] for row in ROWS]
    assert sorted(set(inputs)) == sorted(inputs)
