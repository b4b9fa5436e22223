"""Parsers of what comes over a line: replies, statements, an editor's messages, requests."""

from __future__ import annotations

import asyncio
import io
import json
import logging
from itertools import islice
from pathlib import Path
from random import Random

from helpers.fuzzing.parser import Parser, Take

# Ends a piece of what the other end sends; it is in no line of a dialect.
_GAP = b"\xfe"
_PROGRAM = "UU012500/1\nVEL1 8.0\nACC1 0.25\nMRI1 0.1\nWX1\n"
_REPLIES = (
    "OK",
    "? 3 no",
    "? BUSY",
    "RS",
    "RUN 4 3",
    "IDLE 0 0",
    "DONE 1 1",
    "STOP 0 0",
    "BRAKE 2 1",
    "0 0",
    "5 0 0 0 0",
    "1 1 0.1 0.5 0 0",
    "1 WT100",
    "0 1",
    "99999999999999999",
    "-1",
    "1e400",
    "1e-9",
    ".",
    "\r\n",
    "> ",
    "\xfe",
    "\0",
    "1:OK*",
    "HOT 1 1",
    "QUIET 1 1",
    "LIMIT 1 1",
)
_STATEMENTS = (
    "ID",
    "SR",
    "DL SCRATCH",
    "EP",
    "RN SCRATCH",
    "RN SCRATCH 100",
    "SP",
    "LS MAIN",
    "PO",
    "PM",
    "PS",
    "CP SCRATCH MAIN",
    "MO",
    "MV 1",
    "HB 3000",
    "\r",
    "\xfe",
    "\x1b",
    "HELLO",
    "RN MAIN 1e15",
    *_PROGRAM.split("\n"),
)


class ScriptedPort:
    """A port whose other end sends a piece of `data` after each write, in simulated time.

    With `wrap` each line of a piece is framed with the number of the line that it answers.
    """

    def __init__(self, data: bytes, dialect: object, wrap: bool) -> None:
        self._pieces = iter(data.split(_GAP))
        self._dialect, self._wrap = dialect, wrap
        self._waiting = b""
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def write(self, data: bytes) -> None:
        piece = next(self._pieces, b"")
        if self._wrap and self._dialect.check:
            piece = self._framed(piece, data)
        self._waiting += piece

    def _framed(self, piece: bytes, asked: bytes) -> bytes:
        from mopro.link.template import BadFrame

        line, check = self._dialect.line, self._dialect.check
        try:
            last = asked.decode("latin-1").removesuffix(line.end).split(line.end)[-1]
            number, _ = check.unwrap(last)
        except BadFrame:
            number = 0
        bodies = piece.decode("latin-1").split(line.reply_end)
        return "".join(check.wrap(b, number) + line.reply_end for b in bodies).encode("latin-1")

    def read(self, until_s: float) -> bytes:
        data, self._waiting = self._waiting, b""
        self._now_s = max(self._now_s + 0.001, until_s if not data else 0.0)
        return data

    def close(self) -> None:
        return


def _replies(name: str) -> object:
    """A conversation of every statement of a dialect, a flash and a run, with a foreign end."""

    def make(_: Path) -> Take:
        import mopro
        from mopro.link import SerialBackend, Session, load_dialect
        from mopro.link.flash import flash
        from mopro.link.probe import probe
        from mopro.machine import load_machine
        from mopro.recording import MemorySink

        dialect, machine = load_dialect(name), load_machine("chow1992")
        program = mopro.compile(_PROGRAM)

        def conversation(data: bytes) -> Session:
            port = ScriptedPort(data[1:], dialect, data[:1] < b"\x80")
            session = Session(port, dialect, Random(1))
            session.give(30.0)
            return session

        def ask(session: Session) -> None:
            session.open()
            fields = {"name": "MAIN", "scratch": "SCRATCH", "first": 1, "milliseconds": 10}
            for statement in islice(dialect.statements, 20):
                session.ask(statement, **fields)

        def run(session: Session) -> None:
            SerialBackend(session, machine, deadline_s=30.0).run(program, MemorySink())

        ways = (ask, ask, run, lambda s: flash(s, program, "MAIN"), lambda s: list(probe(s)))
        return lambda data: ways[(data[0] if data else 0) % len(ways)](conversation(data))

    return make


