"""Outputs of commands: never over their inputs, never torn, never lost to a drawing."""

import json
import os
import shutil
import signal
import socket
import stat
import subprocess
import sys
import threading

import pytest

from helpers.commands import LIMIT_S, wait_for
from helpers.paths import ROOT
from mopro.recording import read

MOVE = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 1.0\nWX1\n"
UNTIDY = "uu012500/1\nvel0  40.0\nacc0 0.25\nmri1 1.0\nwx1\n"
MACHINE = ROOT / "mopro" / "machine" / "machines" / "chow1992.toml"


@pytest.fixture
def contents(tmp_path):
    """The bytes of every regular file in the folder, by its name."""
    return lambda: {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()}


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"socket://127.0.0.1:{server.getsockname()[1]}"


class TestInputsAreNoOutputs:
    @pytest.mark.parametrize(
        ("command", "options"),
        [
            ("run P.CMD --emulate --machine m.toml --plot link.png", "--plot .* --machine"),
            ("run P.CMD --emulate --out a.csv --trace a.csv", "--out and --trace"),
            ("run P.CMD --emulate --out program.csv", "--out .* FILE"),
            ("run P.CMD --port {port} --trace P.CMD", "--trace .* FILE"),
            ("run P.CMD --port {port} --trace ./m.toml --machine m.toml", "--trace .* --machine"),
            ("flash P.CMD --port {port} --trace P.CMD", "--trace .* FILE"),
            ("flash P.CMD --port {port} --trace second.CMD", "--trace .* FILE"),
            ("flash P.CMD --port {port} --trace d.toml --dialect d.toml", "--trace .* --dialect"),
            ("link-test --port {port} --trace d.toml --dialect d.toml", "--trace .* --dialect"),
            ("measure P.CMD --out program.csv", "--out .* FILE"),
            ("measure P.CMD --out link.csv --machine m.toml", "--out .* --machine"),
            ("limits --plot link.png --machine m.toml --velocities 10", "--plot .* --machine"),
            ("serve --store . --faults P.CMD", "--store .* --faults"),
            ("lint --fix m.toml --machine m.toml", "--fix .* --machine"),
        ],
    )
    def test_refused_by_both_names(self, mopro, tmp_path, contents, command, options):
        (tmp_path / "P.CMD").write_text(MOVE)
        shutil.copy(MACHINE, tmp_path / "m.toml")
        (tmp_path / "d.toml").write_text("")
        (tmp_path / "link.png").symlink_to("m.toml")
        (tmp_path / "link.csv").symlink_to("m.toml")
        (tmp_path / "program.csv").symlink_to(tmp_path / "P.CMD")
        os.link(tmp_path / "P.CMD", tmp_path / "second.CMD")
        before = contents()
        done = mopro(*command.format(port=free_port()).split())
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        first, _, second = options.replace(".*", "and").partition(" and ")
        assert first in done.stderr
        assert second in done.stderr
        assert "would" in done.stderr
        assert contents() == before

    @pytest.mark.parametrize("victim", ["experiment.toml", "m.toml", "steps.toml", "data.toml"])
    def test_nothing_that_an_experiment_names_is_written_over(self, mopro, tmp_path, victim):
        shutil.copy(MACHINE, tmp_path / "m.toml")
        (tmp_path / "steps.toml").write_text(MOVE)
        (tmp_path / "data.toml").write_text("time_s,position_1_in\n0,0\n")
        (tmp_path / "experiment.toml").write_text(
            'machine = "m.toml"\n[[sensor]]\nname = "laser"\nquantity = "position"\n'
            'column = "position_1_in"\nrate_hz = 2000.0\nnoise_rms = 2e-5\n'
            '[[run]]\nprogram = "steps.toml"\ndata = "data.toml"\n'
        )
        (tmp_path / "out.toml").symlink_to(victim)
        before = (tmp_path / victim).read_bytes()
        done = mopro("reconcile", "experiment.toml", "--out", "out.toml")
        assert done.returncode == 2
        assert f"--out would overwrite {victim}, which EXPERIMENT reads" in done.stderr
        assert (tmp_path / victim).read_bytes() == before

    def test_a_built_in_name_is_no_file(self, mopro, tmp_path):
        (tmp_path / "P.CMD").write_text(MOVE)
        done = mopro("flash", "P.CMD", "--port", free_port(), "--trace", "chow1992")
        assert "[no-port]" in done.stderr


