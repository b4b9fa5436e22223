"""Executors of the chunks of a sweep: processes of this machine, or a scheduler's workers.

An executor applies a function to chunks and gives the results as they come, in any order; a
result may come twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from itertools import islice
from typing import Any

from mopro.errors import DataError
from mopro.process.jobs import in_processes
from mopro.sweeps.tasks import Chunk, Row

Rows = list[Row]
Executor = Callable[[Callable[[Chunk], Rows], Iterable[Chunk]], Iterator[Rows]]

_CONNECTED_WITHIN_S = 10.0
# Where nothing is done for so long, it is asked whether there are workers at all.
_LOOKED_AFTER_S = 30.0
# A result that is done comes within so long, or is lost with its worker: then the client is not
# told when it has been done again, and has to ask once more.
_FETCHED_WITHIN_S = 2.0
# Chunks that the scheduler has at once: enough for workers that come later too.
_UNDER_WAY = 256


def local(jobs: int) -> Executor:
    """An executor of `jobs` processes on this machine; one works in this process."""
    return partial(in_processes, jobs=jobs)


def by_scheduler(address: str) -> Executor:
    """The workers of the Dask scheduler at `address` (tcp://HOST:PORT).

    A worker that is lost costs what it was doing, which others do again. Raises DataError where
    there is no scheduler, no worker, or no library for it.
    """

    def run(function: Callable[[Chunk], Rows], chunks: Iterable[Chunk]) -> Iterator[Rows]:
        waiting = iter(chunks)
        with _client(address) as (client, wait):

            def begun(count: int) -> set[Any]:
                several = list(islice(waiting, count))
                names = [f"mopro-{chunk.name}" for chunk in several]
                return set(client.map(function, several, key=names)) if several else set()

            under_way = begun(_UNDER_WAY)
            while under_way:
                try:
                    with client.as_current():
                        done, under_way = wait(under_way, _LOOKED_AFTER_S, "FIRST_COMPLETED")
                except TimeoutError:
                    _await_workers(client, address)
                    continue
                for future in done:
                    yield _result(client, future, address)
                under_way |= begun(len(done))

    return run


@contextmanager
def _client(address: str) -> Iterator[tuple[Any, Any]]:
    """A client of the scheduler, and the function to wait for what it does."""
    try:
        import distributed
        from distributed.scheduler import KilledWorker, NoValidWorkerError
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("distributed", "dask"):
            raise
        raise DataError(
            "a scheduler needs more: pip install 'mopro[dask]'", "not-installed"
        ) from error
    try:
        connect: Callable[..., Any] = distributed.Client  # untyped there
        client = connect(address, timeout=_CONNECTED_WITHIN_S, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        message = f"no scheduler answers at {address}: {reason}; start one with `dask scheduler`"
        raise DataError(message, "no-scheduler") from error
    try:
        with client:
            _await_workers(client, address)
            _compare_versions(client)
            yield client, distributed.wait
    except (KilledWorker, NoValidWorkerError) as error:
        message = f"workers of {address} are ended again and again, as for lack of memory: {error}"
        raise DataError(message, "no-memory") from error
    except (CancelledError, OSError) as error:
        message = f"the connection to the scheduler at {address} is lost"
        raise DataError(message, "no-scheduler") from error


def _result(client: Any, future: Any, address: str) -> Rows:
    """The result of what is done; it is done again where its worker is lost with it."""
    while True:
        try:
            rows: Rows = future.result(timeout=_FETCHED_WITHIN_S)
        except TimeoutError:
            _await_workers(client, address)
        else:
            return rows


def _await_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_CONNECTED_WITHIN_S)
    except TimeoutError as error:
        message = f"the scheduler at {address} has no workers: start some, `dask worker {address}`"
        raise DataError(message, "no-scheduler") from error


def _compare_versions(client: Any) -> None:
    """DataError unless all workers have this mopro: one without it would end at its first task."""
    own = version("mopro")
    for worker, found in client.run(version, "mopro", on_error="return").items():
        if found != own:
            what = f"mopro {found}" if isinstance(found, str) else "no mopro"
            raise DataError(
                f"the worker {worker} has {what}, and this is {own}: install the same there",
                "other-version",
            )
