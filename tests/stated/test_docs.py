"""Lists on docs/machines.md are those of the catalogues."""

import re

from helpers.paths import ROOT
from helpers.site import module_of_docs

PAGE = (ROOT / "docs" / "machines.md").read_text("utf-8")


def test_the_page_lists_every_effect_of_every_catalogue():
    text = module_of_docs("generated").expanded(PAGE)
    for path in (ROOT / "mopro" / "stated" / "catalogue").glob("*.toml"):
        names = re.findall(r'^name = "(.+)"', path.read_text("utf-8"), re.MULTILINE)
        assert len(names) > 5
        for name in names:
            assert path.stem.endswith("unlisted") or f"\n| {name}" in text, (path.stem, name)


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
