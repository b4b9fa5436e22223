"""The server of live pages: whom it answers, what it tells, and faults that it passes on."""

import contextlib
import html
import http.client
import json
import socket
import stat
import sys
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

import mopro
from helpers.commands import run_here
from mopro.controller import Station
from mopro.emulator import Emulator
from mopro.link import load_dialect
from mopro.machine import load_machine
from mopro.viewer import page_server as web_server
from mopro.viewer.live import ControllerPanel, Feed, LiveRun, Paced
from mopro.viewer.page_server import MOST_CONNECTIONS, Page, in_browser, serving
from mopro.viewer.run import schedule_of

TEXT = "UU012500/1\nVEL1 8.0\nACC1 0.25\nMRI1 4.0\nWX1\n"


@pytest.fixture(scope="module")
def heard():
    return []


@pytest.fixture(scope="module")
def address(heard):
    with serving(Page("title", Feed(dict), {"stop": heard.append})) as found:
        yield urlsplit(found)


def answer(address, method="GET", path=None, body=None, **headers):
    """Status and text of the server's answer; headers by name, _ for -."""
    client = http.client.HTTPConnection(address.hostname, address.port, timeout=10)
    path = f"{address.path}?{address.query}" if path is None else path
    client.request(method, path, body, {k.replace("_", "-"): v for k, v in headers.items()})
    got = client.getresponse()
    found = got.status, got.read().decode(), dict(got.getheaders())
    client.close()
    return found


