"""Start of a browser, whose arguments every user of the computer can read."""

from __future__ import annotations

import html
import os
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

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
