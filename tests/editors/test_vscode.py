"""The editor's files know the language that the grammar knows."""

import json
import re

import pytest

from helpers.paths import ROOT
from mopro.language.parse import statement_kinds

FOLDER = ROOT / "editors" / "vscode"
GRAMMAR = json.loads((FOLDER / "syntaxes" / "mopro.tmLanguage.json").read_text("utf-8"))


def patterns(node):
    if isinstance(node, dict):
        if "match" in node:
            # Python takes no flags in the middle of an expression, Oniguruma does.
            yield re.compile(node["match"].replace("(?i:", "(?:"), re.IGNORECASE)
        for child in node.values():
            yield from patterns(child)
    elif isinstance(node, list):
        for child in node:
            yield from patterns(child)


@pytest.mark.parametrize("form", [kind.form for kind in statement_kinds("extended")])
def test_each_statement_is_coloured_from_its_mnemonic_on(form):
    number = GRAMMAR["repository"]["number"]["match"]
    own = [p for p in patterns(GRAMMAR) if p.pattern != number and not p.pattern.startswith(";")]
    assert any(match and match.end() > 0 for match in (p.match(form) for p in own))


def test_manifest_names_files_that_are_there():
    manifest = json.loads((FOLDER / "package.json").read_text("utf-8"))
    contributed = manifest["contributes"]
    files = [contributed["grammars"][0]["path"], contributed["languages"][0]["configuration"]]
    assert all((FOLDER / file).is_file() for file in files)
    assert contributed["grammars"][0]["scopeName"] == GRAMMAR["scopeName"]
    assert manifest["scripts"]["package"]
