"""Compiled kernels in the user's cache: made once for all processes, never in the way."""

import hashlib
import math
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

import mopro
from helpers.commands import LIMIT_S
from mopro.effects import Active, Domain, Effect, Parameter, catalogue
from mopro.plant.kernel import cache
from mopro.plant.kernel.build import kernel
from mopro.plant.kernel.cache import KernelCache, UnknownCodeError, fingerprint
from mopro.plant.kernel.effect_terms import TermSet

BODY = "UU012500/1\nVEL1 15.0\nACC1 50.0\nMRI1 0.1\nWX1\n"
SCRIPT = f"""
import hashlib, sys, mopro
from mopro.effects import Active, catalogue
from mopro.plant.kernel.build import kernel
from mopro.plant.kernel.effect_terms import TermSet
for name in sys.argv[1:]:
    run = mopro.emulate(mopro.compile({BODY!r}), effects={{name: {{}}}}, compiled=True)
    terms = TermSet.of([Active(catalogue()[name], (), (1,))])
    stats = kernel(terms, False, True).stats
    bits = hashlib.sha256(run["position_1_m"].tobytes() + run["force_1_N"].tobytes()).hexdigest()
    print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), bits)
"""
DRAG, SQUARED = "viscous_drag", "quadratic_drag"


def start(home, *names):
    environment = os.environ | {"XDG_CACHE_HOME": str(home)}
    command = [sys.executable, "-c", SCRIPT, *(names or (SQUARED,))]
    return subprocess.Popen(
        command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def answers(process):
    """For each set: kernels found in the cache, kernels compiled, a hash of the motion's bits."""
    out, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0, err
    lines = [line.split() for line in out.splitlines()]
    return [(int(hits), int(misses), bits) for hits, misses, bits in lines]


def plain(name):
    run = mopro.emulate(mopro.compile(BODY), effects={name: {}}, compiled=False)
    return hashlib.sha256(run["position_1_m"].tobytes() + run["force_1_N"].tobytes()).hexdigest()


@pytest.fixture(scope="module")
def bits():
    return plain(SQUARED)


@pytest.fixture(scope="module")
def warm(tmp_path_factory, bits):
    """A cache that one process has filled."""
    home = tmp_path_factory.mktemp("warm")
    assert answers(start(home)) == [(0, 1, bits)]
    return home


@pytest.fixture
def copied(warm, tmp_path):
    home = tmp_path / "cache"
    shutil.copytree(warm, home)
    return home


def test_the_second_process_finds_what_the_first_compiled(warm, bits):
    assert answers(start(warm)) == [(1, 0, bits)]


def test_kernels_of_two_processes_run_beside_each_other(copied, bits):
    """numba numbers its symbols anew in each process."""
    assert answers(start(copied, DRAG)) == [(0, 1, plain(DRAG))]
    assert answers(start(copied, DRAG, SQUARED)) == [(1, 0, plain(DRAG)), (1, 0, bits)]


def test_two_at_once_do_not_trip_over_each_other(tmp_path, bits):
    both = [start(tmp_path), start(tmp_path)]
    assert [answers(process)[0][2] for process in both] == [bits, bits]
    assert answers(start(tmp_path)) == [(1, 0, bits)]


def flipped(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize(
    "damage",
    [lambda c: b"", lambda c: c[:-100], lambda c: c[:40], flipped, lambda c: b"junk \x00\x80"],
    ids=["empty", "truncated", "no digest", "one bit", "foreign"],
)
def test_a_damaged_file_is_as_good_as_none(tmp_path, monkeypatch, damage):
    monkeypatch.setattr(cache, "rebuild", lambda context, *parts: parts)
    kept = KernelCache(tmp_path / "x.kernel", "key")
    kept.save_overload(None, SimpleNamespace(_reduce=lambda: ("what", "numba", "makes") * 100))
    assert kept.load_overload(None, Mock()) == ("what", "numba", "makes") * 100
    (tmp_path / "x.kernel").write_bytes(damage((tmp_path / "x.kernel").read_bytes()))
    assert kept.load_overload(None, Mock()) is None


def test_a_damaged_file_is_replaced(copied, bits):
    (victim,) = copied.rglob("*.kernel")
    victim.write_bytes(flipped(victim.read_bytes()))
    assert answers(start(copied)) == [(0, 1, bits)]
    assert answers(start(copied)) == [(1, 0, bits)]


def test_a_sound_file_of_another_kernel_is_not_taken(copied, bits):
    (squared,) = copied.rglob("*.kernel")
    answers(start(copied, DRAG))
    (drag,) = set(copied.rglob("*.kernel")) - {squared}
    squared.write_bytes(drag.read_bytes())
    assert answers(start(copied)) == [(0, 1, bits)]


@pytest.mark.parametrize("place", ["mopro", "mopro/kernels"])
def test_where_nothing_can_be_kept_it_compiles_in_memory(tmp_path, bits, place):
    file = tmp_path / place
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("")
    assert answers(start(tmp_path)) == [(0, 1, bits)]


# -- what a kernel depends on ---------------------------------------------------


def integrate_of(term):
    kind = type("Of", (Effect,), {"name": "of", "parameters": (), "force": staticmethod(term)})
    return kernel(TermSet((kind(),)), False, False)


LEVEL = 3.0


def with_a_global(x, v):
    return LEVEL * v


def with_a_default(x, v, b=2.0):
    return b * v


def closed_over(level):
    def term(x, v):
        return level * v

    return term


def test_the_fingerprint_tells_all_that_a_term_depends_on(monkeypatch):
    terms = [
        with_a_global, with_a_default, closed_over(2.0), closed_over(2.5), lambda x, v: v,
        lambda x, v: -v, lambda x, v: math.sin(v), lambda x, v: math.cos(v), lambda x, v: abs(v),
    ]  # fmt: skip
    seen = [fingerprint(integrate_of(term)) for term in terms]
    assert len(set(seen)) == len(terms)
    assert seen[2] == fingerprint(integrate_of(closed_over(2.0)))
    monkeypatch.setattr(sys.modules[__name__], "LEVEL", 4.0)
    assert fingerprint(integrate_of(with_a_global)) != seen[0]


def test_what_cannot_be_told_has_no_fingerprint():
    for term in (closed_over(np.ones(2)), closed_over(object()), lambda x, v: np.sin(v)):
        with pytest.raises(UnknownCodeError):
            fingerprint(integrate_of(term))


def test_every_kernel_of_the_catalogue_has_a_fingerprint_of_its_own():
    sets = [TermSet.of([Active(effect, (), (1,))]) for effect in catalogue().values()]
    sets = [terms for terms in sets if terms.effects]
    assert len(sets) > 10
    assert len({fingerprint(kernel(terms, False, False)) for terms in sets}) == len(sets)


class Unknown(Effect):
    """F = -b v by a term that nothing is known of but that it compiles. Source: test."""

    name = "unknown"
    domain = Domain.DYNAMICS
    parameters = (Parameter("b", "N s/m", "drag", 5.0, (1, 10), 0, 50, "drag"),)
    force = staticmethod(lambda x, v, b: -b * v * SIGNS[0])


SIGNS = np.ones(1)


def test_a_term_that_cannot_be_told_is_compiled_in_memory(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    terms = TermSet((Unknown(),))
    assert kernel(terms, False, True).stats.cache_misses
    assert not list(tmp_path.rglob("*.kernel"))


def test_runs_go_in_threads():
    program = mopro.compile(BODY)

    def position(b):
        run = mopro.emulate(program, effects={"viscous_drag": {"b": b}}, compiled=True)
        return run["position_1_m"]

    alone = [position(b) for b in (1.0, 2.0, 3.0, 4.0)]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(position, (1.0, 2.0, 3.0, 4.0)))
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one, other)
