"""Ends of a run: the stop goes out first, the report comes second, both ends in memory."""

import errno
import io
import signal
from dataclasses import replace
from importlib import resources

import pytest

import mopro
from helpers.bench_of_link import DIALECTS, OLD, SHORT, bench, with_line
from mopro.controller.device import Refusal
from mopro.errors import LinkError
from mopro.link import SerialBackend, load_dialect
from mopro.link.dialect import read_dialect
from mopro.link.flash import flash
from mopro.link.transport import TracedPort
from mopro.machine import load_machine
from mopro.source import Source

LONG = mopro.compile(SHORT.replace("2.0", "12.0").replace("WT50", "WT60000"), "long.CMD")
MACHINE = load_machine("chow1992")


class Kept:
    """A sink that keeps what it gets."""

    def __init__(self):
        self.rows = 0

    def write(self, columns):
        self.rows += len(columns["time_s"])


class Full(Kept):
    """A sink on a disk that is full after `most` pieces."""

    def __init__(self, most=0):
        super().__init__()
        self.most = most
        self.tries = 0

    def write(self, columns):
        self.tries += 1
        if self.tries > self.most:
            raise OSError(errno.ENOSPC, "No space left on device")
        super().write(columns)


class FullLog(io.StringIO):
    """A trace on a disk that is full after `most` flushes."""

    name = "t.log"

    def __init__(self, most):
        super().__init__()
        self.most = most

    def flush(self):
        self.most -= 1
        if self.most < 0:
            raise OSError(errno.ENOSPC, "No space left on device")


class Counted:
    """Counts what the controller is told, by statement, and when."""

    def __init__(self, joined):
        self.joined = joined
        self.said = []
        do = joined.station.device.do

        def counted(statement, fields, now_s):
            self.said.append((statement, now_s))
            return do(statement, fields, now_s)

        joined.station.device.do = counted

    def times(self, statement):
        return [at_s for said, at_s in self.said if said == statement]

    def run(self, sink=None, program=LONG, for_s=None, **options):
        return SerialBackend(self.joined.session, MACHINE, **options).run(
            program, sink or Kept(), for_s
        )


def running_since(counted):
    return counted.times("run")[0]


def rests(joined):
    device, now_s = joined.station.device, joined.session.port.now_s()
    before = [device.do(name, {}, now_s) for name in ("position", "measured")]
    return [device.do(name, {}, now_s + 5.0) for name in ("position", "measured")] == before


class Troubled:
    """A port that calls `trouble` at its first read after `at_s`, and at later reads too."""

    def __init__(self, port, at_s, trouble, times=1):
        self.port, self.at_s, self.trouble, self.times = port, at_s, trouble, times

    def __getattr__(self, name):
        return getattr(self.port, name)

    def read(self, until_s):
        data = self.port.read(until_s)
        if self.times and self.port.now_s() > self.at_s:
            self.times -= 1
            self.trouble()
        return data


def raiser(error):
    def trouble():
        raise error

    return trouble


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_recording_on_a_full_disk_stops_the_motor_and_says_both(dialect):
    counted = Counted(bench(dialect))
    sink = Full()
    run = counted.run(sink)
    assert counted.times("stop")
    assert "No space left on device" in run.trouble
    assert "recording" in run.trouble
    assert "both axes rest" in run.trouble
    assert sink.tries == 1, "a sink that failed is not written to again"
    assert rests(counted.joined)


def test_a_recording_that_fails_after_the_end_is_told_and_the_moves_are_kept():
    run = Counted(bench()).run(Full(), mopro.compile(SHORT))
    assert "the run has ended" in run.trouble
    assert "No space left on device" in run.trouble
    assert len(run.moves) == 2


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("flushes", range(0, 40, 7))
def test_a_trace_on_a_full_disk_stops_the_motor_and_says_both(dialect, flushes):
    joined = bench(dialect)
    log = FullLog(10**9)
    joined.session.port = TracedPort(joined.session.port, log)
    counted = Counted(joined)
    write = log.write

    def full_after_the_start(text):
        if "RN SCRATCH" in text:
            log.most = flushes
        return write(text)

    log.write = full_after_the_start
    run = counted.run()
    assert counted.times("run")
    assert counted.times("stop")
    assert "trace" in run.trouble
    assert "No space left on device" in run.trouble
    assert "both axes rest" in run.trouble


