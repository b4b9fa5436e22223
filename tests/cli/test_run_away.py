"""Models that run away within a search: worth nothing, ending nothing, told by no library."""

from helpers.paths import DATA, PROGRAMS

HIDDEN = 'extends = "chow1992"\n[effects.speed_dependent_heat]\nkh = 0.5\nke = 0.001\n'
EXPERIMENT = """machine = "chow1992"
[[sensor]]
kind = "thermocouple"
[[run]]
program = "P.CMD"
data = "d.DAT"
"""


def test_heat_flows_that_run_away_are_neither_found_nor_told(tmp_path, mopro, mopro_process):
    """TEMP1 as the thermocouple sees it, until the drive is too hot and switches off."""
    text = (PROGRAMS / "TEMP1.CMD").read_bytes()
    (tmp_path / "hidden.toml").write_text(HIDDEN)
    (tmp_path / "e.toml").write_text(EXPERIMENT)
    given = ("--machine", "hidden.toml", "--instrument", "thermocouple", "--out", "d.DAT")
    measured = mopro("measure", "P.CMD", *given, "--for", "5min", "--seed", 3, text=text)
    assert measured.returncode == 0
    done = mopro_process("reconcile", "e.toml")
    assert done.returncode == 1
    assert "Unexplained" in done.stdout
    assert "numpy" not in done.stderr
    assert "Warning" not in done.stderr


def test_a_heat_flow_that_runs_away_does_not_end_the_search(tmp_path, mopro):
    data = DATA / "run_away"
    for name in ("d.DAT", "P.CMD"):
        (tmp_path / name).write_bytes((data / name).read_bytes())
    (tmp_path / "e.toml").write_text(EXPERIMENT)
    done = mopro("reconcile", "e.toml")
    assert done.returncode == 0
    assert "Named: speed_dependent_heat." in done.stdout
