"""Too little memory is a MemoryError, where a library would abort or go on for ever."""

import os
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S
from mopro.engine.threads import in_threads
from mopro.errors import DataError
from mopro.process.jobs import in_processes
from mopro.process.loading import make_sure

LIMITED = """
import resource
from mopro.process.loading import make_sure_on_import

def limited(work):
    size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + (4 << 20), resource.RLIM_INFINITY))
    try:
        work()
    except MemoryError:
        print("told")
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))

make_sure_on_import()
limited(lambda: __import__("numpy"))
from mopro.engine.threads import in_threads
from mopro.process.jit import njit
added = njit(lambda x: x + 1)
limited(lambda: added(1))
limited(lambda: list(in_threads(abs, [-1, -2], 2)))
print(added(1), *in_threads(abs, [-1, -2], 2))
"""


def test_what_can_be_had_is_made_sure_of():
    make_sure(1 << 20)
    with pytest.raises(MemoryError):
        make_sure(1 << 60)


def test_imports_compilations_and_threads_raise_and_succeed_later():
    """Without that numpy tries for ever, LLVM aborts, and a thread's start never returns."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "told\ntold\ntold\n2 1 2\n"), done.stderr


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("pool", [in_threads, in_processes])
def test_jobs_are_done_in_order(pool, jobs):
    assert list(pool(abs, [-3, 1, -2], jobs)) == [3, 1, 2]


def test_a_process_that_is_ended_from_outside_is_told():
    with pytest.raises(DataError, match=r"2 processes was ended.*fewer --jobs"):
        list(in_processes(os._exit, [9, 9], 2))
