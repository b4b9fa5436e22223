"""The page of the pipeline has the passes of the code, in their order."""

import re

from helpers.paths import ROOT
from mopro.engine.passes import PASSES


def test_the_page_lists_every_pass_in_order():
    text = (ROOT / "docs" / "pipeline.md").read_text("utf-8")
    section = text.split("## The passes\n")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \| ", section, re.MULTILINE)
    assert listed == [each.__name__ for each in PASSES]
