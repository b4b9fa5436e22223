"""A sweep from one end to the other: kept as it comes, gone on with, never mixed with another."""

import subprocess
import sys
import zlib

import pyarrow.parquet
import pytest

import mopro
from helpers.paths import TESTS
from helpers.sweeps import TEXT, VARY, Ended, counting, small_sweep, twice
from mopro.errors import DataError
from mopro.sweeps.executors import local
from mopro.sweeps.results import rows_file
from mopro.sweeps.targets import VaryError

COUNT = 11 * 3 * 2


@pytest.fixture(scope="module")
def whole():
    """The table of the sweep, made in one go."""
    return small_sweep().run(local(1))


def stopped(out, after=20):
    """A run of the sweep that ends after so many chunks; how many rows it kept."""

    def end():
        raise Ended

    with pytest.raises(Ended):
        small_sweep().run(counting([], after, end), out=out)
    return len(rows_file(out).read_bytes().splitlines())


def test_a_row_for_each_point_in_their_order(whole):
    assert whole.num_rows == COUNT
    assert whole["point"].to_pylist() == list(range(COUNT))
    assert len(set(whole["task"].to_pylist())) == COUNT
    first = whole.slice(0, 1).to_pylist()[0]
    assert (first["VEL1_in_s"], first["ACC1_1000_in_s2"], first["payload_lb"]) == (10, 0.5, 0)
    assert set(whole["outcome"].to_pylist()) == {"ok", "stalled"}


def test_a_row_is_that_of_such_a_program(whole):
    """The same as a text that a person has changed."""
    row = whole.to_pylist()[-1]
    text = TEXT.replace("VEL1 10.0", "VEL1 60").replace("ACC1 0.5", "ACC1 3")
    run = mopro.emulate(mopro.compile(text), payload_kg=5 * 0.45359237, settle_s=0.5).run
    assert (row["time_s"], row["stall_line"]) == (run.duration_s, run.stalls[0].line)
    assert row["force_margin"] == run.moves[0].stall_margin


@pytest.mark.parametrize("name", ["r.csv", "r.parquet"])
def test_the_file_holds_the_table(tmp_path, whole, name):
    out = tmp_path / name
    assert small_sweep().run(local(1), out=out) == whole
    assert [path.name for path in tmp_path.iterdir()] == [name]
    again = counting(points := [])
    assert small_sweep().run(again, out=out) == whole
    assert points == []


def test_several_processes_give_the_same_bits(tmp_path, whole):
    for jobs in (1, 2):
        small_sweep().run(local(jobs), jobs, tmp_path / f"{jobs}.parquet")
    assert (tmp_path / "1.parquet").read_bytes() == (tmp_path / "2.parquet").read_bytes()
    assert pyarrow.parquet.read_table(tmp_path / "2.parquet") == whole


def test_results_that_come_twice_and_in_another_order_count_once(tmp_path, whole):
    assert small_sweep().run(twice, out=tmp_path / "r.csv") == whole


def test_it_goes_on_after_a_kill(tmp_path, whole):
    out = tmp_path / "r.parquet"
    killed = subprocess.run(
        [sys.executable, "-m", "helpers.sweeps", str(out)],
        cwd=TESTS, capture_output=True, check=False,
    )  # fmt: skip
    assert killed.returncode == -9, killed.stderr
    assert not out.exists()
    kept = len(rows_file(out).read_bytes().splitlines())
    assert 0 < kept < COUNT
    assert small_sweep().run(counting(points := []), out=out) == whole
    assert points == list(range(kept, COUNT))
    assert not rows_file(out).exists()


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:-9],
        lambda data: data + b"00000000 [1,",
        lambda data: data + b"\0" * 5000,
        lambda data: data[:-40] + b"7" + data[-39:],
    ],
    ids=["cut", "begun", "zeros", "changed"],
)
def test_a_row_that_is_not_whole_is_worked_out_again(tmp_path, whole, damage):
    out = tmp_path / "r.csv"
    kept = stopped(out)
    rows_file(out).write_bytes(damage(rows_file(out).read_bytes()))
    assert small_sweep().run(counting(points := []), out=out) == whole
    assert len(points) in (COUNT - kept, COUNT - kept + 1)


def test_all_rows_without_their_table_become_it(tmp_path, whole):
    """As after a kill between the last row and the table."""
    out = tmp_path / "r.csv"
    stopped(out, after=COUNT)
    sweep = small_sweep()
    rows = rows_file(out).read_bytes()
    sweep.run(local(1), out=out)
    out.unlink()
    rows_file(out).write_bytes(rows)
    assert sweep.run(local(1), out=out) == whole


OTHERS = {
    "other values": small_sweep(VARY | {"VEL1": "10:60:10"}),
    "other units": small_sweep(VARY | {"payload": "0,5kg"}),
    "another program": small_sweep(text=TEXT.replace("0.2", "0.3")),
    "another order": small_sweep(dict(reversed(VARY.items()))),
}


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_results_of_another_sweep_are_refused(tmp_path, name, form):
    out = tmp_path / f"r.{form}"
    small_sweep({"VEL1": "10,20"}).run(local(1), out=out)
    data = out.read_bytes()
    with pytest.raises(DataError, match="is not the results of this sweep; choose another name"):
        OTHERS[name].run(local(1), out=out)
    assert out.read_bytes() == data