def test_the_page_is_given_to_who_has_the_token(address):
    status, text, headers = answer(address)
    assert status == 200
    assert "connect-src &#x27;self&#x27;" in text
    assert headers["x-frame-options"] == "DENY"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/?token=wrong", {}),
        ("/feed", {}),
        (None, {"Host": "evil.example"}),
        (None, {"Host": "evil.example:PORT"}),
        (None, {"Origin": "http://evil.example"}),
        (None, {"Origin": "null"}),
        (None, {"Sec_Fetch_Site": "cross-site"}),
        (None, {"Sec_Fetch_Site": "same-site"}),
        (None, {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Dest": "iframe"}),
        ("/?token=wrong", {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Dest": "document"}),
        ("/feed?QUERY", {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Dest": "document"}),
    ],
)
def test_others_are_refused(address, path, headers):
    headers = {k: v.replace("PORT", str(address.port)) for k, v in headers.items()}
    path = path and path.replace("QUERY", address.query)
    status, text, _ = answer(address, path=path, **headers)
    assert status == 403
    assert "<" not in text


@pytest.mark.parametrize(
    "headers",
    [{}, {"Origin": "http://evil.example"}, {"Origin": "http://127.0.0.1:1"}, {"Origin": "null"}],
)
def test_another_site_cannot_stop_the_motor(address, heard, headers):
    status, _, _ = answer(address, "POST", f"/stop?{address.query}", "1", **headers)
    assert status == 403
    assert heard == []


def test_the_page_itself_can(address, heard):
    origin = f"http://127.0.0.1:{address.port}"
    status, _, _ = answer(address, "POST", f"/stop?{address.query}", '""', Origin=origin)
    assert (status, heard) == (204, ['""'])
    heard.clear()
    status, _, _ = answer(address, "POST", f"/stop?{address.query}", "x" * 5000, Origin=origin)
    assert (status, heard) == (413, [])
    assert answer(address, "POST", f"/other?{address.query}", Origin=origin)[0] == 404


def test_a_file_with_the_token_may_lead_to_the_page(address):
    led = {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Dest": "document"}
    assert answer(address, **led)[0] == 200


@pytest.mark.parametrize("sent", [b"", b"x", b"x" * 99])
def test_a_body_that_breaks_off_does_nothing_and_is_no_fault_of_the_server(
    address, heard, caplog, sent
):
    """The exception was printed with its traceback."""
    head = (
        f"POST /stop?{address.query} HTTP/1.1\r\nHost: 127.0.0.1:{address.port}\r\n"
        f"Origin: http://127.0.0.1:{address.port}\r\nContent-Length: 100\r\n\r\n"
    )
    with socket.create_connection((address.hostname, address.port), timeout=10) as client:
        client.sendall(head.encode() + sent)
        client.shutdown(socket.SHUT_WR)
        while client.recv(1000):
            pass
    assert answer(address)[0] == 200
    assert (heard, caplog.records) == ([], [])


def test_the_token_is_in_a_file_of_ones_own_and_not_in_the_arguments(monkeypatch):
    """Every user can read the arguments of a process."""
    given = []
    monkeypatch.setattr("webbrowser.open", given.append)
    address = "http://127.0.0.1:1/?token=secret&a=<b>"
    with in_browser(address):
        (link,) = given
        file = Path(urlsplit(link).path)
        assert link == file.as_uri()
        assert "secret" not in link
        assert html.escape(address) in file.read_text()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert not file.parent.exists()


def test_without_a_place_for_the_file_no_browser_is_started(monkeypatch, tmp_path):
    monkeypatch.setattr("webbrowser.open", lambda _: pytest.fail("started"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with in_browser("http://127.0.0.1:1/?token=secret"):
        pass


def test_connections_that_ask_for_nothing_make_room(address):
    """200 half requests were kept for ever."""
    place = address.hostname, address.port
    with contextlib.ExitStack() as opened:
        idle = [
            opened.enter_context(socket.create_connection(place, timeout=10))
            for _ in range(MOST_CONNECTIONS + 5)
        ]
        for client in idle:
            client.sendall(b"GET / HTTP/1.1\r\n")
        assert answer(address)[0] == 200
        told = [client.recv(1000) for client in idle[:5]]
    assert all(text.startswith(b"HTTP/1.1 503") and text.endswith(b"busy\n") for text in told)


def test_a_connection_that_asks_for_nothing_is_closed(monkeypatch):
    monkeypatch.setattr(web_server, "PATIENCE_S", 0.05)
    with serving(Page("title", Feed(dict), {})) as found:
        place = urlsplit(found)
        with socket.create_connection((place.hostname, place.port), timeout=10) as client:
            client.sendall(b"GET / HTTP/1.1\r\n")
            assert client.recv(100) == b""


@pytest.mark.parametrize("body", ["[" * 4096, "nothing", '"no such fault"', "\ufffd", "9" * 4096])
def test_what_is_no_fault_is_ignored(body):
    machine = load_machine("chow1992")
    station = Station(load_dialect("checked"), Emulator(machine))
    panel = ControllerPanel(station, machine)
    panel.fault(body)
    panel.tick(0.0)
    assert not station.injector.happened


def test_a_page_that_is_behind_gets_a_snapshot():
    feed = Feed(lambda: {"all": True})
    number, event, data = feed.begin()
    assert (number, event, data) == (0, "snapshot", '{"all":true}')
    feed.tell("samples", [1])
    assert [message[1:] for message in feed.after(0)] == [("samples", "[1]")]
    for _ in range(3000):
        feed.tell("samples", [2])
    assert [message[1] for message in feed.after(1)] == ["snapshot"]
    assert feed.after(3001) == []


class Clock:
    def __init__(self):
        self.now_s, self.slept = 100.0, []

    def __call__(self):
        return self.now_s

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now_s += seconds


def test_samples_come_when_their_time_has_come_and_none_is_lost():
    clock, got = Clock(), []

    class Kept:
        def write(self, columns):
            got.append((clock.now_s, columns["time_s"]))

    paced = Paced(Kept(), clock, clock.sleep)
    times = np.arange(0, 2, 0.01)
    for part in np.split(times, 2):
        paced.write({"time_s": part})
    assert np.concatenate([part for _, part in got]) == pytest.approx(times)
    assert all(at_s - 100 >= part[-1] - 1e-9 for at_s, part in got)
    assert sum(clock.slept) == pytest.approx(1.99)
    assert max(len(part) for _, part in got) <= 6


def test_a_run_is_told_as_a_snapshot_then_sample_by_sample():
    program, machine = mopro.compile(TEXT), load_machine("chow1992")
    live = LiveRun(program, machine, schedule_of(machine, program, None))
    assert live.snapshot()["views"] == []
    for at in range(3):
        position = {f"{kind}_{n}_m": 0.1 * at for kind in ("command", "position") for n in (1, 2)}
        row = {"time_s": at / 20, "line": 4 + (at > 1), **position, "force_1_N": np.nan}
        live.write({name: np.array([value]) for name, value in row.items()})
    snapshot, one, two = ((event, json.loads(data)) for _, event, data in live.feed.after(0))
    (view,) = snapshot[1]["views"]
    assert snapshot[0] == "snapshot"
    assert [panel["title"] for panel in view["panels"]] == ["Position", "Following error"]
    traces = [trace["channel"] for trace in view["panels"][0]["traces"]]
    assert traces == ["command_1_m", "position_1_m"], "axis 2 does not move"
    assert one[1]["start"] == [0.05]
    assert one[1]["lines"] == []
    assert two[1]["lines"] == [[0.1, 5]]
    assert two[1]["channels"]["force_1_N"] == [[None], [None]]


class TestThePanel:
    @pytest.fixture
    def panel(self):
        machine = load_machine("chow1992")
        emulator = Emulator(machine, compiled=False)
        station = Station(load_dialect("checked"), emulator)
        device = station.device
        device.do("begin", {"name": "P"}, 0.0)
        for line in TEXT.splitlines():
            device.take(line)
        device.do("end", {}, 0.0)
        device.do("run", {"name": "P"}, 0.0)
        now = [0.0]
        found = ControllerPanel(station, machine, lambda: now[0])
        found.device, found.station, found.clock = device, station, now
        return found

    def at(self, panel, now_s):
        panel.clock[0] = now_s
        panel.tick(now_s)
        return panel.device.seen()

    def test_the_state_is_told_with_the_program(self, panel):
        assert self.at(panel, 0.2).state == "running"
        (view,) = panel.snapshot()["views"]
        assert view["program"] == TEXT.splitlines()
        events = [event for _, event, _ in panel.feed.after(0)]
        assert events == ["snapshot", "status"]
        self.at(panel, 0.25)
        assert panel.feed.after(2)[0][1] == "samples"

    @pytest.mark.parametrize(
        ("fault", "state"),
        [("limit switch opens", "limit"), ("motor overheats", "overheated"),
         ("power dip (reset)", "idle")],
    )  # fmt: skip
    def test_a_fault_ends_the_run(self, panel, fault, state):
        self.at(panel, 0.2)
        panel.fault(json.dumps(fault))
        self.at(panel, 0.21)
        panel.station.say(0.3)
        assert self.at(panel, 5.0).state == state

    def test_a_stop_brakes(self, panel):
        self.at(panel, 0.2)
        panel.stop("")
        assert self.at(panel, 0.21).state == "stopping"
        assert self.at(panel, 5.0).state == "stopped"

    def test_a_lost_reply_is_lost_once(self, panel):
        panel.fault('"next reply is lost"')
        self.at(panel, 0.1)
        injector = panel.station.injector
        assert [injector.reply(b"a"), injector.reply(b"b")] == [(0.0, b""), (0.0, b"b")]
        assert injector.happened == {"missing": 1}

    @pytest.mark.parametrize("body", ["", "no json", '"no fault"', "[1]", "{}"])
    def test_what_is_no_fault_is_ignored(self, panel, body):
        panel.fault(body)
        assert self.at(panel, 0.2).state == "running"
        assert panel.station.injector.scenario.faults == ()


@pytest.mark.parametrize("command", [("run", "P.CMD", "--emulate", "--live"), ("serve", "--web")])
def test_without_the_extra_it_is_said_what_to_install(tmp_path, monkeypatch, command):
    for name in [n for n in sys.modules if n.partition(".")[0] in ("starlette", "uvicorn")]:
        monkeypatch.delitem(sys.modules, name)
    for name in [n for n in sys.modules if n == "mopro.viewer.page_server"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "starlette", None)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    done = run_here(tmp_path, *command, text=TEXT)
    assert done.returncode == 2
    assert "pip install 'mopro[web]'" in done.stderr
