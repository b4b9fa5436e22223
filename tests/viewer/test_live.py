"""Live pages in a real browser: a run that the page stops, a controller that it disturbs."""

import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest

import mopro
from helpers.browser import browser, required_browser
from helpers.commands import LIMIT_S
from mopro.controller import Station
from mopro.controller.running import Motion
from mopro.controller.serve import open_end, serve
from mopro.emulator import Emulator
from mopro.link import load_dialect
from mopro.machine import load_machine
from mopro.viewer.live import FAULTS, ControllerPanel
from mopro.viewer.page_server import Page, in_browser, serving

pytestmark = pytest.mark.browser

TEXT = "UU012500/1\nVEL1 8.0\nACC1 0.25\n:A\nMRI1 4.0\nWX1\nMRI1 -4.0\nWX1\nJUMP A\n"
BAUD = 115200
SAID = "document.querySelector('.live-status').value"


class Bench:
    """A virtual controller at a real pseudo-terminal, with its page; counts what it is told."""

    def __init__(self):
        machine = load_machine("chow1992")
        emulator = Emulator(machine, compiled=False)
        # The first use loads much: no client should have to wait for that.
        Motion(emulator, mopro.compile(TEXT), emulator.machine.travel_u(), 0.5).advance(0.1)
        self.pitch_u = machine.axis.pitch_m / machine.microstep_m
        self.station = Station(load_dialect("checked"), emulator, baud=BAUD)
        self.device = self.station.device
        self.panel = ControllerPanel(self.station, machine)
        self.end = open_end("pty", BAUD)
        self.said = []
        do = self.device.do

        def counted(statement, fields, now_s):
            self.said.append(statement)
            return do(statement, fields, now_s)

        self.device.do = counted

    @contextmanager
    def serving(self):
        over = threading.Event()
        thread = threading.Thread(
            target=serve, args=(self.station, self.end),
            kwargs={"going": lambda: not over.is_set(), "tick": self.panel.tick},
        )  # fmt: skip
        acts = {"stop": self.panel.stop, "fault": self.panel.fault}
        page = Page("controller", self.panel.feed, acts, {"stop": "Stop", "faults": list(FAULTS)})
        thread.start()
        try:
            with serving(page) as self.address:
                yield self
        finally:
            over.set()
            thread.join()
            self.end.close()


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture
def bench():
    required_browser()
    with Bench().serving() as found:
        yield found


@contextmanager
def running(folder, *args):
    """`mopro run P.CMD ARGS --live` under way, and the address of its page."""
    (folder / "P.CMD").write_text(TEXT)
    command = [sys.executable, "-B", "-m", "mopro", "run", "P.CMD", *map(str, args), "--live"]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            said = process.stderr.readline()
            assert said.startswith("Page: http://127.0.0.1:"), said + process.stderr.read()
            yield process, said.split()[1]
        finally:
            if process.poll() is None:
                process.kill()


def test_the_file_that_the_browser_is_given_leads_to_the_page(bench, chromium, monkeypatch):
    given = []
    monkeypatch.setattr("webbrowser.open", given.append)
    with in_browser(bench.address):
        page = chromium.open(given[0])
        assert page.value("location.origin") in bench.address
        page.until(f"{SAID} !== ''")
        assert page.value("document.referrer") == ""
        assert page.complaints() == []


def test_a_fault_by_click_and_a_stop_from_the_page_reach_the_controller(bench, chromium, tmp_path):
    panel = chromium.open(bench.address)
    port = ("--port", bench.end.address, "--dialect", "checked", "--baud", BAUD)
    with running(tmp_path, *port, "--json") as (process, address):
        page = chromium.open(address)
        page.until("Mopro.state && Mopro.state.last > 0.5")
        assert page.value(SAID) == "running"
        panel.until(f"{SAID}.startsWith('running')")
        panel.until("Mopro.state.view.program.includes('MRI1 4.0')")
        panel.click("[data-fault='axis 1 loses a pitch']")
        panel.until(f"{SAID}.includes('axis 1 loses a pitch × 1')")
        page.until("Mopro.state.last > 1.5")
        assert bench.said.count("stop") == 0
        page.click(".stop")
        out, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1, errors
    assert "P.CMD: stopped from the live page" in errors
    assert "both axes rest" in errors
    assert '"trouble": "stopped from the live page' in out
    assert bench.said.count("stop") >= 1
    seen = bench.device.seen()
    assert seen.state == "stopped"
    assert seen.commanded_u[1] - seen.actual_u[1] == pytest.approx(bench.pitch_u, abs=1)
    page.until(f"{SAID}.includes('both axes rest')")
    assert page.value("document.querySelector('.stop').disabled")
    assert page.value("[...document.querySelectorAll('.listing .ran')].length") >= 2
    panel.until(f"{SAID}.startsWith('stopped')")
    for tab in (page, panel):
        assert tab.complaints() == []
        assert {url.split("?")[0].rsplit("/", 1)[1] for url in tab.requests()} <= {
            "feed", "stop", "fault",
        }  # fmt: skip
        assert all(url.startswith("http://127.0.0.1:") for url in tab.requests())
        tab.close()


def test_an_emulated_run_is_shown_in_real_time_and_stopped(chromium, tmp_path):
    with running(tmp_path, "--emulate", "--rate", "200Hz", "--for", "60s") as (process, address):
        page = chromium.open(address)
        page.until("Mopro.state && Mopro.state.last > 0.4")
        assert page.value("Mopro.state.last") < 20
        page.click("[data-line='5']")
        assert not page.value("Mopro.live.following"), "who looks elsewhere is left there"
        page.click(".stop")
        process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130
    assert [file.name for file in tmp_path.iterdir()] == ["P.CMD"]
    page.until(f"{SAID}.includes('ended before it was complete')")
    assert float(page.value("Mopro.player.speed.value")) >= 0.01, "to play all in half a minute"
    assert page.complaints() == []
    page.close()


def test_what_a_page_has_seen_is_halved_without_losing_an_extreme(chromium, tmp_path):
    with serving(Page("title", ControllerPanel(Station(
        load_dialect("checked"), Emulator(load_machine("chow1992"))), load_machine("chow1992"),
    ).feed, {})) as address:  # fmt: skip
        page = chromium.open(address)
        found = page.value("""(() => {
            const part = new Mopro.GrowingPart(2, [], [], { x: { first: [], second: [] } });
            const start = Array.from({ length: 30001 }, (_, i) => i);
            const values = start.map((i) => i === 12345 ? 7 : i === 12346 ? -9 : i % 3 ? 0 : null);
            part.add({ start, end: start, channels: { x: [values, values] } });
            const { first, second } = part.channels.x;
            const at = first.findIndex((v, i) => v === 7 || second[i] === 7);
            const known = [...first, ...second].filter((v) => !Number.isNaN(v));
            return [part.start.length, Math.min(...known),
                    at, part.start[at], part.end[at], part.at("x", 12345)];
        })()""")
        sampled = page.value("""(() => {
            const part = new Mopro.GrowingPart(1, [], [], { x: { first: [], second: [] } });
            part.add({ start: [0, 1], end: [0, 1], channels: { x: [[2, 3], [2, 3]] } });
            const before = part.size;
            part.add({ start: [2], end: [3], channels: { x: [[2], [4]] } });
            return [before, part.size];
        })()""")
        page.close()
    assert sampled == [1, 2], "single samples are joined by a line, and no area"
    assert found[:2] == [15000, -9]
    assert found[3] <= 12345 <= found[4]
    assert found[5][1] == 7
