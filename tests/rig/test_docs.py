"""The example of docs/machines.md, its files and its commands as they stand there."""

import re

from helpers.commands import run_here
from helpers.paths import ROOT
from helpers.rigs import driven, write

PAGE = (ROOT / "docs" / "machines.md").read_text("utf-8")


def test_the_commands_of_the_page_do_what_it_says(tmp_path):
    machine, experiment = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[:2]
    (commands,) = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "machine.toml").write_text(machine, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(experiment, encoding="utf-8")
    (tmp_path / "unseen.toml").write_text(experiment.replace("run.csv", "unseen.csv"), "utf-8")
    write(tmp_path / "run.csv", driven(of_place=12.0))
    write(tmp_path / "unseen.csv", driven(of_place=12.0, seed=5))
    said = []
    for line in commands.splitlines():
        done = run_here(tmp_path, *line.split()[1:])
        assert done.returncode in (0, 1), done.stderr
        said.append(done.stdout)
    assert "disagreement in" in said[0]
    assert "Named: friction of place." in said[1]
    assert (tmp_path / "why.html").exists()
    assert said[2].count("mm") > 3
    assert "no disagreement" in said[2]


def test_the_page_lists_the_effects_of_no_other_catalogue():
    folder = ROOT / "mopro" / "rig" / "catalogue"
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
