"""The commands for a controller, as processes over a real pseudo-terminal and over TCP."""

import contextlib
import json
import os
import pty
import signal
import socket
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S, wait_for
from helpers.paths import PROGRAMS, ROOT

ENDS = ("pty", "socket://127.0.0.1:0")
SHORT = "UU012500/1\nVEL1 40.0\nACC1 0.6\nMRI1 3.0\nWX1\nWT20\nMRI1 -1.5\nWX1\n"


@pytest.fixture
def serve(tmp_path):
    """Start `mopro serve ARGS`; gives its address. All are ended with the test."""
    with contextlib.ExitStack() as running:

        def start(*args):
            server = subprocess.Popen(
                [sys.executable, "-m", "mopro", "serve", *map(str, args)],
                cwd=tmp_path, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            running.callback(server.wait, 10)
            running.callback(server.stdout.close)
            running.callback(server.terminate)
            return server.stdout.readline().strip()

        yield start


@pytest.fixture
def hasty(tmp_path):
    """The plain dialect in a file, with less patience."""
    text = (ROOT / "mopro" / "link" / "dialects" / "plain.toml").read_text("utf-8")
    assert text.count("reply_timeout_s = 1.0\n") == 1
    file = tmp_path / "hasty.toml"
    file.write_text(text.replace("reply_timeout_s = 1.0\n", "reply_timeout_s = 0.25\n"), "utf-8")
    return file


def moves(process):
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)["moves"]


@pytest.mark.parametrize("listen", ENDS)
@pytest.mark.parametrize("dialect", ["plain", "checked"])
def test_port_and_emulate_give_the_same_moves(mopro, serve, listen, dialect):
    address = serve("--listen", listen, "--dialect", dialect, "--speed", 5)
    program = PROGRAMS / "LVDT3.CMD"
    there = mopro("run", program, "--port", address, "--dialect", dialect, "--json")
    here = mopro("run", program, "--emulate", "--json")
    assert moves(there) == moves(here)


def test_flash_verify_list_and_trace(mopro, serve, tmp_path):
    address = serve("--store", "kept")
    done = mopro("flash", "P.CMD", "--port", address, "--trace", "t.log", "--json", text=SHORT)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["statements"] == 8
    assert (tmp_path / "kept" / "MAIN.CMD").read_text() == SHORT
    assert "MRI1 3.0" in (tmp_path / "t.log").read_text()
    again = mopro("flash", "P.CMD", "--port", address, "--verify-only")
    assert again.returncode == 0
    other = mopro("flash", "P.CMD", "--port", address, "--list", text=SHORT.replace("3.0", "2.0"))
    assert other.returncode == 1
    assert "MRI1 2.0" in other.stderr
    assert "MRI1 3.0" in other.stderr
    assert mopro("flash", "P.CMD", "--port", address, "--verify-only").returncode == 1


@pytest.mark.parametrize("dialect", ["plain", "checked"])
def test_link_test_walks_the_dialect(mopro, serve, dialect):
    address = serve("--dialect", dialect)
    done = mopro("link-test", "--port", address, "--dialect", dialect, "--json")
    steps = json.loads(done.stdout)
    assert done.returncode == 0
    assert len(steps) == 11
    assert all(step["matched"] for step in steps)


def test_link_test_with_the_wrong_dialect_says_so(mopro_process, serve):
    address = serve("--dialect", "plain")
    done = mopro_process(
        "link-test", "--port", address, "--dialect", "checked", "--deadline", "10s"
    )
    assert done.returncode == 1
    assert "NOT AS SAID" in done.stdout


