"""Lists on docs/machines.md are those of the catalogues."""

import re

from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "machines.md").read_text("utf-8")


def test_the_page_lists_the_effects_of_no_other_catalogue():
    folder = ROOT / "mopro" / "rig" / "catalogue"
    for kind in ("kinematic", "axis", "thermal"):
        names = re.findall(r'^name = "(\w+)"', (folder / f"{kind}.toml").read_text(), re.MULTILINE)
        assert len(names) > 5
        paragraph = PAGE[PAGE.index(f"**{kind}.**") :].split("\n\n**")[0].replace("\n", " ").lower()
        for word in ("drift", "lag", "delay", "radiation", "cogging", "backlash"):
            if any(word in name for name in names):
                assert word in paragraph, (kind, word)
