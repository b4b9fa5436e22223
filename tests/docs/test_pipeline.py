"""The page of the engine has the passes of the code, in their order."""

import re

from helpers.paths import ROOT
from mopro.engine import PASSES
from mopro.engine.passes import Loop


def names(passes):
    for each in passes:
        yield from names(each.passes) if isinstance(each, Loop) else [each.__name__]


def test_the_page_lists_every_pass_in_order():
    text = (ROOT / "docs" / "pipeline.md").read_text("utf-8")
    section = text.split("## The passes\n")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \| ", section, re.MULTILINE)
    assert listed == list(dict.fromkeys(names(PASSES)))
