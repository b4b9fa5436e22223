"""`mopro sweep`: its table, its picture, and what it refuses."""

import csv
import json

import pytest
from click.testing import CliRunner

from mopro.cli.main import group

MOVE = "UU012500/1\nVEL1 10.0\nACC1 0.5\nMRI1 0.2\nWX1\n"
VARIED = ("--vary", "VEL1=10:30:10", "--vary", "ACC1=0.5,3")


def sweep(mopro, *more, text=MOVE, out="r.csv"):
    return mopro("sweep", "P.CMD", *VARIED, *more, "--out", out, text=text)


def rows_in(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_row_a_run_and_what_came_of_them(mopro, tmp_path, files):
    done = sweep(mopro)
    assert done.returncode == 0, done.stderr
    rows = rows_in(tmp_path / "r.csv")
    varied = [(row["VEL1_in_s"], row["ACC1_1000_in_s2"]) for row in rows]
    assert varied == [(v, a) for v in ("10", "20", "30") for a in ("0.5", "3")]
    counted = {
        outcome: sum(row["outcome"] == outcome for row in rows) for outcome in ("ok", "stalled")
    }
    assert ", ".join(f"{n} {word}" for word, n in counted.items()) in done.stdout
    assert "P.CMD on chow1992: 6 runs" in done.stdout
    soonest = min(float(row["time_s"]) for row in rows if row["outcome"] == "ok")
    assert f"Soonest without a stall: {soonest:.4f} s" in done.stdout
    assert files() == ["P.CMD", "r.csv"]


def test_the_same_command_again_does_nothing_again(mopro, tmp_path):
    first = sweep(mopro)
    data = (tmp_path / "r.csv").read_bytes()
    again = sweep(mopro, "--picture", "r.svg")
    assert (again.returncode, again.stdout) == (0, first.stdout)
    assert (tmp_path / "r.csv").read_bytes() == data
    assert b"<svg" in (tmp_path / "r.svg").read_bytes()


def test_results_of_another_sweep_stay(mopro, tmp_path):
    assert sweep(mopro).returncode == 0
    data = (tmp_path / "r.csv").read_bytes()
    done = sweep(mopro, "--payload", "1kg")
    assert done.returncode == 2
    assert "r.csv is there, and is not the results of this sweep" in done.stderr
    assert "[other-results]" in done.stderr
    assert (tmp_path / "r.csv").read_bytes() == data


def test_json_tells_the_outcomes_and_the_soonest(mopro):
    told = json.loads(sweep(mopro, "--json").stdout)
    assert told["outcomes"] == {"ok": 3, "stalled": 3}
    assert told["soonest"]["ACC1_1000_in_s2"] == 0.5
    assert told["results"] == "r.csv"


def test_drawn_points_and_parquet(mopro, tmp_path):
    import pyarrow.parquet

    done = mopro(
        "sweep", "P.CMD", "--vary", "VEL1=10:30", "--vary", "effects.viscous_drag.b=0:5N s/m",
        "--design", "sobol", "--points", 5, "--seed", 2, "--picture", "r.png", "--jobs", 2,
        text=MOVE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    table = pyarrow.parquet.read_table(tmp_path / "sweep.parquet")
    assert table.num_rows == 5
    assert all(0 <= b <= 5 for b in table["effects.viscous_drag.b_N_s_m"].to_pylist())
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_runs_that_are_all_refused_are_a_failure(mopro):
    done = sweep(mopro, text=MOVE.replace("MRI1 0.2\n", "MRI2 0.2\n"))
    assert done.returncode == 1
    assert "6 refused" in done.stdout
    assert "Refused first, point 0: line 4: " in done.stdout


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        (["--vary", "VEL2=1"], "vary VEL2=1: P.CMD has no statement VEL2"),
        (["--vary", "VEL1"], "'VEL1': expected NAME=VALUES, such as VEL1=10:60:2"),
        (["--vary", "VEL1=1", "--vary", "VEL1=2"], "VEL1 is varied twice"),
        (["--vary", "VEL1=5:1:1"], "the range is empty"),
        (["--vary", "VEL1=1:300000:1"], "it has 300000 values: expected at most 200000"),
        (["--vary", "VEL1=1", "--points", "3"], "goes with the designs random and sobol"),
        (["--vary", "VEL1=1:2", "--design", "sobol"], "needs a number of points"),
        (["--vary", "VEL1=1", "--out", "P.CMD"], "must end in one of .parquet, .csv"),
        (["--vary", "VEL1=1", "--out", "no/r.csv"], "no/r.csv.rows: cannot be written"),
        (["--vary", "VEL1=1", "--out", "r.csv", "--picture", "no/p.png"], "no/p.png: cannot be"),
        (["--vary", "VEL1=1", "--jobs", "2", "--scheduler", "tcp://x"], "state one"),
        ([], "Missing option '--vary'"),
    ],
)
def test_what_is_refused_is_refused_before_the_work(mopro, files, args, expected):
    done = mopro("sweep", "P.CMD", *args, text=MOVE)
    assert done.returncode == 2
    assert expected in done.stderr
    assert "Traceback" not in done.stderr
    assert files() == ["P.CMD"]


def test_a_machine_is_not_overwritten(mopro, tmp_path):
    (tmp_path / "m.csv").write_text('name = "m"\nextends = "chow1992"\n')
    done = sweep(mopro, "--machine", "m.csv", out="m.csv")
    assert done.returncode == 2
    assert "--out would overwrite m.csv, which --machine reads" in done.stderr


def test_ctrl_c_keeps_what_is_done(mopro, monkeypatch, files):
    from mopro.sweeps import run
    from mopro.sweeps.tasks import rows_of

    done_before = []

    def interrupted(chunk):
        if len(done_before) == 4:
            raise KeyboardInterrupt
        done_before.append(chunk)
        return rows_of(chunk)

    monkeypatch.setattr(run, "rows_of", interrupted)
    done = sweep(mopro, "--jobs", 1)
    assert done.returncode == 130
    assert "4 of 6 runs are done and kept: the same command goes on from there" in done.stderr
    assert files() == ["P.CMD", "r.csv.rows"]
    monkeypatch.undo()
    assert sweep(mopro).returncode == 0
    assert files() == ["P.CMD", "r.csv"]


@pytest.mark.parametrize(
    ("begun", "completed"),
    [("VE", "VEL1="), ("axis.m", "axis.moving_mass="), ("effects.visc", "effects.viscous_drag.b=")],
)
def test_names_are_completed(begun, completed):
    words = {"COMP_WORDS": f"mopro sweep P.CMD --vary {begun}", "COMP_CWORD": "4"}
    shell = {"_MOPRO_COMPLETE": "bash_complete"} | words
    said = CliRunner().invoke(group, env=shell, prog_name="mopro").stdout
    assert f"plain,{completed}" in said.splitlines()
