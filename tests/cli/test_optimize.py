"""`mopro optimize`: the best settings, and what it refuses."""

import json

import pytest

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
