"""`mopro run` and `mopro compile` as processes: answers, files, exit codes."""

import functools
import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from helpers.commands import LIMIT_S, wait_for
from helpers.paths import ROOT
from mopro.recording import read

SETUP = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
LVDT3 = ROOT / "programs" / "LVDT3.CMD"


def test_lvdt3_prints_its_moves_and_leaves_a_recording(mopro_process, files, tmp_path):
    done = mopro_process("run", LVDT3, "--emulate")
    assert (done.returncode, done.stderr) == (0, "")
    rows = [line.split() for line in done.stdout.splitlines() if "smooth" in line]
    assert [row[:5] for row in rows] == [
        ["23", "1", "smooth", "15", "40"],
        ["28", "1", "smooth", "-15", "40"],
    ]
    assert "2 moves in 2.927778 s" in done.stdout
    assert "Recording: run.parquet" in done.stdout
    assert files() == ["run.parquet"]
    assert len(read(tmp_path / "run.parquet")) == 6856


def test_json_has_the_fields_of_the_contract(mopro):
    done = mopro("run", LVDT3, "--emulate", "--json", "--out", "x.csv")
    answer = json.loads(done.stdout)
    assert {key: answer[key] for key in ("program", "machine", "stalled", "loops_forever")} == {
        "program": "LVDT3.CMD", "machine": "chow1992", "stalled": False, "loops_forever": False,
    }  # fmt: skip
    assert answer["duration_s"] == pytest.approx(2.927778, abs=5e-7)
    assert answer["recording"] == "x.csv"
    move = answer["moves"][0]
    expected = {
        "line": 23, "axes": [1], "profile": "smooth", "distance": 15.0, "unit": "in",
        "set_velocity": 40.0, "peak_velocity": 40.0, "acceleration": 600.0, "start_s": 0.0,
        "lost_pitches": 0,
    }  # fmt: skip
    assert {key: move[key] for key in expected} == expected
    assert move["duration_s"] == pytest.approx(0.463889, abs=5e-7)
    assert 0 < move["max_lag"] < 0.01
    assert 0 < move["stall_margin"] < 1


def test_plot_and_report_and_payload(mopro, files, tmp_path):
    done = mopro(
        "run", LVDT3, "--emulate", "--plot", "p.png", "--report", "r.html",
        "--payload", "5lb", "--out", "x.npz", "--rate", "500Hz", "--seed", "3",
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert files() == ["p.png", "r.html", "x.npz"]
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "r.html").read_text()
    assert "LVDT3.CMD on chow1992" in page
    assert '<script type="application/json" id="page-data">' in page
    header = read(tmp_path / "x.npz").header
    assert (header.seed, header.rate_hz) == (3, 500.0)
    assert header.payload_kg == pytest.approx(2.26796, abs=1e-5)


def test_the_columns_that_are_stored_can_be_chosen(mopro, files, tmp_path):
    mopro("run", LVDT3, "--emulate", "--out", "all.parquet")
    mopro("run", LVDT3, "--emulate", "--columns", "line,position_*", "--out", "some.parquet")
    every, some = (read(tmp_path / f"{name}.parquet") for name in ("all", "some"))
    assert list(some.columns) == ["time_s", "position_1_m", "position_2_m", "line"]
    assert all(np.array_equal(every[name], some[name]) for name in some.columns)
    assert some.run == every.run


def test_a_drawing_that_fails_during_the_run_costs_no_recording(mopro, files, monkeypatch):
    from mopro.recording.envelope import Envelopes

    def full(self, columns):
        raise MemoryError("no room for a drawing")

    monkeypatch.setattr(Envelopes, "write", full)
    done = mopro("run", LVDT3, "--emulate", "--rate", "200Hz", "--report", "r.html")
    assert done.returncode == 1
    assert "r.html: not drawn: no room for a drawing" in done.stderr
    assert files() == ["run.parquet"]


