"""`mopro optimize`: the best settings, and what it refuses."""

import json

import pytest

from helpers.sweeps import HARD, uncertain_text

MOVE = "UU012500/1\nVEL1 10.0\nACC1 0.5\nMRI1 0.2\nWX1\n"


def search(mopro, *more):
    return mopro("optimize", "P.CMD", *more, text=MOVE)


def test_the_best_is_told_with_its_figures(mopro, files):
    args = ("--vary", "ACC1=0.1:3", "--minimize", "time", "--keep", "margin>0.3", "--runs", 60)
    done = search(mopro, *args)
    assert done.returncode == 0, done.stderr
    told = json.loads(search(mopro, *args, "--json").stdout)
    assert told["kept"] is True
    assert told["best"]["force_margin"] >= 0.3
    shown = [line.split() for line in done.stdout.splitlines() if line.strip()]
    assert f"P.CMD on chow1992: {told['runs']} runs".split() in shown
    assert ["ACC1", str(told["best"]["ACC1_1000_in_s2"]), "1000", "in/s2"] in shown
    assert files() == ["P.CMD"]


def test_no_run_that_keeps_the_bounds_is_a_failure(mopro):
    done = search(mopro, "--vary", "ACC1=1,3", "--minimize", "time", "--keep", "margin>0.9")
    assert done.returncode == 1
    assert "No run is without a stall and keeps margin>0.9; the nearest:" in done.stdout


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        ([], "--minimize or --maximize, one of them"),
        (["--minimize", "time", "--maximize", "margin"], "one of them"),
        (["--minimize", "time", "--keep", "margin"], "[bad-goal]"),
        (["--minimize", "time", "--vary", "VEL3=1"], "vary VEL3=1"),
        (["--minimize", "speed"], "'speed' is not one of"),
    ],
)
def test_what_is_refused(mopro, args, expected):
    done = search(mopro, "--vary", "ACC1=1:3", *args)
    assert done.returncode == 2
    assert expected in done.stderr


def careful(mopro, tmp_path, *more, top="", vary="ACC1=0.5:2"):
    (tmp_path / "m.toml").write_text(uncertain_text(top=top))
    return mopro(
        "optimize", "P.CMD", "--machine", "m.toml", "--vary", vary, "--minimize", "time",
        "--runs", 15, "--draws", 20, "--risk", "2%", "--out", "best.CMD", *more, text=HARD,
    )  # fmt: skip


def test_the_best_for_drawn_machines_is_written_with_its_bound(mopro, tmp_path):
    done = careful(mopro, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "stall or miss a bound, at most" in done.stdout
    assert "Program: best.CMD" in done.stdout
    assert "points, each on drawn machines too" in done.stdout
    assert "; bound: at most" in (tmp_path / "best.CMD").read_text()
    ran = mopro("run", "best.CMD", "--emulate", "--machine", "m.toml", "--json")
    assert json.loads(ran.stdout)["stalled"] is False


def test_a_point_that_is_not_borne_out_is_not_written(mopro, tmp_path):
    done = careful(mopro, tmp_path, vary="ACC1=1.7,1.72")
    assert done.returncode == 1
    assert "best.CMD is not written" in done.stdout
    assert not (tmp_path / "best.CMD").exists()


def test_a_machine_that_is_unexplained_is_refused_unless_asked_for(mopro, tmp_path):
    top = 'verdict = "unexplained"\n'
    done = careful(mopro, tmp_path, top=top)
    assert done.returncode == 2
    assert "the verdict of m is `unexplained`" in done.stderr
    assert "--even-so" in done.stderr
    assert not (tmp_path / "best.CMD").exists()
    assert careful(mopro, tmp_path, "--even-so", top=top).returncode == 0


def test_a_machine_without_intervals_has_nothing_to_draw(mopro):
    done = search(mopro, "--vary", "ACC1=1:3", "--minimize", "time", "--draws", 9)
    assert done.returncode == 2
    assert "chow1992 states no interval of a number that could be drawn" in done.stderr
    assert "[no-interval]" in done.stderr


def test_bounds_that_too_many_drawn_machines_miss_are_told(mopro, tmp_path):
    (tmp_path / "m.toml").write_text(uncertain_text(50.0, 170.0))
    done = mopro(
        "optimize", "P.CMD", "--machine", "m.toml", "--vary", "ACC1=1.5,1.6", "--minimize", "time",
        "--draws", 20, "--risk", "1%", text=HARD,
    )  # fmt: skip
    assert done.returncode == 1
    assert "on all drawn machines but 1.000%; the nearest:" in done.stdout
