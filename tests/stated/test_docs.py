"""Lists on docs/machines.md are those of the catalogues."""

import re

from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "machines.md").read_text("utf-8")


def test_the_page_lists_the_effects_of_no_other_catalogue():
    folder = ROOT / "mopro" / "stated" / "catalogue"
    for kind in ("kinematic", "axis", "thermal"):
        names = re.findall(r'^name = "(\w+)"', (folder / f"{kind}.toml").read_text(), re.MULTILINE)
        assert len(names) > 5
        paragraph = PAGE[PAGE.index(f"**{kind}.**") :].split("\n\n**")[0].replace("\n", " ").lower()
        for word in ("drift", "lag", "delay", "radiation", "cogging", "backlash"):
            if any(word in name for name in names):
                assert word in paragraph, (kind, word)


def test_the_lines_written_for_each_example_are_as_counted():
    """At most 25 for the machine and the experiment together."""
    table = (ROOT / "examples" / "README.md").read_text("utf-8")
    stated = dict(re.findall(r"^\| `(\w+)/` \|[^|]*\| (\d+ \+ \d+) \|", table, re.MULTILINE))
    assert stated.keys() == {"servo", "telescope", "pendulum", "heater"}
    for folder, lines in stated.items():
        counts = []
        for name in ("machine.toml", "experiment.toml"):
            text = (ROOT / "examples" / folder / name).read_text("utf-8")
            counts.append(len(re.findall(r"^\s*[^#\s]", text, re.MULTILINE)))
        assert lines == f"{counts[0]} + {counts[1]}"
        assert sum(counts) <= 25
