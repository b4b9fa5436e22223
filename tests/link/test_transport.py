"""Real ports as pyserial gives them, and what is said of those that cannot be had."""

import errno
import io
import re
import socket

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


# What Python, its errors or pyserial say.
LEAKS = re.compile(
    r"Errno|Exception|Error|NoneType|instances|debug\||codec|ioctl|subpattern|null byte|\bNone\b"
    r"|[Cc]ould not|invalid URL|unknown option|expected a string|\(\d+,"
)
HOSTS = ["", "127.0.0.1", "[::1]", "::1", "nosuch.invalid", "a b", "\u4e2d\u6587", "a" * 70]
PORTS = ["", ":", ":0", ":99999", ":-1", ":abc", ":FREE", ":FREE?x=1", ":FREE?logging=z", ":FREE/p"]
ODD = [
    *(f"socket://{host}{port}" for host in HOSTS for port in PORTS),
    *(f"rfc2217://{host}{port}" for host in HOSTS for port in PORTS),
    *(f"{kind}://127.0.0.1:FREE" for kind in ("x", "http", "tcp", "", "SOCKETS", "cp2110")),
    *("loop://?x=1", "loop://?logging=q", "hwgrep://(", "hwgrep://zzz", "hwgrep://zzz&x=1"),
    *("spy://", "spy:///nope", "spy:///nope?bad=1", "alt:///nope?class=Zzz", "alt:///dev/null"),
    *("", " ", "FOLDER", "FILE", "FILE/x", "/dev/null", "nope", "COM99", "a\0b", "127.0.0.1:FREE"),
]  # fmt: skip


@pytest.mark.parametrize("url", ODD)
def test_a_port_that_cannot_be_opened_is_told_in_plain_words(tmp_path, url):
    with socket.socket() as taken:
        # Bound and not listening: a connection is refused, and nobody else can have the port.
        taken.bind(("127.0.0.1", 0))
        (tmp_path / "file").write_text("x")
        url = url.replace("FREE", str(taken.getsockname()[1]))
        url = url.replace("FOLDER", str(tmp_path)).replace("FILE", str(tmp_path / "file"))
        with pytest.raises(PortError) as caught:
            SerialPort(url, LINE)
    said = str(caught.value).removeprefix(url)
    assert not LEAKS.search(said), said
    assert len(said) > 20


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("FOLDER", "it is a folder: expected a device"),
        ("http://x", "there are no ports of http://: expected a device"),
        ("127.0.0.1:4000", "one of a network is written socket://127.0.0.1:4000"),
        ("socket://127.0.0.1:0", "nothing listens there: is the controller on"),
        ("socket://127.0.0.1", "expected socket://HOST:PORT"),
        ("loop://?x=1", "expected loop://, without these options"),
    ],
)
def test_what_to_do_about_a_port_is_said(tmp_path, url, words):
    with pytest.raises(PortError) as caught:
        SerialPort(url.replace("FOLDER", str(tmp_path)), LINE)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (socket.gaierror(-2, "Name or service not known"), "no machine of that name"),
        (TimeoutError("timed out"), "does not answer"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "no way to that machine"),
        (OSError(errno.ENETUNREACH, "Network is unreachable"), "no way to that machine"),
        (OSError(errno.ETIMEDOUT, "Connection timed out"), "does not answer"),
        (ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused"), "nothing listens"),
        (ConnectionResetError(errno.ECONNRESET, "reset by peer"), "hung up"),
    ],
)
def test_what_a_network_says_is_told_in_plain_words(monkeypatch, cause, words):
    def refuse(*args, **kwargs):
        try:
            raise cause
        except OSError as error:
            raise serial.SerialException(f"Could not open port: {error}")  # noqa: B904

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortError) as caught:
        SerialPort("socket://10.0.0.1:4000", LINE)
    assert words in str(caught.value)
    assert not LEAKS.search(str(caught.value))


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