def test_a_loop_stops_at_the_stated_default_and_says_how_to_change_it(mopro):
    done = mopro("run", ROOT / "programs" / "TEMP1.CMD", "--emulate", "--rate", "50")
    assert done.returncode == 0
    assert "loops for ever: stopped after 60 s; change that with --for" in done.stderr
    assert done.stderr.count("[letter-o-axis]") == 2
    rows = [line.split() for line in done.stdout.splitlines() if "trapezoid" in line]
    assert [row[:4] for row in rows] == [
        ["16", "×", "28", "2"], ["19", "×", "27", "2"], ["19", "2", "trapezoid", "cut"],
    ]  # fmt: skip
    shorter = mopro("run", ROOT / "programs" / "TEMP1.CMD", "--emulate", "--for", "2s")
    assert "stopped after 2 s" in shorter.stderr


def test_a_stall_is_told_by_line_and_pitches_and_fails(mopro, files):
    text = SETUP + "ACC1 1.3\nMRI1 15.0\nWX1\nWT500\n"
    done = mopro("run", "P.CMD", "--emulate", text=text)
    assert done.returncode == 1
    lost = re.search(r"^P.CMD:5:1: axis 1 stalled here: it lost ([+-]\d+) pitches \[stall\]",
                     done.stderr, re.MULTILINE)  # fmt: skip
    answer = json.loads(mopro("run", "P.CMD", "--emulate", "--json").stdout)
    assert answer["stalled"]
    assert lost is not None
    assert answer["moves"][0]["lost_pitches"] == int(lost[1]) != 0
    assert "run.parquet" in files()


def test_the_extended_grammar_is_off_unless_asked_for(mopro):
    text = SETUP + "MAI1 3.0\nWX1\nMAI1 1.0\nWX1\n"
    refused = mopro("run", "P.CMD", "--emulate", text=text)
    assert refused.returncode == 2
    assert refused.stderr.count("needs --grammar extended") == 2
    done = mopro("run", "P.CMD", "--emulate", "--grammar", "extended", "--json")
    assert [m["distance"] for m in json.loads(done.stdout)["moves"]] == [3.0, -2.0]


def test_compile_prints_listing_json_and_canonical_text(mopro):
    assert mopro("compile", LVDT3).stdout == (ROOT / "tests/data/ir/LVDT3.txt").read_text()
    assert json.loads(mopro("compile", LVDT3, "--json").stdout)["program"] == "LVDT3.CMD"
    canonical = mopro("compile", LVDT3, "--canonical").stdout
    assert canonical.splitlines()[:3] == ["UU012500/1", "VEL2 0.00008", "ACC2 0.00008"]


@pytest.mark.parametrize("args", [["--help"], ["run", "--help"], ["compile", "--help"]])
def test_help_has_an_example(mopro, args):
    done = mopro(*args)
    assert done.returncode == 0
    assert "Example: mopro " in done.stdout


