"""Run `mopro ARGS` as a process, or quicker within this one; both give the same answer."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from click.testing import CliRunner

from mopro.cli import main

SETTINGS = {"COLUMNS": "160", "NO_COLOR": "1"}
# What takes longer than this hangs, however busy the computer is.
LIMIT_S = 300.0
# How often a process is looked at that announces itself by what it writes.
_LOOK_S = 0.02


def run_process(folder, *args, text=None, words=True):
    """The finished process of `mopro ARGS` in `folder`.

    `text` becomes the file P.CMD first. Where `words` is false stdout and stderr are bytes.
    """
    _write_program(folder, text)
    return subprocess.run(
        [sys.executable, "-m", "mopro", *map(str, args)], cwd=folder, env=os.environ | SETTINGS,
        capture_output=True, text=words, timeout=LIMIT_S, check=False,
    )  # fmt: skip


def run_here(folder, *args, text=None, stdin=b"", words=True):
    """As `run_process`, in this process: `returncode`, `stdout` and `stderr` of `mopro ARGS`.

    An exception that the command does not catch reaches the test. Unless `--jobs` is given
    one thing is done at a time: each worker of the tests has a core, and threads on the same
    core take a sixth longer.
    """
    _write_program(folder, text)
    heeded = signal.getsignal(signal.SIGTERM)
    arguments = ["mopro", *map(str, args)]
    code = None
    try:
        with (
            CliRunner(env=SETTINGS).isolation(input=stdin) as (out, errors, _),
            contextlib.chdir(folder),
            patch.object(sys, "argv", arguments),
            patch.object(os, "cpu_count", lambda: 1),
        ):
            try:
                main()
            except SystemExit as end:
                code = end.code
            sys.stdout.flush()
            sys.stderr.flush()
    finally:
        signal.signal(signal.SIGTERM, heeded)
    said = [stream.getvalue().decode() if words else stream.getvalue() for stream in (out, errors)]
    return SimpleNamespace(returncode=code, stdout=said[0], stderr=said[1])


def wait_for(event, process):
    """Return as soon as `event()` is true, while `process` is under way.

    AssertionError if the process ends before, or if LIMIT_S go by.
    """
    end_s = time.monotonic() + LIMIT_S
    while not event():
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_LOOK_S)
            assert event(), f"the process ended with {process.returncode} before"
            return
        assert time.monotonic() < end_s, f"nothing came about in {LIMIT_S} s"


def _write_program(folder, text):
    if text is not None:
        data = text if isinstance(text, bytes) else text.encode()
        (Path(folder) / "P.CMD").write_bytes(data)
