"""A headless browser, driven by its own protocol over a WebSocket (Chrome DevTools Protocol)."""

import base64
import contextlib
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from websockets.sync.client import connect

LIMIT_S = 20.0
_NAMES = ("chromium", "chromium-browser", "google-chrome")
_LOOK_S = 0.02
_SWITCHES = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--hide-scrollbars", "--mute-audio", "--remote-debugging-port=0",
    "--force-color-profile=srgb",
)  # fmt: skip


def browser_path():
    """The browser's program, or None: MOPRO_BROWSER, else what is installed."""
    return os.environ.get("MOPRO_BROWSER") or next(filter(None, map(shutil.which, _NAMES)), None)


def required_browser():
    """The browser's program; without one the test is skipped, or fails where one is required."""
    path = browser_path()
    if path is None:
        reason = "no Chromium: install one, or name it in MOPRO_BROWSER"
        if os.environ.get("MOPRO_BROWSER_REQUIRED"):
            pytest.fail(reason)
        pytest.skip(reason)
    return path


@contextlib.contextmanager
def browser():
    """A running Browser; it ends with the block."""
    path = required_browser()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        process = subprocess.Popen(
            [path, *_SWITCHES, f"--user-data-dir={folder}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        try:
            with connect(
                _address(process, Path(folder)), max_size=None, close_timeout=0.2
            ) as socket:
                yield Browser(socket)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(LIMIT_S)


def _address(process, folder):
    file = folder / "DevToolsActivePort"
    end_s = time.monotonic() + LIMIT_S
    while not (file.exists() and file.read_text().count("\n") == 1):
        assert process.poll() is None, f"the browser ended with {process.returncode}"
        assert time.monotonic() < end_s, "the browser did not start"
        time.sleep(_LOOK_S)
    port, path = file.read_text().split("\n")
    return f"ws://127.0.0.1:{port}{path}"


class Browser:
    """Sends commands and keeps events, by the tab that they come from."""

    def __init__(self, socket):
        self._socket = socket
        self._last = 0
        self.events = {}

    def call(self, method, session=None, **arguments):
        """The result of a command; AssertionError if the browser refuses it."""
        self._last += 1
        message = {"id": self._last, "method": method, "params": arguments}
        self._socket.send(json.dumps(message | ({"sessionId": session} if session else {})))
        while True:
            answer = json.loads(self._socket.recv(LIMIT_S))
            if answer.get("id") == self._last:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            self.events.setdefault(answer.get("sessionId"), []).append(answer)

    def open(self, address, width=1280, height=900, dark=False):
        """The page at `address` in a tab of its own, loaded."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session, target)
        for domain in ("Page", "Runtime", "Log", "Network"):
            page.call(f"{domain}.enable")
        page.size(width, height)
        if dark:
            feature = {"name": "prefers-color-scheme", "value": "dark"}
            page.call("Emulation.setEmulatedMedia", features=[feature])
        begun_s = time.monotonic()
        page.call("Page.navigate", url=str(address))
        page.until("document.documentElement?.dataset.ready === 'yes'")
        page.opened_s = time.monotonic() - begun_s
        return page


class Page:
    """One tab: what it says, asks for and shows; keys and the mouse."""

    def __init__(self, browser, session, target):
        self.browser, self.session, self.target = browser, session, target

    def call(self, method, **arguments):
        return self.browser.call(method, self.session, **arguments)

    def value(self, script):
        """The value of an expression, awaited if it is a promise."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, script):
        """Return as soon as the expression is true; AssertionError after LIMIT_S."""
        end_s = time.monotonic() + LIMIT_S
        while not self.value(script):
            assert time.monotonic() < end_s, f"never true: {script}; {self.complaints()}"
            time.sleep(_LOOK_S)

    def size(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=False)  # fmt: skip

    def complaints(self):
        """Errors and warnings on the console, and exceptions that nothing caught."""
        kinds = {"Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"}
        return [e for e in self._events() if e["method"] in kinds]

    def requests(self):
        """Addresses that the page asked for, besides its own and what is in itself."""
        sent = [e for e in self._events() if e["method"] == "Network.requestWillBeSent"]
        urls = [e["params"]["request"]["url"] for e in sent]
        return [url for url in urls[1:] if not url.startswith(("data:", "blob:"))]

    def _events(self):
        self.value("0")
        return self.browser.events.get(self.session, [])

    def place(self, selector, across=0.5, down=0.5):
        """Place of an element on the screen, after scrolling to it."""
        return self.value(
            f"""(() => {{ const e = document.querySelector({json.dumps(selector)});
            e.scrollIntoView({{block: "center"}}); const r = e.getBoundingClientRect();
            return [r.left + r.width * {across}, r.top + r.height * {down}]; }})()"""
        )

    def mouse(self, kind, x, y, **more):
        # A tab behind another one takes seconds to hear of the mouse.
        self.call("Page.bringToFront")
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def move(self, selector, across=0.5, down=0.5):
        self.mouse("mouseMoved", *self.place(selector, across, down))

    def click(self, selector):
        x, y = self.place(selector)
        held = {"button": "left", "clickCount": 1}
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, **held)
        self.mouse("mouseReleased", x, y, **held)

    def drag(self, selector, across, to):
        (x, y), (x_to, _) = self.place(selector, across), self.place(selector, to)
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, button="left", clickCount=1)
        self.mouse("mouseMoved", (x + x_to) / 2, y, button="left", buttons=1)
        self.mouse("mouseMoved", x_to, y, button="left", buttons=1)
        self.mouse("mouseReleased", x_to, y, button="left", clickCount=1)

    def key(self, key, code=None):
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key,
                      **(text if kind == "keyDown" else {}))  # fmt: skip

    def picture(self, path, whole=False):
        """Write what is seen as a PNG."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]
        Path(path).write_bytes(base64.b64decode(data))

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)
