"""The server of a live page, its guard, and the way of a browser to it."""

from __future__ import annotations

import asyncio
import hmac
import html
import os
import secrets
import socket
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import parse_qs

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from mopro.errors import MoproError
from mopro.viewer.live import Feed, Numbered
from mopro.viewer.page import document

# -- the guard --------------------------------------------------------------------------------
# Guard of a page's server: it answers its own page alone, at its own address, with its token.


_SAFE = ("GET", "HEAD")
_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Guard:
    """Refuses requests of other hosts' names, of other sites, and without the token.

    `port` gives the port that the server listens at. The name of the host is checked because a
    foreign site may have its own name point to this computer; the site, because a foreign page
    can send requests here. To the page itself it may lead with its token, as the file does that the
    browser is started with.
    """

    def __init__(self, app: ASGIApp, token: str, port: Callable[[], int]) -> None:
        self._app = app
        self._token = token.encode()
        self._port = port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = self.refusal(scope)
        app = self._app if refusal is None else PlainTextResponse(f"{refusal}\n", 403)
        await app(scope, receive, _with_headers(send))

    def refusal(self, scope: Scope) -> str | None:
        """Why a request is refused; None for one that is answered."""
        headers = Headers(scope=scope)
        hosts = [f"{name}:{self._port()}" for name in ("127.0.0.1", "localhost")]
        if headers.get("host") not in hosts:
            return "this server answers under its own address only"
        origin = headers.get("origin")
        if origin is None and scope["method"] not in _SAFE:
            return "a request without an origin"
        if origin is not None and origin not in [f"http://{host}" for host in hosts]:
            return "a request of another site"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and not (
            scope["path"] == "/" and headers.get("sec-fetch-dest") == "document"
        ):
            return "a request of another site"
        stated = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if not hmac.compare_digest(stated.encode(), self._token):
            return "the token is missing or wrong: use the address as it was printed"
        return None


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message["headers"], *_HEADERS]
        await send(message)

    return sending


# -- the way of a browser ---------------------------------------------------------------------
# Start of a browser, whose arguments every user of the computer can read.

_PAGE = """<!doctype html>
<meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>mopro</title><p><a href="{address}">The page of the run</a></p>
"""


@contextmanager
def in_browser(address: str) -> Iterator[None]:
    """Open `address`, which holds a token, in a browser; the block goes on without waiting.

    The browser gets the name of a file that only this user can read, and that leads there. The
    file is there during the block. Without a place for it no browser is opened.
    """
    try:
        private = TemporaryDirectory(prefix="mopro-", ignore_cleanup_errors=True)
    except OSError:
        yield
        return
    with private as folder:
        file = Path(folder) / "page.html"
        with open(file, "x", encoding="utf-8", opener=_for_me) as page:
            page.write(_PAGE.format(address=html.escape(address)))
        webbrowser.open(file.as_uri())
        yield


def _for_me(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


# -- the server -------------------------------------------------------------------------------
# The server of a live page: a thread beside the run, on loopback.

_HOST = "127.0.0.1"
# How often a page is told what is new, and how long the last message may take to reach it.
_TOLD_S = 0.05
_FAREWELL_S = 2.0
_STARTED_S = 10.0
_MOST_BODY = 4096
# Connections at once, and how long one may take for a request.
MOST_CONNECTIONS = 32
PATIENCE_S = 10.0

Act = Callable[[str], None]


@dataclass(frozen=True)
class Page:
    """A live page: its title, its feed, and what its buttons do.

    `acts` are called in the server's thread with the text of the request's body. `options` are
    told to the page's scripts.
    """

    title: str
    feed: Feed
    acts: Mapping[str, Act]
    options: Mapping[str, Any] = field(default_factory=dict)


@contextmanager
def serving(page: Page) -> Iterator[str]:
    """Serve `page` during the block, whose value is its address with the token.

    MoproError if no port can be had. At the end a page that looks is told the last message.
    """
    token = secrets.token_urlsafe(24)
    try:
        listening = socket.create_server((_HOST, 0))
    except OSError as error:
        raise MoproError(f"no page can be served on {_HOST}: {error}", "no-port") from error
    port = listening.getsockname()[1]
    server = _Server(_config(_application(page, token, port)))
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    try:
        server.began.wait(_STARTED_S)
        yield f"http://{_HOST}:{port}/?token={token}"
    finally:
        page.feed.ended.set()
        server.should_exit = True
        thread.join(_FAREWELL_S + 1.0)
        listening.close()


class _Server(uvicorn.Server):
    """A server that says when it answers."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.began = threading.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.began.set()


class _Bounded(H11Protocol):
    """A connection that has to make room for another one, or is closed if it asks for nothing."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._since_s = self.loop.time()
        self.loop.call_later(PATIENCE_S, self._give_up)
        if len(self.connections) > MOST_CONNECTIONS:
            known = [other for other in self.connections if isinstance(other, _Bounded)]
            idle = [other for other in known if other is not self and not other._is_answering]
            min(idle, key=lambda other: other._since_s, default=self)._turn_away()

    @property
    def _is_answering(self) -> bool:
        """True while a request that has come as a whole is answered, such as for the feed."""
        cycle = self.cycle
        return cycle is not None and not cycle.more_body and not cycle.response_complete

    def _turn_away(self) -> None:
        self.connections.discard(self)
        self.transport.write(_BUSY)
        self.transport.close()

    def _give_up(self) -> None:
        if not self._is_answering:
            self.transport.close()


_BUSY = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 5\r\n\r\nbusy\n"


def _config(app: Starlette) -> uvicorn.Config:
    return uvicorn.Config(
        app, log_config=None, access_log=False, lifespan="off", ws="none", loop="asyncio",
        http=_Bounded, server_header=False, timeout_graceful_shutdown=int(_FAREWELL_S),
    )  # fmt: skip


def _application(page: Page, token: str, port: int) -> Starlette:
    async def whole(request: Request) -> Response:
        live = {**page.options, "feed": f"feed?token={token}", "token": token}
        return HTMLResponse(document(page.title, [], [], [], {"live": live}, connect="'self'"))

    async def feed(request: Request) -> Response:
        return StreamingResponse(_events(page.feed), media_type="text/event-stream")

    async def act(request: Request) -> Response:
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > _MOST_BODY:
                    return Response(status_code=413)
        except ClientDisconnect:  # half a request does nothing
            return Response(status_code=400)
        does = page.acts.get(request.path_params["name"])
        if does is None:
            return Response(status_code=404)
        does(body.decode("utf-8", "replace"))
        return Response(status_code=204)

    acts = [Route("/{name:str}", act, methods=["POST"])] if page.acts else []
    return Starlette(
        routes=[Route("/", whole), Route("/feed", feed), *acts],
        middleware=[Middleware(Guard, token=token, port=lambda: port)],
    )


async def _events(feed: Feed) -> AsyncIterator[str]:
    """The messages of a feed as server-sent events, until it has ended."""
    begun = feed.begin()
    last = begun[0]
    yield _event(begun)
    while True:
        ended = feed.ended.is_set()
        for message in feed.after(last):
            last = message[0]
            yield _event(message)
        if ended:
            return
        await asyncio.sleep(_TOLD_S)


def _event(message: Numbered) -> str:
    number, event, data = message
    return f"id: {number}\nevent: {event}\ndata: {data}\n\n"
