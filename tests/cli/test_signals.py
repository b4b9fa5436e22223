"""A signal ends a command in order, also where Python itself would lose it."""

import functools
import signal
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S

COMMAND = """
import ctypes, os, signal, sys, threading
import click
from mopro.cli import main
from mopro.cli.main import COMMANDS

TEXT = "os.kill(os.getpid(), signal.{name})\\nfor _ in range(100): pass"

@ctypes.CFUNCTYPE(None)
def callback():
    exec(TEXT, globals())

@click.command()
def command():
    {body}
    threading.Event().wait({limit})

COMMANDS["slip"] = "slip:command"
if __name__ == "__main__":
    sys.argv[1:] = ["slip"]
    main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("body", ["exec(TEXT, globals())", "callback()"])
def test_a_signal_is_neither_lost_nor_told_as_another(tmp_path, name, body):
    """Within the text of an `exec`, and within a library's callback, which cannot raise."""
    (tmp_path / "slip.py").write_text(COMMAND.format(name=name, body=body, limit=LIMIT_S))
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    done = subprocess.run(
        [sys.executable, "-m", "slip"],
        cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT_S, preexec_fn=heed,
    )  # fmt: skip
    assert (done.returncode, done.stderr.strip()) == (130, "mopro: interrupted")
