"""Logs of many layouts, as other programs write them."""

import csv
import json
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mopro.errors import DataError
from mopro.logs import Asked, read_log
from mopro.logs.column_names import heading, quantity_of


@pytest.fixture
def log(tmp_path):
    def read(content, name="log.csv", **asked):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_log(path, Asked(**asked))

    return read


def refusal(log, content, **asked):
    with pytest.raises(DataError) as error:
        log(content, **asked)
    return error.value.render()


def column(log, name):
    return next(c for c in log.columns if c.raw == name)


def first_clock(log):
    return next(iter(log.clocks.values()))


@pytest.mark.parametrize(
    "content",
    [
        "time_s,pos_mm\n0,1.5\n0.1,2.5\n0.2,-3\n",
        "﻿time_s;pos_mm\n0,0;1,5\n0,1;2,5\n0,2;-3,0\n",
        "time\tpos\ns\tmm\n0.0\t1.5\n0.1\t2.5\n0.2\t-3\n",
        '"Time [ms]","pos (mm)"\n0,"1.5"\n100,"2.5"\n200,"-3"\n',
        "Logger 3.1\nSerial: 12, rev. B\n\ntime_us,pos [mm]\n0,1.5\n\n100000,2.5\n200000,-3",
        "# t_s  pos_mm\n0   1.5\n0.1 2.5\n 0.2  -3 \n",
        "time_s;pos_mm\r\n0;1.5\r\n0.1;2.5\r\n0.2;-3\r\n".encode("utf-16"),
        "time_ns,pos_mm\n1700000000000000000,1.5\n1700000000100000000,2.5\n1700000000200000000,-3\n",
        "timestamp,pos_mm\n1700000000.0,1.5\n1700000000.1,2.5\n1700000000.2,-3\n",
        "when (date),pos_mm\n2026-11-22T19:30:54.1Z,1.5\n2026-11-22T19:30:54.2Z,2.5\n"
        "2026-11-22T19:30:54.3Z,-3\n",
        "time,pos_mm\n2026-11-22 19:30:54.1+01:00,1.5\n2026-11-22 19:30:54.2+01:00,2.5\n"
        "2026-11-22 19:30:54.3+01:00,-3\n",
        "time,pos_mm\n23:59:59.9,1.5\n0:00:00.0,2.5\n0:00:00.1,-3\n",
        "time_s\tpos [mm]\tnote, or not\n0\t1.5\tword\n0.1\t2.5\tword\n0.2\t-3\tword\n",
    ],
)
def test_every_layout_gives_the_same_columns(log, content):
    found = log(content)
    (only,) = found.columns
    assert only.values.tolist() == [1.5, 2.5, -3.0]
    assert (only.name, only.unit) == ("pos", "mm")
    assert first_clock(found) == pytest.approx([0, 0.1, 0.2], abs=1e-6)


