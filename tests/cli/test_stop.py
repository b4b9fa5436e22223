"""Ends of `mopro run --port` from outside: stops are counted at the virtual controller."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress

import pytest

import mopro
from helpers.commands import LIMIT_S
from mopro.controller import Station
from mopro.controller.running import Motion
from mopro.controller.serve import open_end, serve
from mopro.emulator import Emulator
from mopro.link import load_dialect
from mopro.machine import load_machine

TEXT = "UU012500/1\nVEL1 8.0\nACC1 0.25\n:A\nMRI1 4.0\nWX1\nMRI1 -4.0\nWX1\nJUMP A\n"
BAUD = 115200


class Controller:
    """A virtual controller in a thread, at a real end; counts what it is told."""

    def __init__(self, listen="pty", dialect="checked"):
        self.dialect = dialect
        emulator = Emulator(load_machine("chow1992"), compiled=False)
        # The first use loads much: no client should have to wait for that.
        Motion(emulator, mopro.compile(TEXT), emulator.machine.travel_u(), 0.5).advance(0.1)
        self.station = Station(load_dialect(dialect), emulator, baud=BAUD)
        self.said = []
        self.stopped = threading.Event()
        self.polled = threading.Event()
        self.loading = threading.Event()
        device = self.station.device
        do = device.do

        def counted(statement, fields, now_s):
            self.said.append(statement)
            rows = do(statement, fields, now_s)
            self.now_s = now_s
            if statement == "begin":
                self.loading.set()
            elif statement == "stop":
                self.stopped.set()
            elif self.said.count("sample") > 4 and device.state == "running":
                self.polled.set()
            return rows

        device.do = counted
        self.end = open_end(listen, BAUD)

    @property
    def at_rest(self):
        device = self.station.device
        device.move_on(self.now_s + 5.0)
        return device.state not in ("running", "stopping")

    @contextmanager
    def serving(self):
        over = threading.Event()
        thread = threading.Thread(
            target=serve, args=(self.station, self.end), kwargs={"going": lambda: not over.is_set()}
        )
        thread.start()
        try:
            yield self
        finally:
            over.set()
            thread.join()
            self.end.close()


@pytest.fixture
def controller(request):
    with Controller(*getattr(request, "param", ())).serving() as controller:
        yield controller


@contextmanager
def running(controller, folder, *args, limit=None, wait=True):
    """`mopro run P.CMD --port ...` under way: the motor moves."""
    (folder / "P.CMD").write_text(TEXT)
    # Whoever starts the tests may have SIGINT or SIGHUP ignored, and children inherit that.

    def prepared():
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
            signal.signal(number, signal.SIG_DFL)
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    command = [sys.executable, "-B", "-m", "mopro", "run", "P.CMD", "--port",
               controller.end.address, "--dialect", controller.dialect, "--baud", str(BAUD),
               *map(str, args)]  # fmt: skip
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=prepared,
    ) as process:  # fmt: skip
        try:
            if wait:
                assert controller.polled.wait(LIMIT_S), process.communicate(timeout=LIMIT_S)
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def told(process, controller, code=1):
    """Output and errors of the process at its end, after a stop that the controller has heard."""
    out, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert controller.said.count("stop") >= 1
    assert controller.at_rest
    return out, errors


@pytest.mark.parametrize("number", ["SIGINT", "SIGHUP", "SIGUSR1", "SIGTSTP"])
def test_a_signal_stops_the_motor_and_the_report_says_so(controller, tmp_path, number):
    with running(controller, tmp_path, "--json") as process:
        process.send_signal(getattr(signal, number))
        out, errors = told(process, controller)
    assert "both axes rest" in errors
    assert number in errors or "keyboard" in errors
    assert json.loads(out)["trouble"]
    assert (tmp_path / "run.parquet").exists()


@pytest.mark.parametrize(
    "controller", [("pty", "plain"), ("socket://127.0.0.1:0", "checked")], indirect=True
)
@pytest.mark.parametrize("when", ["at once", "while it stops"])
def test_more_signals_neither_cancel_the_stop_nor_lose_the_report(controller, tmp_path, when):
    with running(controller, tmp_path, "--report", "r.html") as process:
        process.send_signal(signal.SIGTERM)
        if when == "while it stops":
            assert controller.stopped.wait(LIMIT_S)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            process.send_signal(number)
        out, errors = told(process, controller)
    assert "ended by SIG" in errors or "interrupted from the keyboard" in errors
    assert "both axes rest" in errors
    assert "Recording: run.parquet" in out
    assert (tmp_path / "r.html").exists()


def test_a_signal_before_the_start_starts_nothing(controller, tmp_path):
    with running(controller, tmp_path, wait=False) as process:
        assert controller.loading.wait(LIMIT_S)
        process.send_signal(signal.SIGTERM)
        _, errors = told(process, controller, 130)
    assert "run" not in controller.said
    assert "no run was started" in errors


def test_a_trace_that_outgrows_its_disk_stops_the_motor(controller, tmp_path):
    with running(controller, tmp_path, "--trace", "t.log", limit=30_000) as process:
        _, errors = told(process, controller)
    assert "t.log: the trace cannot be written" in errors
    assert "both axes rest" in errors
    assert "run_for" in controller.said or "run" in controller.said
    assert 25_000 < (tmp_path / "t.log").stat().st_size <= 30_000


@pytest.mark.parametrize("command", ["run", "flash", "link-test"])
def test_a_trace_that_takes_nothing_is_told_before_anything_is_sent(
    controller, mopro_process, command
):
    args = [*(["P.CMD"] if command != "link-test" else []), "--baud", BAUD]
    done = mopro_process(
        command, *args, "--port", controller.end.address, "--trace", "/dev/full", text=TEXT
    )
    assert done.returncode == 2
    assert "/dev/full: the trace cannot be written: No space left on device" in done.stderr
    assert controller.said == []


def test_a_recording_that_outgrows_its_disk_is_lost_but_the_report_is_not(controller, tmp_path):
    with running(controller, tmp_path, "--json", "--for", "2s", limit=100) as process:
        out, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    assert "Traceback" not in errors
    assert "File too large" in errors
    assert len(json.loads(out)["moves"]) > 2
    assert controller.at_rest


def test_a_deadline_ends_a_run_at_standstill(controller, tmp_path):
    """That it is kept to the tenth of a second is shown in the time of a port in memory."""
    with running(controller, tmp_path, "--deadline", "6s", wait=False) as process:
        _, errors = told(process, controller)
    assert "time allowed is over" in errors
    assert "both axes rest" in errors


def test_a_controller_that_speaks_nonsense_is_stopped(controller, tmp_path):
    device = controller.station.device
    do = device.do

    def absurd(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        if statement == "sample" and controller.polled.is_set() and not controller.stopped.is_set():
            return [rows[0] | {"position_1": "9" * 400}]
        return rows

    device.do = absurd
    with running(controller, tmp_path) as process:
        _, errors = told(process, controller)
    assert "makes no sense" in errors
    assert "both axes rest" in errors


def test_a_killed_host_leaves_a_motor_that_brakes_by_itself(controller, tmp_path):
    with running(controller, tmp_path) as process:
        process.kill()
        process.wait()
    device = controller.station.device
    device.move_on(controller.now_s + 3.5)
    assert device.state == "silent"


@pytest.mark.parametrize("controller", [("pty", "plain")], indirect=True)
def test_a_dialect_without_a_heartbeat_is_warned_of(controller, tmp_path):
    with running(controller, tmp_path) as process:
        process.send_signal(signal.SIGINT)
        _, errors = told(process, controller)
    assert "warning: the dialect plain has no heartbeat" in errors


@contextmanager
def standing_pipe(path):
    """A pipe at `path` that is open for reading, and never read."""
    os.mkfifo(path)
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        yield
    finally:
        os.close(handle)


def test_a_trace_that_blocks_holds_up_neither_deadline_nor_report(controller, tmp_path):
    with (
        standing_pipe(tmp_path / "t.log"),
        running(controller, tmp_path, "--trace", "t.log", "--deadline", "12s") as process,
    ):
        _, errors = told(process, controller)
    assert "time allowed is over" in errors or "nothing takes what is written there" in errors
    assert "both axes rest" in errors


def test_a_signal_ends_a_run_whose_trace_blocks(controller, tmp_path):
    with (
        standing_pipe(tmp_path / "t.log"),
        running(controller, tmp_path, "--trace", "t.log") as process,
    ):
        process.send_signal(signal.SIGINT)
        _, errors = told(process, controller)
    assert "both axes rest" in errors


def test_a_trace_that_nobody_reads_is_told_before_anything_is_sent(
    controller, tmp_path, mopro_process
):
    os.mkfifo(tmp_path / "t.log")
    done = mopro_process(
        "run", "P.CMD", "--port", controller.end.address, "--trace", "t.log", text=TEXT
    )
    assert done.returncode == 2
    assert "nobody reads this pipe" in done.stderr
    assert controller.said == []


def test_a_report_that_nobody_reads_can_be_interrupted(controller, tmp_path):
    """Signals are held back until the report is printed, but not for ever."""
    (tmp_path / "P.CMD").write_text(TEXT)
    with (
        standing_pipe(tmp_path / "r.html"),
        running(controller, tmp_path, "--for", "1s", "--report", "r.html", wait=False) as process,
    ):
        assert controller.polled.wait(LIMIT_S)
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(0.5)
    assert controller.at_rest


@pytest.mark.parametrize(
    "number", [signal.SIGABRT, signal.SIGTRAP, signal.SIGSYS, signal.SIGRTMIN + 3]
)
def test_every_signal_that_can_be_caught_ends_in_a_stop(controller, tmp_path, number):
    with running(controller, tmp_path) as process:
        process.send_signal(number)
        _, errors = told(process, controller)
    assert "both axes rest" in errors


@pytest.mark.parametrize("number", [signal.SIGTTOU, signal.SIGTTIN])
def test_a_run_in_the_background_goes_on(controller, tmp_path, number):
    with running(controller, tmp_path) as process:
        for _ in range(4):
            process.send_signal(number)
            controller.polled.clear()
            assert controller.polled.wait(LIMIT_S)
        process.send_signal(signal.SIGINT)
        _, errors = told(process, controller)
    assert "keyboard" in errors


@pytest.mark.parametrize("sink", ["gone", "/dev/full"])
@pytest.mark.parametrize("more", [[], ["--json"], ["--out", "-"]])
def test_trouble_is_told_whatever_standard_output_does(controller, tmp_path, sink, more):
    (tmp_path / "P.CMD").write_text(TEXT)
    read, write = os.pipe()
    os.close(read)
    out = write if sink == "gone" else os.open(sink, os.O_WRONLY)
    command = [sys.executable, "-m", "mopro", "run", "P.CMD", "--port", controller.end.address,
               "--baud", str(BAUD), *more]  # fmt: skip
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=out, stderr=subprocess.PIPE, text=True
    ) as run:
        assert controller.polled.wait(LIMIT_S)
        run.send_signal(signal.SIGTERM)
        _, errors = run.communicate(timeout=LIMIT_S)
    for handle in {write, out}:
        os.close(handle)
    assert run.returncode != 0
    assert "ended by SIGTERM" in errors
    assert "both axes rest" in errors
