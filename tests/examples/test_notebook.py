"""The notebook of examples/, cell by cell, as a kernel would run it."""

import ast
import json

import pytest

from helpers.paths import ROOT

FILE = ROOT / "examples" / "hide_and_find.ipynb"
CELLS = json.loads(FILE.read_text("utf-8"))["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


def run_cell(text, names):
    """The value of the last expression of a cell, None if it ends in a statement."""
    tree = ast.parse(text)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, FILE.name, "exec"), names)
    return eval(compile(ast.Expression(last.value), FILE.name, "eval"), names) if last else None


@pytest.fixture(scope="module")
def shown():
    """The object that each cell shows, after all cells have run."""
    names = {}
    return [run_cell(text, names) for text in CODE], names


def test_every_cell_shows_something(shown):
    objects, _ = shown
    for each in objects[:-1]:
        picture = getattr(each, "_repr_png_", None)
        page = each._repr_html_() if picture is None else picture()
        assert len(page) > 150


def test_the_hidden_effect_is_named_and_the_gap_closes(shown):
    objects, names = shown
    verdict = names["conclusion"].verdict
    assert [effect.name for effect in verdict.effects] == ["viscous_drag"]
    low, high = verdict.effects[0].parameters["b"].ci95
    assert low - 0.2 < 9.0 < high + 0.2
    assert names["comparison"].verdict == "disagreement"
    assert objects[-1] == "no disagreement"


def test_no_output_is_kept_in_the_file():
    assert {str(cell.get("outputs", [])) for cell in CELLS} == {"[]"}