def _talks() -> list[bytes]:
    """Answers of the virtual controller in such a conversation, in pieces."""
    made = [b"\x00OK\xfeOK\xfeST IDLE\r\nOK", b"\x02OK", b"\x83", b"\x04>\xfe>"]
    for dialect in ("checked", "plain"):
        made += [bytes([0x80 | way]) + _heard(dialect, way) for way in range(5)]
    return made


def _heard(dialect: str, way: int) -> bytes:
    import mopro
    from helpers.bench_of_link import bench
    from mopro.link.flash import flash

    joined = bench(dialect, opened=False)
    port, pieces = joined.session.port, [b""]
    write, read = port.write, port.read

    def writes(data: bytes) -> None:
        pieces.append(b"")
        write(data)

    def reads(until_s: float) -> bytes:
        data = read(until_s)
        pieces[-1] += data
        return data

    port.write, port.read = writes, reads
    joined.session.open()
    if way % 2:
        flash(joined.session, mopro.compile(_PROGRAM), "MAIN")
    else:
        for statement in ("status", "position", "motion"):
            joined.session.ask(statement)
    return _GAP.join(pieces[1:])


def _templates(_: Path) -> Take:
    from mopro.link import load_dialect

    dialects = [load_dialect(name) for name in ("checked", "plain")]
    known = [t for d in dialects for t in (*d.statements.values(), *d.replies.values())]

    def take(data: bytes) -> None:
        line = data.decode("latin-1")
        for template in known:
            read = template.read(line)
            if read is not None:
                template.fill(read)

    return take


def _frames(_: Path) -> Take:
    from mopro.link import load_dialect
    from mopro.link.template import CHECKSUMS, BadFrame

    check = load_dialect("checked").check

    def take(data: bytes) -> None:
        for checksum in CHECKSUMS.values():
            checksum(data)
        line = data.decode("latin-1")
        number = len(data) % check.numbers
        if "\n" not in line and check.unwrap(check.wrap(line, number)) != (number, line):
            raise AssertionError("a frame does not give what it was made of")
        try:
            check.unwrap(line)
        except BadFrame:
            return

    return take


def _controller(name: str) -> object:
    """The virtual controller, whose clock goes on by 1 ms at each gap."""

    def make(_: Path) -> Take:
        from mopro.controller import MemoryStore, Station
        from mopro.emulator import Emulator
        from mopro.link import load_dialect
        from mopro.machine import load_machine

        dialect, emulator = load_dialect(name), Emulator(load_machine("chow1992"), compiled=False)
        check = dialect.check

        def take(data: bytes) -> None:
            station = Station(dialect, emulator, MemoryStore(), baud=4_000_000)
            pieces = data[1:].split(_GAP)[:12]
            if check is not None and data[:1] < b"\x80":
                pieces = [check.hello.encode(), *pieces]
                pieces = [_numbered(check, dialect, n, piece) for n, piece in enumerate(pieces)]
            for n, piece in enumerate(pieces):
                station.hear(piece, n * 0.001)
                station.say((n + 1) * 0.001)

        return take

    return make


def _numbered(check: object, dialect: object, number: int, piece: bytes) -> bytes:
    return (check.wrap(piece.decode("latin-1"), number) + dialect.line.end).encode("latin-1")


def _told() -> list[bytes]:
    from mopro.link import load_dialect

    made = []
    for name in ("checked", "plain"):
        s = {key: t.text for key, t in load_dialect(name).statements.items()}
        filled = {"name": "MAIN", "scratch": "MAIN", "first": "1", "milliseconds": "100"}
        lines = [s["begin"], *_PROGRAM.split("\n")[:-1], s["end"], s["run"], s["status"], s["stop"]]
        lines += [s[key] for key in s if key not in ("begin", "end", "run")]
        lines = [line.format(**filled) for line in lines]
        end = load_dialect(name).line.end
        made.append(b"\x00" + _GAP.join(line.encode() for line in lines))
        made.append(b"\x80" + _GAP.join((line + end).encode() for line in lines))
    return made


# -- an editor, a browser, a client ------------------------------------------------