@given(
    values=st.lists(
        st.tuples(st.floats(-1e6, 1e6), st.one_of(st.none(), st.floats(-1e3, 1e3))),
        min_size=3,
        max_size=40,
    ),
    delimiter=st.sampled_from(",;\t|"),
    decimal=st.sampled_from(".,"),
    quoted=st.booleans(),
)
def test_what_another_writer_wrote_is_read(tmp_path_factory, values, delimiter, decimal, quoted):
    path = tmp_path_factory.mktemp("log") / "log.csv"
    style = csv.QUOTE_ALL if quoted or delimiter == decimal else csv.QUOTE_MINIMAL

    def shown(number):
        return "" if number is None else f"{number:.4f}".replace(".", decimal)

    with open(path, "w", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter, quoting=style)
        writer.writerow(["time_s", "a, or b [mm]", "note", "c_N"])
        for n, (a, c) in enumerate(values):
            writer.writerow([shown(n / 8), shown(a), "word", shown(c)])
    found = read_log(path)
    assert first_clock(found) == pytest.approx(np.arange(len(values)) / 8, abs=1e-4)
    a = column(found, "a, or b [mm]")
    assert a.unit == "mm"
    assert a.values == pytest.approx([v for v, _ in values], abs=1e-3)
    if any(c is not None for _, c in values):
        wanted = [np.nan if c is None else c for _, c in values]
        assert column(found, "c_N").values == pytest.approx(wanted, abs=1e-3, nan_ok=True)
    assert any("words" in str(d) for d in found.decisions)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("time_s,x\n0,1\n1,oops\n2,3\n", "log.csv:3:3: x: 'oops' is no number [not-a-number]"),
        ("time_s,x\n0,1\n\n1,oops\n2,3\n", "log.csv:4:3: x: 'oops'"),
        ("time_s;x\n0;1\n1;2\n2;inf\n", "log.csv:4:3: x: an infinite number"),
        ("time_s,x\n0,1\n1,2,3\n2,3\n", "log.csv:3:1: 3 cells, expected 2"),
        ("a\nb\n\ntime_s,x\n0,1\n\n1,2,3\n2,3\n", "log.csv:7:1: 3 cells, expected 2"),
        ("time,x\n2026-01-01T00:00:00,1\n2026-01-01T00:00:01,2\nnoon,2\n", "log.csv:4:1: time: 'n"),
        ("0,1\n1,2\n", "log.csv:1:1: expected headings above the numbers"),
        ("time_s,x,x\n0,1,2\n1,1,2\n", "there are two columns x"),
        ("time_s;x\n0;1.234,5\n1;2.345,6\n", "groups its digits by thousands"),
        ("a,b\n0,1\n1,2\n", "no column of times was found among a, b"),
        ("", "the file is empty"),
        ("time_s,x\n", "no row of numbers"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(log, content, expected):
    assert expected in refusal(log, content)


def test_each_bad_cell_is_named(log):
    said = refusal(log, "time_s,x,y\n0,1,2\n1,bad,3\n2,4,worse\n3,5,6\n4,5,6\n5,6,7\n")
    assert ":3:3: x: 'bad'" in said
    assert ":4:5: y: 'worse'" in said


def test_a_stated_word_is_a_missing_reading(log):
    text = "time_s,x\n0,1\n1,OFF\n2,3\n"
    assert np.isnan(log(text, missing=("OFF",)).columns[0].values[1])


def test_a_row_that_was_cut_off_at_the_end_is_left_out(log):
    found = log("time_s,x,y\n0,1,2\n1,2,3\n2,3,4\n3,")
    assert first_clock(found).tolist() == [0, 1, 2]
    assert any("cut off: 2 of 3 cells" in str(d) for d in found.decisions)


def test_double_and_backward_stamps_are_told(log):
    rows = [f"{t},{n}" for n, t in enumerate([*range(30), 29, 28.5, *range(31, 60)])]
    found = log("time_s,x\n" + "\n".join(rows))
    assert np.all(np.diff(first_clock(found)) > 0)
    said = [str(d) for d in found.decisions]
    assert any("runs backwards 1 times" in s for s in said)
    assert any("1 rows left out whose time is that of the next row" in s for s in said)


def test_columns_of_words_and_empty_ones_are_left_out_and_told(log):
    found = log("time_s,x,state,none\n0,1,run,\n1,2,run,\n2,3,idle,\n")
    assert [c.raw for c in found.columns] == ["x"]
    said = [str(d) for d in found.decisions]
    assert "column state: left out (its cells are words)" in said
    assert "column none: left out (it is empty)" in said


def test_clocks_in_pairs_keep_their_columns(log):
    found = log("t1_s,x,t2_ms,y\n0,1,50,2\n0.1,1,150,3\n0.2,3,250,4\n")
    assert [(c.raw, c.clock) for c in found.columns] == [("x", "t1_s"), ("y", "t2_ms")]
    assert found.clocks["t2_ms"] == pytest.approx([0, 0.1, 0.2])
    assert found.origins["t2_ms"] == pytest.approx(0.05)


def test_a_log_without_times_takes_a_rate(log):
    found = log("x_mm,y_mm\n1,2\n2,3\n", rate_hz=10.0)
    assert first_clock(found).tolist() == [0, 0.1]


def test_a_time_without_a_unit_is_to_be_checked(log):
    found = log("t,x\n0,1\n10,2\n20,3\n")
    (decision,) = [d for d in found.decisions if d.check]
    assert "10 s lie between rows" in str(decision)
    assert first_clock(log("t,x\n0,1\n10,2\n20,3\n", time_unit="ms"))[1] == pytest.approx(0.01)


def test_binary_containers_give_the_same_columns(tmp_path):
    import h5py
    import pyarrow as pa
    import pyarrow.parquet as pq
    from mcap.writer import Writer

    stamps = 1_700_000_000_000_000_000 + np.arange(5) * 10**8
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.5])
    pq.write_table(
        pa.table({"stamp": pa.array(stamps).cast(pa.timestamp("ns")), "pos_mm": values}),
        tmp_path / "a.parquet",
    )
    np.savez(tmp_path / "a.npz", time_ns=stamps, pos_mm=values)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_ns"] = stamps
        file["pos"] = values
        file["pos"].attrs["unit"] = "mm"
    with open(tmp_path / "a.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/axis", "json", writer.register_schema("s", "", b""))
        for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True):
            writer.add_message(channel, stamp, json.dumps({"pos_mm": value}).encode(), stamp)
        writer.finish()
    for suffix in ("parquet", "npz", "h5", "mcap"):
        found = read_log(tmp_path / f"a.{suffix}")
        (only,) = found.columns
        assert only.unit == "mm"
        assert only.values.tolist() == values.tolist()
        assert first_clock(found) == pytest.approx(np.arange(5) / 10, abs=1e-9)


