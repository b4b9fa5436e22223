"""Compiled kernels in the user's cache: made once for all processes, never in the way."""

import hashlib
import importlib.util
import math
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import mopro
from mopro.effects import Active, Domain, Effect, Parameter, catalogue
from mopro.plant.assembly import Layout, assemble
from mopro.plant.kept import module_text, term_text

BODY = "UU012500/1\nVEL1 15.0\nACC1 50.0\nMRI1 0.1\nWX1\n"
SCRIPT = f"""
import hashlib, mopro
from mopro.plant.assembly import Layout, assemble
from mopro.effects import Active, catalogue
effects = {{"quadratic_drag": {{"c": 5.0}}}}
run = mopro.emulate(mopro.compile({BODY!r}), effects=effects, compiled=True)
layout = Layout.of([Active(catalogue()[n], (1.0,), (1,)) for n in effects])
stats = assemble(layout, True).integrate.stats
bits = hashlib.sha256(run["position_1_m"].tobytes() + run["force_1_N"].tobytes()).hexdigest()
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), bits)
"""


def start(home):
    environment = os.environ | {"XDG_CACHE_HOME": str(home)}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", SCRIPT]
    return subprocess.Popen(
        command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def answer(process):
    """Kernels found in the cache, kernels compiled, and a hash of the motion's bits."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    hits, misses, bits = out.split()
    return int(hits), int(misses), bits


@pytest.fixture(scope="module")
def plain_bits():
    effects = {"quadratic_drag": {"c": 5.0}}
    run = mopro.emulate(mopro.compile(BODY), effects=effects, compiled=False)
    joined = run["position_1_m"].tobytes() + run["force_1_N"].tobytes()
    return hashlib.sha256(joined).hexdigest()


@pytest.fixture(scope="module")
def warm(tmp_path_factory, plain_bits):
    """A cache that one process has filled."""
    home = tmp_path_factory.mktemp("warm")
    assert answer(start(home)) == (0, 1, plain_bits)
    return home


def test_the_second_process_finds_what_the_first_compiled(warm, plain_bits):
    assert answer(start(warm)) == (1, 0, plain_bits)


def test_two_at_once_do_not_trip_over_each_other(tmp_path, plain_bits):
    both = [start(tmp_path), start(tmp_path)]
    assert [answer(process)[2] for process in both] == [plain_bits, plain_bits]
    assert answer(start(tmp_path)) == (1, 0, plain_bits)


@pytest.mark.parametrize(
    "damage",
    [{"nbi": b"", "py": b"raise SystemExit"}, {"nbi": b"junk \x00\x80"}, {"nbc": b"junk \x00\x80"}],
)
def test_damaged_files_are_replaced(warm, tmp_path, plain_bits, damage):
    home = tmp_path / "cache"
    shutil.copytree(warm, home)
    for kind, content in damage.items():
        (victim,) = home.rglob(f"mopro_kernel*.{kind}")
        victim.write_bytes(content)
    assert answer(start(home)) == (0, 1, plain_bits)
    assert answer(start(home)) == (1, 0, plain_bits)


def test_without_a_folder_it_compiles_in_memory(tmp_path, plain_bits):
    (tmp_path / "file").write_text("")
    assert answer(start(tmp_path / "file")) == (0, 1, plain_bits)


def test_where_numba_can_keep_nothing_it_compiles_in_memory(tmp_path, plain_bits):
    (tmp_path / "mopro" / "kernels").mkdir(parents=True)
    (tmp_path / "mopro" / "kernels" / "__pycache__").write_text("")
    (tmp_path / "numba").write_text("")
    assert answer(start(tmp_path))[2] == plain_bits


def of(effect):
    return Layout.of([Active(effect, tuple(p.default for p in effect.parameters), (1, 2))])


def test_every_term_of_the_catalogue_has_a_text():
    for effect in catalogue().values():
        assert module_text(of(effect)) is not None, effect.name


def test_the_file_names_whatever_it_was_made_of():
    texts = [module_text(of(catalogue()[n])) for n in ("viscous_drag", "quadratic_drag")]
    assert texts[0] != texts[1]
    assert "numba" in texts[0].splitlines()[0]


LEVEL = 3.0


def with_a_global(x, v):
    return LEVEL * v


def with_a_default(x, v, b=2.0):
    return b * v


def closed_over(level):
    def term(x, v):
        return level * v

    return term


def test_what_needs_more_than_its_arguments_and_math_is_not_written_down():
    for term in (with_a_global, with_a_default, closed_over(2.0), abs, lambda x, v: v):
        assert term_text(term, "force0") is None


def test_a_file_changed_since_it_was_imported_is_not_believed(tmp_path):
    file = tmp_path / "changing.py"
    file.write_text("def term(x, v):\n    return 1.5 * v\n")
    spec = importlib.util.spec_from_file_location("changing", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert "1.5 * v" in term_text(module.term, "force0")
    file.write_text("def term(x, v):\n    return 2.5 * v  # later\n")
    assert term_text(module.term, "force0") is None


class Nowhere(Effect):
    """F = -b v whose text is nowhere. Source: test."""

    name = "nowhere"
    domain = Domain.DYNAMICS
    parameters = (Parameter("b", "N s/m", "drag", 5.0, (1, 10), 0, 50, "drag"),)
    force = staticmethod(eval("lambda x, v, b: -b * v", {"math": math}))


def test_a_term_without_a_text_is_compiled_in_memory():
    layout = of(Nowhere())
    assert module_text(layout) is None
    assert assemble(layout, True).integrate is not assemble(layout, False).integrate


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