def _framing(_: Path) -> Take:
    from mopro.lsp.language_server import Messages

    def take(data: bytes) -> None:
        messages = Messages(io.BytesIO(data))
        while line := messages.readline():
            if line.startswith(b"Content-Length"):
                messages.readline()
                messages.read(int(line.split()[1]))

    return take


class _Faults(logging.Handler):
    """Keeps the last exception of mopro's own code that the protocol's library has caught."""

    def __init__(self) -> None:
        super().__init__()
        self.last: BaseException | None = None

    def emit(self, record: logging.LogRecord) -> None:
        from pygls.exceptions import JsonRpcException

        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, JsonRpcException):  # an answer of the server's own
            return
        trace = error.__traceback__ if error else None
        while trace is not None:
            if "/mopro/lsp/" in trace.tb_frame.f_code.co_filename:
                self.last = error
            trace = trace.tb_next


class _Nowhere:
    def write(self, data: bytes) -> None:
        return

    def close(self) -> None:
        return


def _editor(_: Path) -> Take:
    """Bodies of messages, one a line, to the server in this process."""
    from mopro.lsp.language_server import server

    faults, protocol = _Faults(), server.protocol
    logger = logging.getLogger("pygls")
    logger.handlers, logger.propagate = [faults], False
    protocol.set_writer(_Nowhere())
    for message in MESSAGES[:2]:
        _handle(protocol, message)

    def take(data: bytes) -> None:
        faults.last = None
        for body in data.split(b"\n")[:8]:
            _handle(protocol, body)
        protocol._shutdown = False
        if faults.last is not None:
            raise faults.last

    return take


def _handle(protocol: object, body: bytes) -> None:
    """As pygls does with the body of a message."""
    if b'"exit"' in body:
        return
    try:
        protocol.handle_message(json.loads(body, object_hook=protocol.structure_message))
    except Exception:  # noqa: BLE001 (pygls catches the same, and goes on)
        return


def _message(method: str, params: object, number: int | None = None) -> bytes:
    own = {"jsonrpc": "2.0", "method": method, "params": params}
    return json.dumps(own if number is None else {**own, "id": number}).encode()


_URI = {"uri": "file:///nowhere/a.CMD"}
_AT = {"textDocument": _URI, "position": {"line": 1, "character": 5}}
_RANGE = {"start": {"line": 0, "character": 0}, "end": {"line": 3, "character": 1}}
MESSAGES = [
    _message("initialize", {"processId": None, "rootUri": None, "capabilities": {}}, 1),
    _message("initialized", {}),
    _message(
        "textDocument/didOpen",
        {
            "textDocument": {
                **_URI,
                "languageId": "mopro",
                "version": 1,
                "text": ":A\nJUMP A\nMR1 1\nVEL0 0\n",
            }
        },
    ),
    _message(
        "textDocument/didChange",
        {
            "textDocument": {**_URI, "version": 2},
            "contentChanges": [{"range": _RANGE, "text": "WT10\n"}],
        },
    ),
    *(
        _message(f"textDocument/{name}", _AT, 5)
        for name in ("hover", "definition", "completion", "prepareRename")
    ),
    _message("textDocument/references", {**_AT, "context": {"includeDeclaration": True}}, 6),
    _message("textDocument/rename", {**_AT, "newName": "B"}, 7),
    _message(
        "textDocument/codeAction",
        {"textDocument": _URI, "range": _RANGE, "context": {"diagnostics": []}},
        8,
    ),
    _message(
        "textDocument/formatting",
        {"textDocument": _URI, "options": {"tabSize": 2, "insertSpaces": True}},
        9,
    ),
    _message("textDocument/documentSymbol", {"textDocument": _URI}, 10),
    _message("textDocument/didClose", {"textDocument": _URI}),
    _message("shutdown", None, 11),
]
LSP_WORDS = (
    '"textDocument/hover"',
    '"textDocument/didOpen"',
    '"textDocument/didChange"',
    '"id": 1',
    '"line": ',
    '"character": ',
    "4294967296",
    "-1",
    "null",
    '"uri": ',
    '"file:///dev/null"',
    '"untitled:1"',
    '"text": "',
    "\\ud800",
    "\\n",
    "{",
    "}",
    "[",
    "]",
    "\n",
    '"textDocument/rename"',
    '"newName": "',
)


