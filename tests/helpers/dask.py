"""A Dask scheduler and its workers, as processes on the loopback."""

import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager

_QUIET = {"PYTHONWARNINGS": "ignore", "OPENBLAS_NUM_THREADS": "1"}


def _begun(stack, words, awaited, folder):
    """A process that has said `awaited` on standard error, and is ended with `stack`."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words], cwd=folder, env=os.environ | _QUIET,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    stack.enter_context(process)
    stack.callback(process.kill)
    said = []
    for line in process.stderr:
        said.append(line)
        if awaited in line:
            return process, line
    raise AssertionError(f"{words} ended: {''.join(said)}")


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
