"""Who does the work makes no difference: processes here, or workers of a scheduler."""

import builtins
from types import SimpleNamespace

import pytest

from helpers.sweeps import Ended, counting, small_sweep
from mopro.errors import DataError
from mopro.sweeps import executors
from mopro.sweeps.executors import by_scheduler, local
from mopro.sweeps.results import rows_file
from mopro.sweeps.tasks import rows_of

pytest.importorskip("distributed")
from helpers import dask


@pytest.fixture(scope="module")
def whole():
    return small_sweep().run(local(1))


def test_two_workers_and_the_loss_of_one(tmp_path, whole):
    """The same table bit for bit, whoever makes it, and though a worker is killed half-way."""
    for name in ("here", "there", "lost"):
        (tmp_path / name).mkdir()
    small_sweep().run(local(1), out=tmp_path / "here" / "r.parquet")
    with dask.scheduler(tmp_path, 2) as (address, processes):
        small_sweep().run(by_scheduler(address), out=tmp_path / "there" / "r.parquet")

        def half_way(done, total):
            if done >= total / 2:
                processes[1].kill()

        out = tmp_path / "lost" / "r.parquet"
        assert small_sweep().run(by_scheduler(address), out=out, told=half_way) == whole
        assert processes[1].wait() == -9
    files = [tmp_path / name / "r.parquet" for name in ("here", "there", "lost")]
    assert len({file.read_bytes() for file in files}) == 1
    assert [path.name for path in (tmp_path / "lost").iterdir()] == ["r.parquet"]


def test_a_sweep_goes_on_elsewhere(tmp_path, whole):
    out = tmp_path / "r.csv"

    def end():
        raise Ended

    with pytest.raises(Ended):
        small_sweep().run(counting([], 9, end), out=out)
    with dask.scheduler(tmp_path, 1) as (address, _):
        assert small_sweep().run(by_scheduler(address), out=out) == whole
    assert not rows_file(out).exists()


def test_a_scheduler_that_goes_is_told_and_costs_no_row(tmp_path, whole):
    out = tmp_path / "r.csv"
    with (
        pytest.raises(DataError, match=r"connection to the scheduler at tcp://.* is lost") as lost,
        dask.scheduler(tmp_path, 1) as (address, processes),
    ):
        small_sweep().run(by_scheduler(address), out=out, told=lambda *_: processes[0].kill())
    assert "the same command goes on" in lost.value.__notes__[0]
    assert small_sweep().run(local(1), out=out) == whole


def test_the_loss_of_all_workers_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "_CONNECTED_WITHIN_S", 1.0)
    monkeypatch.setattr(executors, "_LOOKED_AFTER_S", 0.5)
    with (
        pytest.raises(DataError, match="has no workers: start some"),
        dask.scheduler(tmp_path, 1) as (address, processes),
    ):
        small_sweep().run(by_scheduler(address), told=lambda *_: processes[1].kill())


def test_no_scheduler_and_no_workers_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "_CONNECTED_WITHIN_S", 0.5)
    with pytest.raises(DataError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9: "):
        small_sweep().run(by_scheduler("tcp://127.0.0.1:9"))
    with pytest.raises(DataError, match="no scheduler answers at nowhere://x"):
        small_sweep().run(by_scheduler("nowhere://x"))
    with (
        dask.scheduler(tmp_path, 0) as (address, _),
        pytest.raises(DataError, match="has no workers: start some, `dask worker tcp://"),
    ):
        small_sweep().run(by_scheduler(address))


def test_without_the_library_it_is_said_what_to_install(monkeypatch):
    imported = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "distributed":
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        return imported(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(DataError, match=r"pip install 'mopro\[dask\]'"):
        small_sweep().run(by_scheduler("tcp://127.0.0.1:9"))


@pytest.mark.parametrize(
    ("found", "expected"),
    [("0.0.1", "the worker tcp://w has mopro 0.0.1, and this is"), (KeyError(), "has no mopro")],
)
def test_a_worker_with_another_mopro_or_none_is_told(found, expected):
    client = SimpleNamespace(run=lambda *args, on_error: {"tcp://w": found})
    with pytest.raises(DataError, match=expected):
        executors._compare_versions(client)


def test_another_version_of_mopro_gives_no_rows(monkeypatch):
    sweep = small_sweep()
    chunk = next(sweep._chunks(sweep.tasks, 1))
    monkeypatch.setattr("mopro.sweeps.tasks.version", lambda name: "0.0.1")
    with pytest.raises(DataError, match=r"a worker has mopro 0\.0\.1, and the sweep is by"):
        rows_of(chunk)