def _request(_: Path) -> Take:
    """A request to a live page: method, target, host, origin and body, one a line."""
    from starlette.applications import Starlette

    from mopro.controller import Station
    from mopro.emulator import Emulator
    from mopro.link import load_dialect
    from mopro.machine import load_machine
    from mopro.viewer.live import ControllerPanel
    from mopro.viewer.page_server import Page, _application

    machine = load_machine("chow1992")
    panel = ControllerPanel(Station(load_dialect("checked"), Emulator(machine)), machine)
    panel.feed.ended.set()
    acts = {"fault": panel.fault, "stop": panel.stop}
    app = _application(Page("title", panel.feed, acts), "token", 80)

    def take(data: bytes) -> None:
        asyncio.run(_answered(app, data))
        panel.tick(0.0)

    assert isinstance(app, Starlette)
    return take


async def _answered(app: object, data: bytes) -> None:
    method, target, host, origin, *rest = [*data.split(b"\n", 4), b"", b"", b"", b""]
    path, _, query = target.partition(b"?")
    headers = [(b"host", host), (b"origin", origin)]
    scope = {
        "type": "http",
        "method": method.decode("latin-1"),
        "path": path.decode("latin-1"),
        "raw_path": path,
        "query_string": query,
        "root_path": "",
        "scheme": "http",
        "headers": [(name, value) for name, value in headers if value],
        "http_version": "1.1",
    }
    body = [{"type": "http.request", "body": rest[0], "more_body": False}]

    async def receive() -> dict[str, object]:
        return body.pop() if body else {"type": "http.disconnect"}

    async def send(_: object) -> None:
        return

    await app(scope, receive, send)


def _token(_: Path) -> Take:
    from mopro.link.token import checked, statement

    def take(data: bytes) -> None:
        try:
            token = checked(data.decode("utf-8", "surrogateescape"))
        except ValueError:
            return
        if token is not None:
            statement(token)

    return take


_HOST = b"127.0.0.1:80\nhttp://127.0.0.1:80\n"
_REQUESTS = [
    b"GET\n/?token=token\n127.0.0.1:80",
    b"GET\n/feed?token=token\nlocalhost:80",
    b"POST\n/fault?token=token\n" + _HOST + b'"axis 1 loses a pitch"',
    b"POST\n/stop?token=token\n" + _HOST,
    b"POST\n/x?token=token\n" + _HOST + b"[[[]]]",
]
_LINK = ("mopro.link.session", "mopro.link.watch", "mopro.link.flash", "mopro.link.template")
_CONTROL = ("mopro.controller.protocol", "mopro.controller.device", "mopro.controller.station")

LINES = (
    *(
        Parser(f"replies, dialect {name}", _LINK, _replies(name), _talks, _REPLIES, 1, 1024)
        for name in ("checked", "plain")
    ),
    Parser(
        "reply lines",
        ("mopro.link.template",),
        _templates,
        lambda: [r.encode("latin-1") for r in _REPLIES],
        _REPLIES,
        20,
        80,
    ),
    Parser(
        "frames",
        ("mopro.link.template",),
        _frames,
        lambda: [b":12 OK*A5F0", b":0 *"],
        _REPLIES,
        30,
        80,
    ),
    *(
        Parser(
            f"controller, dialect {name}", _CONTROL, _controller(name), _told, _STATEMENTS, 1, 300
        )
        for name in ("checked", "plain")
    ),
    Parser("token", ("mopro.link.token",), _token, lambda: [b"correct-horse-battery"], (), 80, 150),
    Parser(
        "editor, framing",
        ("mopro.lsp.language_server",),
        _framing,
        lambda: [b"Content-Length: 2\r\n\r\n{}", b"content-length:3\r\nA: b\r\n\r\n[1]"],
        ("Content-Length: ", "\r\n\r\n", "99999999999", "-1"),
        20,
        400,
    ),
    Parser(
        "editor, bodies",
        ("mopro.lsp",),
        _editor,
        lambda: [*MESSAGES[2:], b"\n".join(MESSAGES[2:6])],
        LSP_WORDS,
        1,
        1024,
    ),
    Parser(
        "requests to a live page",
        ("mopro.viewer.page_server", "mopro.viewer.live"),
        _request,
        lambda: _REQUESTS,
        ("token=token", "%ff", "[", '"'),
        1,
        5000,
    ),
)
