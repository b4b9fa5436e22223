"""Guard of a page's server: it answers its own page alone, at its own address, with its token."""

from __future__ import annotations

import hmac
from collections.abc import Callable
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