class TestBadInput:
    def refused(self, mopro, files, *args, text=None):
        before = files()
        done = mopro(*args, text=text)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        assert done.stdout == ""
        assert set(files()) - set(before) <= {"P.CMD"}, "something half-written was left"
        return done.stderr

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            (b"", "P.CMD:1:1: the program has no statement [empty-program]"),
            (b"\x7fELF\x02\0\0\1", "P.CMD:1:1: is a binary file"),
            (b"FOO 1", "P.CMD:1:1: `FOO` begins no statement of the language [unknown-mnemonic]"),
            (b"VEL3 40.0", "P.CMD:1:4: there is no axis 3"),
            (b"WX9", "P.CMD:1:3: there is no axis 9"),
            (b"VEL1", "P.CMD:1:5: expected a space and a value, found the end of the line"),
            (b"VEL1 1e999", "P.CMD:1:6: expected a plain decimal number, found `1e999`"),
            (b"VEL1 nan", "P.CMD:1:6: expected a plain decimal number, found `nan`"),
            (b"UU012500/0", "P.CMD:1:10: the denominator of the user unit must not be 0"),
            (b"UU012500", "P.CMD:1:9: expected a slash, found the end of the line"),
            (b"VEL1 0", "P.CMD:1:6: the velocity must be greater than 0 [bad-velocity]"),
            (b"ACC1 -0.25", "P.CMD:1:6: the acceleration must be greater than 0"),
            (b"JUMP B1", "P.CMD:1:6: no line defines the label B1 [unknown-label]"),
            (b":B1\n:B1", "P.CMD:2:2: label B1 is already defined in line 1 [duplicate-label]"),
            (b":B1\nJUMP B1", "P.CMD:2:1: the loop from label B1 to this line takes no time"),
            (SETUP.encode() + b"MRI1 9\nMRI1 -9",
             "P.CMD:5:1: axis 1 is still moving for another 0.385 s: line 4 started it"),
            (b"GO", "P.CMD:1:1: no axis has a target to go to [go-without-target]"),
        ],
    )  # fmt: skip
    def test_programs(self, mopro, files, text, message):
        assert message in self.refused(mopro, files, "run", "P.CMD", "--emulate", text=text)

    def test_a_line_of_100_mb(self, mopro, files, tmp_path):
        with open(tmp_path / "BIG.CMD", "wb") as file:
            file.write(b"VEL1 ")
            file.seek(100 * 2**20)
            file.write(b"1")
        message = self.refused(mopro, files, "run", "BIG.CMD", "--emulate")
        assert "BIG.CMD:1:1: is larger than 16 MiB [too-long]" in message

    def test_many_faults_are_all_told(self, mopro, files):
        text = "".join(f"BAD{i}\n" for i in range(60))
        message = self.refused(mopro, files, "run", "P.CMD", "--emulate", text=text)
        assert message.count("[unknown-mnemonic]") == 50
        assert "P.CMD: and 10 more" in message

    def test_paths(self, mopro, files, tmp_path):
        assert "none.CMD:1:1: cannot be read: No such file" in self.refused(
            mopro, files, "run", "none.CMD", "--emulate"
        )
        assert "cannot be read: Is a directory" in self.refused(
            mopro, files, "run", tmp_path, "--emulate"
        )
        for option in ("--out=no/x.csv", "--plot=no/x.png", "--report=no/x.html"):
            message = self.refused(mopro, files, "run", LVDT3, "--emulate", option)
            assert "cannot be written: No such file or directory [unwritable-output]" in message

    @pytest.mark.parametrize(
        ("args", "message"),
        [
            ([], "say what to run on: --emulate"),
            (["--emulate", "--out", "x.xls"], "must end in one of .parquet, .csv, .npz"),
            (["--emulate", "--for", "0"], "must be greater than 0"),
            (["--emulate", "--for", "5parsec"], "is not a unit of time"),
            (["--emulate", "--payload", "heavy"], "is not a number with a unit"),
            (["--emulate", "--payload", "-1"], "must be at least 0"),
            (["--emulate", "--rate", "0"], "must be greater than 0"),
            (["--emulate", "--columns", "positon_1_m"], "did you mean 'position_1_m'?"),
            (["--port", "loop://", "--columns", "line"], "--columns goes with --emulate only"),
            (["--emulate", "--machine", "nosuch"], "no machine has this name"),
            (["--emulate", "--grammar", "klingon"], "is not one of"),
        ],
    )
    def test_options(self, mopro, files, args, message):
        assert message in self.refused(mopro, files, "run", LVDT3, *args)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_no_half_written_file(tmp_path, number):
    """The run announces itself by its draft file; then the signal comes."""
    (tmp_path / "old.csv").write_text("the one before")
    command = [sys.executable, "-m", "mopro", "run", str(ROOT / "programs" / "TEMP1.CMD"),
               "--emulate", "--for", "10h", "--out", "old.csv", "--force"]  # fmt: skip
    # Whoever starts the tests in the background has SIGINT ignored, and children inherit that.
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=heed
    ) as process:
        wait_for(lambda: list(tmp_path.glob(".old.csv.*")), process)
        process.send_signal(number)
        _, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert [p.name for p in tmp_path.iterdir()] == ["old.csv"]
    assert (tmp_path / "old.csv").read_text() == "the one before"


def test_output_into_a_closed_pipe_is_no_traceback(tmp_path):
    command = f"{sys.executable} -m mopro compile {LVDT3} --json | head -n 1"
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", [("compile",), ("run", "--emulate")])
def test_what_stands_behind_a_ctrl_z_is_told(mopro_process, tmp_path, command):
    (tmp_path / "J.CMD").write_bytes(SETUP.encode() + b"MRI1 2\nWX1\n\x1aMRI1 3\n")
    done = mopro_process(command[0], "J.CMD", *command[1:])
    assert done.returncode == 0
    line = SETUP.count("\n") + 3
    assert f"J.CMD:{line}:1: warning: the program ends at this Ctrl-Z" in done.stderr