@pytest.mark.parametrize("suffix", ["parquet", "npz", "h5", "mcap"])
def test_a_container_that_is_none_is_refused(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(b"time_s,x\n0,1\n")
    with pytest.raises(DataError, match="cannot be read as"):
        read_log(path)


@pytest.mark.parametrize("suffix", ["parquet", "npz"])
def test_an_infinite_number_in_a_container_is_refused_with_its_row(tmp_path, suffix):
    import pyarrow as pa
    import pyarrow.parquet as pq

    times, values = np.arange(5) / 10, np.array([1.0, np.nan, -np.inf, 4.0, 5.0])
    pq.write_table(pa.table({"time_s": times, "x_mm": values}), tmp_path / "a.parquet")
    np.savez(tmp_path / "a.npz", time_s=times, x_mm=values)
    with pytest.raises(DataError, match="column x_mm, row 3: an infinite number") as error:
        read_log(tmp_path / f"a.{suffix}")
    assert error.value.rule == "not-a-number"


def test_pickled_objects_are_not_loaded(tmp_path):
    np.savez(tmp_path / "a.npz", time_s=np.array([{}, {}], dtype=object))
    with pytest.raises(DataError, match="cannot be read as"):
        read_log(tmp_path / "a.npz")


def test_a_missing_library_is_named_with_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "a.h5").write_bytes(b"")
    (tmp_path / "a.mcap").write_bytes(b"")
    for suffix, library, extra in (("h5", "h5py", "hdf5"), ("mcap", "mcap", "mcap")):
        for module in (library, f"{library}.exceptions"):
            monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(DataError, match=rf"pip install 'mopro\[{extra}\]'"):
            read_log(tmp_path / f"a.{suffix}")


def test_a_million_rows_are_read_at_once(tmp_path):
    rows = 1_000_000
    block = "".join(f"{n / 1000:.3f},{n % 97},{n % 13}\n" for n in range(rows))
    (tmp_path / "big.csv").write_text("time_s,x_mm,y_mm\n" + block)
    found = read_log(tmp_path / "big.csv")
    assert len(found.columns[0].values) == rows
    assert found.columns[1].values[-1] == (rows - 1) % 13


@pytest.mark.parametrize(
    ("raw", "below", "name", "unit"),
    [
        ("position_1_in", None, "position_1", "in"),
        ("omega_rad_per_s", None, "omega", "rad_s"),
        ("Torque (N m)", None, "Torque", "Nm"),
        ("Temp °C", None, "Temp", "C"),
        ("pos", "[µm]", "pos", "um"),
        ("point_a", None, "point_a", None),
        ("phase_A", None, "phase", "A"),
        ("count", None, "count", None),
        ("x", "-", "x", None),
    ],
)
def test_headings(raw, below, name, unit):
    found = heading(raw, below)
    assert (found.name, found.unit) == (name, unit)


@pytest.mark.parametrize(
    ("name", "unit", "quantity"),
    [
        ("ActPos", "mm", "position"),
        ("motor", "A", "current"),
        ("MotorCurrent", None, "current"),
        ("theta", None, "angle"),
        ("sensor1_temperature", "C", "temperature"),
        ("star_snr", None, None),
    ],
)
def test_quantities(name, unit, quantity):
    assert quantity_of(name, unit) == quantity
