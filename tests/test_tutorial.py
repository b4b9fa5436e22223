"""Excerpts of files in docs/tutorial-log.md are of those files; its commands: tests/docs."""

import re

from helpers.commands import run_here
from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "tutorial-log.md").read_text("utf-8")
MOST_BYTES = 300_000


def test_the_nodes_that_the_page_shows_are_those_written(tmp_path):
    run_here(tmp_path, "import", ROOT / "docs/data/heater/step.csv", "--as", "board")
    nodes = re.search(r"```toml\n(\[nodes\].*?)```", PAGE, re.DOTALL)[1]
    assert nodes in (tmp_path / "board" / "machine.toml").read_text()


def test_the_data_are_small_and_bear_their_licence():
    folder = ROOT / "docs" / "data" / "heater"
    assert sum(file.stat().st_size for file in folder.iterdir()) < MOST_BYTES
    assert "Alexander Dowling" in (folder / "LICENSE.txt").read_text()
    assert (folder / "step.csv").read_text().splitlines()[:3] == re.search(
        r"```csv\n(time_s.*?)```", PAGE, re.DOTALL
    )[1].splitlines()
