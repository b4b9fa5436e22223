"""Text that pages take from the program: all of it, in its place."""

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