def test_interrupting_a_run_stops_the_motor(serve, tmp_path):
    address = serve("--listen", "socket://127.0.0.1:0")
    run = subprocess.Popen(
        [sys.executable, "-m", "mopro", "run", PROGRAMS / "TEMP1.CMD", "--port", address,
         "--trace", "t.log"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    trace = tmp_path / "t.log"
    wait_for(lambda: trace.exists() and ":MV 1" in trace.read_text(), run)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=LIMIT_S)
    assert run.returncode == 1
    assert "interrupted from the keyboard" in said
    assert "both axes rest" in said
    assert "last completed" in said


def test_a_scenario_file_is_played(mopro, serve, tmp_path):
    (tmp_path / "s.toml").write_text('[[fault]]\nkind = "limit"\nrun_s = 0.05\n')
    address = serve("--faults", "s.toml")
    done = mopro("run", "P.CMD", "--port", address, text=SHORT)
    assert done.returncode == 1
    assert "a limit switch opened" in done.stderr


class TestBadInput:
    def told(self, mopro, code, *args, text=SHORT):
        done = mopro(*args, text=text)
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return done.stderr

    def test_no_such_port(self, mopro):
        assert "no such port" in self.told(mopro, 2, "flash", "P.CMD", "--port", "/dev/ttyNONE")

    @pytest.mark.parametrize("url", ["socket://127.0.0.1:1", "socket://nowhere", "what://x"])
    def test_a_url_that_leads_nowhere(self, mopro, url):
        assert "cannot be opened" in self.told(mopro, 2, "flash", "P.CMD", "--port", url)

    def test_a_port_that_another_program_has_open(self, mopro, serve):
        import fcntl

        address = serve()
        with open(address, "rb+", buffering=0) as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            said = self.told(mopro, 2, "flash", "P.CMD", "--port", address)
        assert "another program has this port open" in said

    def test_a_wrong_baud_rate(self, mopro, serve, hasty):
        address = serve("--dialect", "plain")
        args = ("--port", address, "--dialect", hasty, "--baud", "19200")
        assert "baud rate" in self.told(mopro, 1, "flash", "P.CMD", *args)

    def test_a_peer_that_never_answers(self, mopro_process, hasty):
        master, slave = pty.openpty()
        try:
            url = os.ttyname(slave)
            said = self.told(mopro_process, 1, "flash", "P.CMD", "--port", url, "--dialect", hasty)
        finally:
            os.close(master)
            os.close(slave)
        assert "nothing answers" in said

    def test_a_peer_that_floods(self, mopro_process, tmp_path):
        flood = (
            "import socket\n"
            "server = socket.create_server(('127.0.0.1', 0))\n"
            "print(server.getsockname()[1], flush=True)\n"
            "client, _ = server.accept()\n"
            "while True: client.sendall(b'spam\\r\\n' * 100)\n"
        )
        with subprocess.Popen(
            [sys.executable, "-c", flood], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as peer:
            url = f"socket://127.0.0.1:{int(peer.stdout.readline())}"
            said = self.told(mopro_process, 1, "flash", "P.CMD", "--port", url)
            peer.terminate()
        assert "does not stop sending" in said

    def test_a_program_that_must_be_refused_is_not_sent(self, mopro):
        bad = SHORT.replace("WX1\nWT20\n", "")
        said = self.told(mopro, 1 + 1, "run", "P.CMD", "--port", "/dev/ttyNONE", text=bad)
        assert "move-on-moving-axis" in said

    @pytest.mark.parametrize(
        "args",
        [("--payload", "5lb"), ("--rate", "100"), ("--emulate",)],
    )
    def test_options_that_do_not_go_together(self, mopro, args):
        self.told(mopro, 2, "run", "P.CMD", "--port", "loop://", *args)

    def test_two_servers_cannot_have_one_port(self, mopro):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            url = f"socket://127.0.0.1:{taken.getsockname()[1]}"
            assert "cannot be listened on" in self.told(mopro, 2, "serve", "--listen", url)


def test_ports_lists_what_there_is(mopro):
    done = mopro("ports", "--json")
    assert done.returncode == 0
    assert isinstance(json.loads(done.stdout), list)