@pytest.mark.parametrize("name", OTHERS)
def test_rows_of_another_sweep_are_refused(tmp_path, name):
    out = tmp_path / "r.csv"
    stopped(out)
    data = rows_file(out).read_bytes()
    with pytest.raises(DataError, match="rows of another sweep"):
        OTHERS[name].run(local(1), out=out)
    assert rows_file(out).read_bytes() == data


@pytest.mark.parametrize("data", [b"x", b"a,b\n1,2\n", b"PAR1" + bytes(40) + b"PAR1", b"\xff\xfe"])
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_another_file_stays(tmp_path, data, form):
    out = tmp_path / f"r.{form}"
    out.write_bytes(data)
    with pytest.raises(DataError, match="is there, and is not the results"):
        small_sweep().run(local(1), out=out)
    assert out.read_bytes() == data


STRANGE = [b"[0,1]", b"[-1]", b'[7,"a"]']


@pytest.mark.parametrize(
    "line", [*STRANGE, b"[]", b"[1e999]", b'["a"]', b"[" * 3000, b"7", b"\xff"]
)
def test_a_strange_row_is_no_row(tmp_path, line):
    out = tmp_path / "r.csv"
    rows_file(out).write_bytes(b"%08x %s\n" % (zlib.crc32(line), line))
    sweep = small_sweep({"VEL1": "10,20"})
    if line in STRANGE:
        with pytest.raises(DataError, match="rows of another sweep"):
            sweep.run(local(1), out=out)
    else:
        assert sweep.run(local(1), out=out).num_rows == 2


def test_rows_that_are_too_many_are_not_read(tmp_path):
    out = tmp_path / "r.csv"
    rows_file(out).write_bytes(bytes(50_000))
    with pytest.raises(DataError, match="longer than these results can be"):
        small_sweep({"VEL1": "10,20"}).run(local(1), out=out)


def test_two_processes_do_not_work_on_one_sweep(tmp_path):
    out = tmp_path / "r.csv"

    def second():
        with pytest.raises(DataError, match="another process works on this sweep"):
            small_sweep().run(local(1), out=out)

    small_sweep().run(counting([], 3, second), out=out)


def test_what_was_kept_is_told_when_it_is_interrupted(tmp_path):
    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as ended:
        small_sweep().run(counting([], 10, interrupt), out=tmp_path / "r.csv")
    assert ended.value.__notes__ == [
        f"10 of {COUNT} runs are done and kept: the same command goes on from there"
    ]


def test_nothing_is_left_of_a_sweep_that_did_nothing(tmp_path):
    stopped_at_once = counting([], 0, lambda: (_ for _ in ()).throw(DataError("no")))
    with pytest.raises(DataError):
        small_sweep().run(stopped_at_once, out=tmp_path / "r.csv")
    assert list(tmp_path.iterdir()) == []


# -- in Python ----------------------------------------------------------------------------


def test_the_table_is_one_that_pandas_takes():
    table = mopro.sweep(mopro.compile(TEXT), vary={"VEL1": [10, 20]})
    frame = table.to_pandas()
    assert frame["VEL1_in_s"].tolist() == [10.0, 20.0]
    assert frame["time_s"].is_monotonic_decreasing
    assert frame["hour_temperature_C"].isna().all()


def test_wrong_arguments_are_told():
    program = mopro.compile(TEXT)
    with pytest.raises(TypeError, match="sweep expects a Program, not str"):
        mopro.sweep(TEXT, vary={"VEL1": "1,2"})
    with pytest.raises(VaryError, match="vary VEL2=1"):
        mopro.sweep(program, vary={"VEL2": "1"})
    with pytest.raises(DataError, match=r"r\.txt: expected one of \.parquet, \.csv"):
        mopro.sweep(program, vary={"VEL1": "1"}, out="r.txt")


def test_the_kernel_is_compiled_where_it_pays_over_all_runs():
    chunks = list(small_sweep()._chunks(small_sweep().tasks, 1))
    assert chunks[0].compiled is True
    few = small_sweep({"VEL1": "10"})
    assert next(few._chunks(few.tasks, 1)).compiled is None


def test_a_machine_with_formulas_goes_to_other_processes(tmp_path):
    file = tmp_path / "m.toml"
    file.write_text(
        'name = "m"\nextends = "chow1992"\n[[effect]]\nname = "lean"\nenters = "force"\n'
        'formula = "-g * x"\ng = { unit = "N/m" }\n[effects.lean]\ng = 50.0\n'
    )
    sweep = small_sweep({"effects.lean.g": "10,20,30 N/m"}, machine=str(file))
    assert sweep.run(local(2), 2) == sweep.run(local(1))
