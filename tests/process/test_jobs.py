"""Processes of `--jobs` end with the command, however that ends."""

import os
import select
import signal
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S

# Two processes that tell their number and never return, under a command that heeds signals.
WORK = """
import os, signal, sys
from mopro.cli.main import _heed_signals
from mopro.process.jobs import in_processes

def forever(item):
    os.write(1, f"{os.getpid()}\\n".encode())
    while True:
        signal.pause()

_heed_signals()
list(in_processes(forever, range(8), 2))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_no_process_outlives_the_command(number):
    """Each waited for work for ever, or took the signal for the answer of one item."""
    command = [sys.executable, "-c", WORK]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as made:
        assert made.stdout is not None
        watched = [os.pidfd_open(int(made.stdout.readline())) for _ in range(2)]
        try:
            made.send_signal(number)
            assert made.wait(LIMIT_S) != 0
            for process in watched:
                assert select.select([process], [], [], LIMIT_S)[0]
        finally:
            for process in watched:
                if not select.select([process], [], [], 0)[0]:
                    signal.pidfd_send_signal(process, signal.SIGKILL)
                os.close(process)
            made.kill()


def test_a_signal_to_a_process_of_the_pool_ends_it():
    with subprocess.Popen(
        [sys.executable, "-c", WORK], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as made:
        assert made.stdout is not None
        assert made.stderr is not None
        os.kill(int(made.stdout.readline()), signal.SIGTERM)
        assert made.wait(LIMIT_S) == 1
        assert "2 processes was ended" in made.stderr.read()
