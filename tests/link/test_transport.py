"""Real ports as pyserial gives them, and what is said of those that cannot be had."""

import io

import pytest
import serial

from mopro.errors import LinkError, PortError
from mopro.link import SerialPort, load_dialect
from mopro.link.transport import TracedPort

LINE = load_dialect("plain").line


@pytest.fixture
def loop():
    port = SerialPort("loop://", LINE)
    yield port
    port.close()


def test_bytes_come_back_over_a_loop_and_nothing_is_waited_for_long(loop):
    loop.write(b"MRI1 15.0\r")
    heard = b""
    while len(heard) < 10:
        heard += loop.read(loop.now_s() + 5.0)
    assert heard == b"MRI1 15.0\r"
    before_s = loop.now_s()
    assert loop.read(before_s + 0.05) == b""
    assert 0.05 <= loop.now_s() - before_s < 2.0


@pytest.mark.parametrize(
    "url",
    ["loop://?x=y", "loop://?logging=loud", "hwgrep://(", "socket://", "socket://a:b", "x://"],
)
def test_an_odd_url_is_no_port(url):
    with pytest.raises(PortError, match="cannot be opened"):
        SerialPort(url, LINE)


def test_a_trace_shows_every_byte_with_its_time_and_way(loop):
    log = io.StringIO()
    traced = TracedPort(loop, log)
    traced.write(b"SR\r" + bytes(range(16)))
    heard = b""
    while len(heard) < 19:
        heard += traced.read(traced.now_s() + 5.0)
    rows = log.getvalue().splitlines()[1:]
    for way in "><":
        shown = " ".join(row[15:62] for row in rows if row[13] == way)
        assert bytes.fromhex(shown) == b"SR\r" + bytes(range(16))
    assert [float(row[:12]) for row in rows] == sorted(float(row[:12]) for row in rows)


@pytest.mark.parametrize(
    ("error", "rule", "says"),
    [
        (
            serial.SerialException(13, "could not open port: Permission denied"),
            "no-permission",
            "group",
        ),
        (serial.SerialException(16, "could not open port: busy"), "port-in-use", "another program"),
        (serial.SerialException(2, "could not open port: no such file"), "no-port", "no such port"),
        (ValueError("invalid URL, protocol 'x' not known"), "no-port", "cannot be opened"),
    ],
)
def test_a_port_that_cannot_be_had_says_why(monkeypatch, error, rule, says):
    def refuse(*args, **kwargs):
        raise error

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortError, match=says) as caught:
        SerialPort("/dev/ttyX", LINE)
    assert caught.value.rule == rule


def test_a_port_that_goes_away_is_a_lost_link(loop):
    loop.close()
    with pytest.raises(LinkError) as caught:
        loop.write(b"SR\r")
    assert caught.value.rule == "link-lost"
