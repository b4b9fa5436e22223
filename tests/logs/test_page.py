"""docs/logs.md names each kind of log that went wrong with the tests that try it."""

import re

import pytest

from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "logs.md").read_text("utf-8")
TABLES = PAGE.partition("\n## Kinds that went wrong once\n")[2].partition("\n## ")[0]
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in TABLES.splitlines()
    if line.startswith("| ") and not line.startswith("| input")
]


def test_the_tables_are_read():
    assert len(ROWS) > 30


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_each_row_names_tests_that_are_there(row):
    _, happens, tests = row
    assert happens
    named = re.findall(r"`([^`]+)`", tests)
    assert named
    assert [name for name in named if not (ROOT / "tests" / name).is_file()] == []


@pytest.mark.parametrize("title", re.findall(r"(?m)^\| it decides \| by \|\n\|.*\n", PAGE))
def test_no_row_stands_twice(title):
    table = PAGE.partition(title)[2].partition("\n\n")[0]
    decided = [line.split("|")[1].strip() for line in table.splitlines()]
    assert sorted(set(decided)) == sorted(decided)
