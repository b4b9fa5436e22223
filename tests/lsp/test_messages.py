"""Messages that an editor may send: the server answers on, or ends with a reason."""

import io
import json
import os
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S, SETTINGS
from mopro.lsp.language_server import MOST_BYTES, Messages

QUIT = ({"jsonrpc": "2.0", "id": 2, "method": "shutdown"}, {"jsonrpc": "2.0", "method": "exit"})
HELLO = {
    "jsonrpc": "2.0", "id": 1, "method": "initialize",
    "params": {"processId": None, "rootUri": None, "capabilities": {}},
}  # fmt: skip


def framed(message, name=b"Content-Length"):
    body = json.dumps(message).encode()
    return name + b": %d\r\n\r\n" % len(body) + body


def served(data):
    return subprocess.run(
        [sys.executable, "-m", "mopro", "lsp"], input=data, capture_output=True,
        env=os.environ | SETTINGS, timeout=LIMIT_S, check=False,
    )  # fmt: skip


def test_headers_are_passed_on_with_their_length_only():
    source = b"Content-Type: text\r\ncontent-length: 2\r\n\r\n{}Content-Length:3\r\n\r\n[1]"
    messages = Messages(io.BytesIO(source))
    assert [messages.readline(), messages.readline()] == [b"Content-Length: 2\r\n", b"\r\n"]
    assert messages.read(2) == b"{}"
    assert [messages.readline(), messages.readline()] == [b"Content-Length: 3\r\n", b"\r\n"]
    assert messages.read(3) == b"[1]"
    assert messages.readline() == b""
    assert messages.fault is None


@pytest.mark.parametrize(
    ("header", "fault"),
    [
        (b"Content-Length: -1\r\n\r\n", "a header that cannot be read: b'Content-Length: -1"),
        (b"Content-Length: 1e9\r\n\r\n", "a header that cannot be read"),
        (b"Content-Length: 0\r\n\r\n", f"a message of 0 bytes, expected 1 to {MOST_BYTES}"),
        (b"Content-Length: 9999999999\r\n\r\n", "a message of 9999999999 bytes"),
        (b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n", "a header that cannot be read"),
        (b"x" * 5000, "a header that cannot be read"),
        (b"A: b\r\n" * 100, "a header without a length"),
        (b"\r\n" * 100, "a header without a length"),
    ],
)
def test_a_header_that_says_no_length_ends_the_input_with_a_reason(header, fault):
    messages = Messages(io.BytesIO(header + framed(HELLO)))
    assert messages.readline() == b""
    assert messages.fault is not None
    assert messages.fault.startswith(fault)
    assert messages.readline() == b""


def test_a_body_that_is_cut_short_ends_the_input():
    messages = Messages(io.BytesIO(b"Content-Length: 10\r\n\r\n{}"))
    messages.readline(), messages.readline()
    assert messages.read(10) == b""


def test_the_server_ends_with_the_reason():
    done = served(framed(HELLO) + b"Content-Length: -5\r\n\r\n" + b"".join(map(framed, QUIT)))
    assert b'"id":1' in done.stdout.replace(b" ", b"")
    assert done.returncode == 2
    told = done.stderr.decode().splitlines()[-1]
    assert told.startswith("mopro: the editor sent a header that cannot be read")
    assert told.endswith("[bad-message]")


@pytest.mark.parametrize("body", [b"[" * 100_000, b"9" * 6000, b"{", b"\xff\xfe", b"null", b"[1]"])
def test_a_body_that_is_no_message_is_survived(body):
    odd = b"Content-Length: %d\r\n\r\n" % len(body) + body
    done = served(framed(HELLO) + odd + b"".join(map(framed, QUIT)))
    assert b'"id":2' in done.stdout.replace(b" ", b"")
    assert b"Traceback" not in done.stderr
    assert done.returncode == 0


def opened(text, version):
    """Diagnostics published for a text that is opened, and then given the next version."""
    document = {"uri": "file:///nowhere/a.CMD", "languageId": "mopro"}
    sent = [
        HELLO,
        {"jsonrpc": "2.0", "method": "initialized", "params": {}},
        {
            "jsonrpc": "2.0", "method": "textDocument/didOpen",
            "params": {"textDocument": {**document, "version": version, "text": text}},
        },
        {
            "jsonrpc": "2.0", "method": "textDocument/didChange",
            "params": {
                "textDocument": {"uri": document["uri"], "version": version + 1},
                "contentChanges": [{"text": "WT100\n"}],
            },
        },
        *QUIT,
    ]  # fmt: skip
    said = served(b"".join(map(framed, sent))).stdout.split(b"Content-Length: ")
    messages = [json.loads(part.partition(b"\r\n\r\n")[2]) for part in said[1:]]
    return [m["params"] for m in messages if m.get("method") == "textDocument/publishDiagnostics"]


def test_findings_carry_the_version_of_the_text_that_they_are_about():
    first, second = opened("VEL0 0\n", version=7)
    assert (first["version"], [d["code"] for d in first["diagnostics"]]) == (7, ["bad-velocity"])
    assert (second["version"], second["diagnostics"]) == (8, [])


def test_a_very_long_text_is_not_checked_at_every_key():
    first, second = opened("VEL0 0\n" * 1_000_000, version=1)
    assert [d["code"] for d in first["diagnostics"]] == ["too-long"]
    assert "more than 262144 characters" in first["diagnostics"][0]["message"]
    assert second["diagnostics"] == []
