"""Work on several items at once, as `--jobs` asks for, with memory made sure of.

A thread that cannot begin for lack of memory leaves Python waiting for it without end. A process of
a pool waits for work without end once the one that began it is gone, and takes a signal's exception
for the answer of one item. A Python that is started as usual looks for modules in the current
folder first, where a stranger's file may be called like one of them.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from mopro.errors import DataError
from mopro.process.loading import load_elsewhere, make_sure

T = TypeVar("T")
R = TypeVar("R")

# Bytes of address space of a process's thread here: its stack, twice. Halved, it may not begin, and
# Python waits for it; doubled, more commands that had enough are refused.
_A_THREAD = 16 << 20

# What has a Python import from, or stay in, a place that the user need not have meant.
_MISLEADING = ("PYTHONPATH", "PYTHONINSPECT")
# Taken by who changes the environment in which a pool starts its processes.
_starting = threading.RLock()
# Beginning of a child: the path of its parent, and mopro itself from where the parent has it.
_BEGIN = """
import sys
own = sys.path[:]
sys.path[:] = [entry for entry in {path!r} if entry not in {here!r} or entry in own]
from importlib.util import module_from_spec, spec_from_file_location
from runpy import run_module
spec = spec_from_file_location("mopro", {init!r}, submodule_search_locations=[{folder!r}])
sys.modules["mopro"] = package = module_from_spec(spec)
spec.loader.exec_module(package)
run_module({module!r}, run_name="__main__", alter_sys=True)
"""


def run_module(
    module: str, arguments: Sequence[str], patience_s: float
) -> subprocess.CompletedProcess[bytes]:
    """The finished process of `python -m MODULE ARGUMENTS`, a module of mopro, and what it said.

    It imports what this process would, except from the current folder. Raises
    subprocess.TimeoutExpired, and ends the process, after `patience_s`.
    """
    folder = Path(__file__).parents[1]
    entries = [entry for entry in sys.path if os.path.isabs(entry)]
    begin = _BEGIN.format(
        path=entries,
        here=_of_the_current_folder(entries),
        init=str(folder / "__init__.py"),
        folder=str(folder),
        module=module,
    )
    command = [sys.executable, "-P", *_options(), "-c", begin, *arguments]
    environment = {name: text for name, text in os.environ.items() if name not in _MISLEADING}
    return subprocess.run(
        command, capture_output=True, env=environment, timeout=patience_s, check=False
    )


def _options() -> list[str]:
    """Those of this process's own options that decide what a child heeds and warns of."""
    flags = {"-E": sys.flags.ignore_environment, "-s": sys.flags.no_user_site}
    warnings = [part for option in sys.warnoptions for part in ("-W", option)]
    return [option for option, stated in flags.items() if stated] + warnings


def _of_the_current_folder(entries: Iterable[str]) -> list[str]:
    """Those of a path's absolute `entries` that stand for the current folder, or were relative."""
    stated = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    relative = {os.path.abspath(entry) for entry in stated if not os.path.isabs(entry)}
    here = os.path.realpath(os.curdir)
    return [entry for entry in entries if entry in relative or os.path.realpath(entry) == here]


@contextmanager
def _shielded() -> Iterator[None]:
    """Have each Python that is started during the block look for modules outside of this folder.

    A pool's process is told the path of this one only once it has imported what it needs for that.
    """
    with _starting:
        before = {name: os.environ.pop(name, None) for name in (*_MISLEADING, "PYTHONSAFEPATH")}
        os.environ["PYTHONSAFEPATH"] = "1"
        try:
            yield
        finally:
            del os.environ["PYTHONSAFEPATH"]
            os.environ.update({name: text for name, text in before.items() if text is not None})


def in_processes(function: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """`function` of each of `items`, in order, by `jobs` processes; by this one if that is 1.

    They end with this one, and where it ends in between. Raises MemoryError if there is no memory
    for them, and DataError if a process was ended from outside.
    """
    if jobs == 1:
        yield from map(function, items)
        return
    make_sure(jobs * _A_THREAD)
    try:
        with _Processes(jobs) as pool:
            yield from pool.map(function, items)
    except BrokenProcessPool as error:
        message = f"one of {jobs} processes was ended, as for lack of memory; try fewer --jobs"
        raise DataError(message, "no-memory") from error


class _Processes(ProcessPoolExecutor):
    """A pool whose processes end where the work is left unfinished."""

    def __init__(self, jobs: int) -> None:
        with _shielded():
            super().__init__(jobs, initializer=_prepare)
        self._others = set(multiprocessing.active_children())

    def submit(self, function: Callable[..., R], /, *args: Any, **named: Any) -> Future[R]:
        with _shielded():
            return super().submit(function, *args, **named)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool | None:
        if kind is not None:
            self.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
        return super().__exit__(kind, error, trace)


def _prepare() -> None:
    """Have a process of a pool load libraries as this one, and end by signals and with it."""
    load_elsewhere()
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a process of a pool has been begun by another one"
    parent.join()
    os._exit(1)