def test_a_trace_that_fails_before_the_start_starts_nothing():
    joined = bench()
    joined.session.port = TracedPort(joined.session.port, FullLog(20))
    counted = Counted(joined)
    with pytest.raises(mopro.errors.DataError, match="No space left") as caught:
        counted.run()
    assert not counted.times("run")
    assert counted.times("stop")
    assert "no run was started" in caught.value.render()


@pytest.mark.parametrize("digits", [16, 400, 5000])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_absurd_position_is_a_fault_of_the_link(dialect, digits):
    joined = bench(with_line(load_dialect(dialect), baud=1_000_000))
    counted = Counted(joined)
    do = joined.station.device.do

    def absurd(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        if statement == "sample" and counted.times("run") and not counted.times("stop"):
            return [rows[0] | {"position_1": "9" * digits}]
        return rows

    joined.station.device.do = absurd
    run = counted.run()
    assert counted.times("stop")
    assert "makes no sense" in run.trouble
    assert "both axes rest" in run.trouble


@pytest.mark.parametrize("digits", [400, 5000])
def test_an_absurd_index_in_a_listing_is_a_fault_of_the_link(digits):
    language = with_line(load_dialect("checked"), baud=4_000_000)
    few = replace(language.conversation, retries=1)
    joined = bench(replace(language, conversation=few))
    do = joined.station.device.do

    def absurd(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        return [{**row, "index": "1" * digits} for row in rows] if statement == "list" else rows

    joined.station.device.do = absurd
    with pytest.raises(LinkError, match="makes no sense"):
        flash(joined.session, mopro.compile(OLD), "MAIN")


@pytest.mark.parametrize("word", ["1e999", "9" * 400, "1e-99999"])
def test_an_absurd_lag_is_a_fault_of_the_link(word):
    joined = bench()
    do = joined.station.device.do

    def absurd(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        return [{**row, "lag": word} for row in rows] if statement == "moves" else rows

    joined.station.device.do = absurd
    run = Counted(joined).run(program=mopro.compile(SHORT))
    assert "makes no sense" in run.trouble


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("after_s", [1.0, 1.3, 1.7])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(5, "odd"), MemoryError()])
def test_whatever_is_raised_sends_the_stop_first(dialect, after_s, error):
    joined = bench(dialect)
    counted = Counted(joined)
    joined.session.port = Troubled(joined.session.port, after_s, raiser(error))
    try:
        trouble = counted.run().trouble
    except type(error) as raised:
        trouble = "\n".join(raised.__notes__)
        assert not counted.times("run")
    assert counted.times("stop")
    assert "both axes rest" in trouble


def test_an_error_of_the_program_itself_is_raised_after_the_stop_with_its_outcome():
    joined = bench()
    counted = Counted(joined)
    joined.session.port = Troubled(joined.session.port, 1.6, raiser(ZeroDivisionError("bug")))
    with pytest.raises(ZeroDivisionError) as caught:
        counted.run()
    assert "both axes rest" in "\n".join(caught.value.__notes__)
    assert rests(joined)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("times", [2, 3, 7])
def test_a_second_interrupt_does_not_cancel_the_stop_nor_the_report(dialect, times):
    joined = bench(dialect)
    counted = Counted(joined)
    joined.session.port = Troubled(joined.session.port, 1.6, raiser(KeyboardInterrupt()), times)
    run = counted.run()
    assert counted.times("stop")
    assert "interrupted from the keyboard" in run.trouble
    assert "both axes rest" in run.trouble


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGQUIT", "SIGTSTP"])
@pytest.mark.parametrize("times", [1, 2, 40])
def test_signals_end_a_run_by_a_stop_however_many_come(number, times):
    joined = bench()
    counted = Counted(joined)
    number = getattr(signal, number)
    before = signal.getsignal(number)
    joined.session.port = Troubled(
        joined.session.port, 1.6, lambda: signal.raise_signal(number), times
    )
    run = counted.run()
    assert counted.times("stop")
    assert "both axes rest" in run.trouble
    assert number.name in run.trouble or "keyboard" in run.trouble
    assert signal.getsignal(number) is before


def test_a_signal_that_is_ignored_stays_ignored():
    joined = bench()
    joined.session.port = Troubled(
        joined.session.port, 1.2, lambda: signal.raise_signal(signal.SIGHUP)
    )
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert Counted(joined).run(program=mopro.compile(SHORT)).trouble is None
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_signal_while_samples_are_handed_on_waits_until_they_are():
    class Signalled(Kept):
        def write(self, columns):
            signal.raise_signal(signal.SIGTERM)
            super().write(columns)

    counted = Counted(bench())
    sink = Signalled()
    run = counted.run(sink)
    assert sink.rows > 256
    assert "SIGTERM" in run.trouble
    assert "both axes rest" in run.trouble


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_stop_does_not_wait_for_a_greeting(dialect):
    """Nothing is read between the trouble and the stop's last byte."""
    joined = bench(dialect)
    counted = Counted(joined)
    at_s = []

    def trouble():
        at_s.append(joined.session.port.now_s())
        raise KeyboardInterrupt

    joined.session.port = Troubled(joined.session.port, 1.6, trouble)
    counted.run()
    longest = 60 * joined.session.byte_s
    assert counted.times("stop")[0] - at_s[0] < longest


@pytest.mark.parametrize("deadline_s", [4.0, 8.0, 20.0])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_deadline_covers_opening_upload_and_stopping(dialect, deadline_s):
    joined = bench(dialect, opened=False)
    counted = Counted(joined)
    run = counted.run(deadline_s=deadline_s)
    assert "time allowed is over" in run.trouble
    assert "both axes rest" in run.trouble
    assert joined.session.port.now_s() <= deadline_s + 0.1


def test_a_deadline_holds_where_nothing_answers_any_more():
    joined = bench("checked", mopro.controller.faults.Fault("disconnect", at_s=2.0), opened=False)
    run = Counted(joined).run(deadline_s=6.0)
    assert "NOT CONFIRMED" in run.trouble
    assert joined.session.port.now_s() <= 6.1


def without_heartbeat(name="checked"):
    """The dialect as files had it that were written before there was a heartbeat."""
    text = (resources.files("mopro.link") / "dialects" / f"{name}.toml").read_text("utf-8")
    kept = [line for line in text.splitlines() if not line.startswith(("heartbeat", "silent"))]
    return read_dialect(Source("old.toml", "\n".join(kept)))


@pytest.mark.parametrize("dialect", [load_dialect("checked"), without_heartbeat()])
def test_a_host_that_falls_silent_is_noticed_by_a_controller_that_can(dialect):
    joined = bench(dialect)
    counted = Counted(joined)

    def killed():
        raise SystemExit

    joined.session.send_unanswered = lambda statement: None
    joined.session.port = Troubled(joined.session.port, 2.0, killed, times=10**9)
    warned = []
    with pytest.raises(SystemExit):
        counted.run(warn=warned.append)
    device, now_s = joined.station.device, counted.said[-1][1]
    device.move_on(now_s + 2.9)
    assert device.state == "running"
    device.move_on(now_s + 4.0)
    assert device.state == ("silent" if dialect.knows("heartbeat") else "running")
    assert bool(warned) != dialect.knows("heartbeat")


def test_a_run_that_the_heartbeat_ended_is_told_as_that():
    joined = bench()
    joined.station.store.write("SCRATCH", ["WT9000"])
    device = joined.station.device
    device.do("heartbeat", {"milliseconds": 500.0}, 10.0)
    device.do("run", {"name": "SCRATCH"}, 10.1)
    device.do("status", {}, 10.5)
    assert device.do("status", {}, 12.0)[0]["state"] == "silent"
    assert joined.session.dialect.word_of("silent") == "QUIET"
    assert without_heartbeat().word_of("silent") == "STOP"
    device.do("run", {"name": "SCRATCH"}, 20.0)
    assert device.do("status", {}, 25.0)[0]["state"] == "running", "it is for one run"


def test_a_controller_that_refuses_a_heartbeat_is_run_with_a_warning():
    joined = bench()
    do = joined.station.device.do

    def refusing(statement, fields, now_s):
        if statement == "heartbeat":
            raise Refusal(1, "not a statement of this controller")
        return do(statement, fields, now_s)

    joined.station.device.do = refusing
    warned = []
    run = Counted(joined).run(program=mopro.compile(SHORT), warn=warned.append)
    assert run.trouble is None
    assert "refused a heartbeat" in warned[0]


def test_a_state_that_nobody_knows_ends_the_run_by_a_stop():
    joined = bench("plain")
    counted = Counted(joined)
    do = joined.station.device.do

    def strange(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        return [{}] if statement == "status" and not counted.times("stop") else rows

    joined.station.device.do = strange
    word = joined.station._protocol._row
    joined.station._protocol._row = lambda name, row: word(name, row) if row else "WEIRD 1 0"
    run = counted.run(program=mopro.compile(SHORT))
    assert "the status `WEIRD` is in no [states]" in run.trouble
    assert "both axes rest" in run.trouble
