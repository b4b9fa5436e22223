"""The commands of docs/tutorial-log.md, in order, in a copy of what they need."""

import re
import shutil
import tomllib

from helpers.commands import run_here
from helpers.paths import ROOT

PAGE = (ROOT / "docs" / "tutorial-log.md").read_text("utf-8")
MOST_BYTES = 300_000


def test_the_commands_of_the_tutorial_name_the_effect_and_predict_another_run(tmp_path):
    shutil.copytree(ROOT / "docs" / "data", tmp_path / "docs" / "data")
    commands = "".join(re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)).splitlines()
    done = [run_here(tmp_path, *command.split()[1:]) for command in commands]
    assert [process.returncode for process in done] == [0] * 5, done
    said = re.search(r"```text\n(column time_s.*?)```", PAGE, re.DOTALL)[1]
    assert said in done[0].stdout
    repaired = tomllib.loads((tmp_path / "repaired.toml").read_text())
    assert 0.0015 < repaired["effects"]["coupling"]["k"]["value"] < 0.003
    assert 12 < repaired["effects"]["sensor_lag"]["tau"]["value"] < 22
    gaps = re.findall(r"sensor\d_temperature +([\d.]+) C +([\d.]+) C", done[-1].stdout)
    before_after = [(float(before), float(after)) for before, after in gaps]
    assert len(before_after) == 2
    assert all(after < before / 3 for before, after in before_after)


def test_the_nodes_that_the_page_shows_are_those_written(tmp_path):
    run_here(tmp_path, "import", ROOT / "docs/data/heater/step.csv", "--as", "board")
    nodes = re.search(r"```toml\n(\[nodes\].*?)```", PAGE, re.DOTALL)[1]
    assert nodes in (tmp_path / "board" / "machine.toml").read_text()


def test_the_data_are_small_and_bear_their_licence():
    folder = ROOT / "docs" / "data" / "heater"
    assert sum(file.stat().st_size for file in folder.iterdir()) < MOST_BYTES
    assert "Alexander Dowling" in (folder / "LICENSE.txt").read_text()
    assert (folder / "step.csv").read_text().splitlines()[:3] == re.search(
        r"```text\n(time_s.*?)```", PAGE, re.DOTALL
    )[1].splitlines()
