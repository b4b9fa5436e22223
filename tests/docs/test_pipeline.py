"""The page of the pipeline has the passes of the code, in their order."""

import re

from helpers.paths import ROOT
from mopro.diagnosis import passes

# On the page the three passes that are repeated until none drops an effect go by the last of them.
REPEATED = "hold_out"


def test_the_page_lists_every_pass_in_order():
    text = (ROOT / "docs" / "pipeline.md").read_text("utf-8")
    section = text.split("## The passes\n")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \| ", section, re.MULTILINE)
    stated = [name for each in passes.PASSES if hasattr(passes, name := each.__name__)]
    before = stated.index("readmit")
    assert listed == [*stated[:before], REPEATED, *stated[before:]]