class TestInPlace:
    @pytest.mark.parametrize("command", [["fmt"], ["lint", "--fix"]])
    @pytest.mark.parametrize("mode", [0o600, 0o664])
    def test_link_and_mode_stay(self, mopro, tmp_path, command, mode):
        real = tmp_path / "real.CMD"
        real.write_text(UNTIDY if command == ["fmt"] else MOVE.replace("WX1", "WX1\nWX1"))
        real.chmod(mode)
        before = real.read_text()
        (tmp_path / "P.CMD").symlink_to("real.CMD")
        done = mopro(*command, "P.CMD")
        assert "Traceback" not in done.stderr
        assert (tmp_path / "P.CMD").is_symlink()
        assert stat.S_IMODE(real.stat().st_mode) == mode
        if command == ["fmt"]:
            assert real.read_text() != before

    def test_read_only_and_hard_linked_programs_are_left_as_they_are(self, mopro, tmp_path):
        for name in ("read-only.CMD", "linked.CMD"):
            (tmp_path / name).write_text(UNTIDY)
        (tmp_path / "read-only.CMD").chmod(0o444)
        os.link(tmp_path / "linked.CMD", tmp_path / "second.CMD")
        done = mopro("fmt", "read-only.CMD", "linked.CMD")
        assert done.returncode == 2
        assert "read-only.CMD: cannot be written: it is read-only" in done.stderr
        assert "linked.CMD: cannot be written: it has 2 names (hard links)" in done.stderr
        assert (tmp_path / "linked.CMD").samefile(tmp_path / "second.CMD")
        assert {p.read_text() for p in tmp_path.glob("*.CMD")} == {UNTIDY}

    def test_a_name_of_255_characters(self, mopro, tmp_path):
        name = "n" * 251 + ".CMD"
        (tmp_path / name).write_text(UNTIDY)
        assert mopro("fmt", name).returncode == 0
        assert (tmp_path / name).read_text() != UNTIDY


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_a_recording_goes_into_a_pipe(mopro, tmp_path, suffix):
    pipe, got = tmp_path / f"pipe{suffix}", tmp_path / f"got{suffix}"
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.write_bytes(pipe.read_bytes()))
    reader.start()
    done = mopro("run", "P.CMD", "--emulate", "--out", pipe, text=MOVE)
    reader.join(LIMIT_S)
    assert (done.returncode, done.stderr) == (0, "")
    assert pipe.is_fifo()
    assert len(read(got)) > 100


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_what_a_killed_run_leaves_goes_with_the_next(mopro, tmp_path, files, suffix):
    out = f"out{suffix}"
    (tmp_path / out).write_text("the one before")
    command = [sys.executable, "-m", "mopro", "run", str(ROOT / "programs" / "TEMP1.CMD"),
               "--emulate", "--for", "10h", "--out", out, "--force"]  # fmt: skip
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        wait_for(lambda: list(tmp_path.glob(f".{out}.*")), process)
        process.send_signal(signal.SIGKILL)
    assert (tmp_path / out).read_text() == "the one before"
    assert mopro("run", "P.CMD", "--emulate", "--out", "other.csv", text=MOVE).returncode == 0
    assert files() == sorted(["P.CMD", "other.csv", out])


class TestDrawings:
    @pytest.mark.parametrize("name", ["dollar$x_{$.CMD", r"$\frac{$.CMD", "$$.CMD"])
    def test_no_name_of_a_program_is_read_as_mathematics(self, mopro, tmp_path, name):
        (tmp_path / name).write_text(MOVE)
        done = mopro("run", name, "--emulate", "--plot", "p.svg", "--report", "r.html")
        assert (done.returncode, done.stderr) == (0, "")
        assert (tmp_path / "r.html").stat().st_size > 10_000
        assert len(read(tmp_path / "run.parquet")) > 100

    def test_a_name_that_is_no_text_costs_nothing(self, mopro, tmp_path):
        name = os.fsdecode(b"caf\xe9\n.CMD")
        (tmp_path / name).write_text(MOVE)
        command = [sys.executable, "-m", "mopro", "run", name, "--emulate",
                   "--plot", "p.png", "--report", "r.html"]  # fmt: skip
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (0, b"")
        assert len(read(tmp_path / "run.parquet")) > 100
        assert (tmp_path / "p.png").is_file()
        assert (tmp_path / "r.html").is_file()

    @pytest.mark.parametrize("option", ["--plot=full.png", "--report=full.html"])
    def test_a_full_disk_costs_the_drawing_only(self, mopro, tmp_path, option):
        (tmp_path / option.partition("=")[2]).symlink_to("/dev/full")
        done = mopro("run", "P.CMD", "--emulate", "--json", option, text=MOVE)
        assert done.returncode == 1
        assert done.stderr.startswith(f"warning: {option.partition('=')[2]}: not drawn: ")
        assert "No space left on device [not-drawn]" in done.stderr
        assert json.loads(done.stdout)["recording"] == "run.parquet"
        assert len(read(tmp_path / "run.parquet")) > 100

    def test_a_table_is_printed_though_its_picture_fails(self, mopro, tmp_path):
        (tmp_path / "full.pdf").symlink_to("/dev/full")
        args = ("limits", "--velocities", "40", "--distance", "1", "--plot", "full.pdf", "--json")
        done = mopro(*args)
        assert done.returncode == 1
        assert "full.pdf: not drawn: " in done.stderr
        assert len(json.loads(done.stdout)) == 2

    def test_a_full_disk_under_the_report_costs_no_machine_file(self, mopro, tmp_path):
        """Of the wrong machine, so that something is found soon."""
        for name in ("experiment.toml", "table-3-2.csv"):
            shutil.copy(ROOT / "programs" / "thermal" / name, tmp_path)
        (tmp_path / "full.html").symlink_to("/dev/full")
        done = mopro("reconcile", "experiment.toml", "--json", "--out", "m.toml",
                     "--report", "full.html")  # fmt: skip
        assert done.returncode == 1
        assert "warning: full.html: not drawn: cannot be written: No space" in done.stderr
        assert json.loads(done.stdout)["effects"]
        assert "[effects." in (tmp_path / "m.toml").read_text()
