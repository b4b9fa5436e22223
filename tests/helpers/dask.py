"""A Dask scheduler and its workers, as processes on the loopback."""

import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from itertools import count

from helpers.commands import wait_for

_QUIET = {"PYTHONWARNINGS": "ignore", "OPENBLAS_NUM_THREADS": "1"}
_NUMBERS = count()


def _begun(stack, words, awaited, folder):
    """A process that has said `awaited`, with that line; it is ended with `stack`.

    What it says goes to a file: a pipe that nobody reads any more would stop it.
    """
    said = folder / f"said{next(_NUMBERS)}"
    with open(said, "wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", *words], cwd=folder, env=os.environ | _QUIET,
            stdout=subprocess.DEVNULL, stderr=log,
        )  # fmt: skip
    stack.enter_context(process)
    stack.callback(process.kill)

    def line():
        lines = said.read_text("utf-8", "replace").splitlines(keepends=True)
        return next((x for x in lines if awaited in x and x.endswith("\n")), None)

    wait_for(line, process)
    return process, line()


@contextmanager
def scheduler(folder, workers):
    """The address of a scheduler with so many workers; then its process, and theirs."""
    with ExitStack() as stack:
        words = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
        first, line = _begun(stack, [*words, "--no-dashboard"], "Scheduler at:", folder)
        address = line.rpartition(" ")[2].strip()
        words = ["distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
        words += ["--no-dashboard", "--host", "127.0.0.1"]
        others = [_begun(stack, words, "Registered to:", folder)[0] for _ in range(workers)]
        yield address, [first, *others]
