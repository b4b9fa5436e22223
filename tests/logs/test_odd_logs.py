"""Logs that were tracebacks, hung or could take any memory: each is refused in words."""

import io
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer

from helpers.paths import DATA
from mopro.errors import DataError, DataFileError
from mopro.logs import Asked, hdf5, read_log


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.txt", b"time\0x\n\xff\xff\xff\r\xff\xff`1\n0:00:01  \n", None),
        ("a.txt", b",", "no row of numbers"),
        ("a.txt", b"time x\n#3\n59:5\x81 1\n00:0time :20801 \xd84\n", "0x81 is no character of"),
        ("a.txt", b"# 3\nTC\x02),0,\xcb0\n0.1,2,21\n0.2,3,223\n0,2\r1,7;2\n", "cells, expected 3"),
        ("a.txt", b"t,x_mm,T_C\n0,1,\xb9\n.3,.4,2 \n", "is no number"),
    ],
)
def test_odd_texts_that_were_tracebacks(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DataError, match=words):
        read_log(tmp_path / name)


@pytest.mark.parametrize(("end", "line"), [(b"2,3\xd9", 4), (b"2,3,4\xe1", 4), (b"2\xe8", None)])
def test_a_character_that_is_cut_off_at_the_end_loses_no_row(tmp_path, capfd, end, line):
    """Arrow skips a row of another width in silence if it ends within a character."""
    (tmp_path / "a.csv").write_bytes(b"time_s,x\n0,1\n1,2\n" + end)
    if line is None:
        left_out = read_log(tmp_path / "a.csv").rows.as_json()["left_out"]
        assert left_out == [{"why": "cut off at the end", "count": 1}]
    else:
        with pytest.raises(DataError, match=rf"a\.csv:{line}:"):
            read_log(tmp_path / "a.csv")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("data", [b"1;2\n1,2;3,5;4", b"5 6\n", b"1,2,3\n", b'1,"2\n', b"1,2\n1"])
def test_a_text_without_headings_in_which_few_rows_are_whole(tmp_path, data):
    (tmp_path / "a.csv").write_bytes(data)
    with pytest.raises(DataError, match=r"a\.csv"):
        read_log(tmp_path / "a.csv", Asked(rate_hz=1.0))


def test_a_row_ends_at_carriage_returns_too_and_at_nothing_else(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"time_s,x\x0c_mm\r0,1\r\n1,2\r2,bad\r3,4\n")
    with pytest.raises(DataFileError) as caught:
        read_log(tmp_path / "a.csv")
    assert [d.span.line for d in caught.value.diagnostics] == [4]


def parquet(path, column):
    pq.write_table(pa.table({"time_s": [0.0, 1.0], "x": column}), path)
    return path


def test_a_parquet_file_with_what_cannot_be_told(tmp_path):
    words = pa.Array.from_buffers(
        pa.string(),
        2,
        [None, pa.py_buffer(np.array([0, 1, 2], np.int32)), pa.py_buffer(b"\xa9\xa9")],
    )
    stamps = pa.array([1 << 60, 1 << 61], pa.timestamp("us"))
    for column in (words, stamps):
        with pytest.raises(DataError, match="cannot be read as"):
            read_log(parquet(tmp_path / "a.parquet", column))


def test_an_array_of_an_npz_that_claims_what_it_has_not(tmp_path):
    """An archive of a few kB could need any memory."""
    head = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (2**50,)}
    np.lib.format.write_array_header_1_0(head, claim)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("time_s.npy", head.getvalue())
    with pytest.raises(DataError, match="rows of 1 columns") as caught:
        read_log(tmp_path / "a.npz")
    assert caught.value.rule == "too-long"


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_messages_of_ros_are_named_with_what_to_do(tmp_path, encoding):
    with open(tmp_path / "a.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/JointState", "ros2msg", b"float64[] position")
        channel = writer.register_channel("/joint_states", encoding, schema)
        for n in range(20):
            writer.add_message(channel, n, bytes(40), 0)
        writer.finish()
    words = r"/joint_states \((cdr|ros1)\): messages of ROS; export the topic as CSV"
    with pytest.raises(DataError, match=words):
        read_log(tmp_path / "a.mcap")


def test_an_mcap_message_beyond_all_times(tmp_path):
    with open(tmp_path / "a.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channel = writer.register_channel("/x", "json", schema)
        writer.add_message(channel, 2**63, b'{"a": 1}', 0)
        writer.finish()
    with pytest.raises(DataError, match="a message of 9223372036854775808 ns"):
        read_log(tmp_path / "a.mcap")


def test_an_hdf5_file_that_its_library_never_finishes(monkeypatch):
    monkeypatch.setattr(hdf5, "LEAST_S", 2.0)
    with pytest.raises(DataError, match="it was not read in 2 s: is it damaged"):
        read_log(DATA / "fuzz" / "hangs.h5")


@pytest.mark.parametrize(
    ("between", "line"),
    [("\x1a", 22), ("\x1a\n", 22), ("\x1a\x1a", 22), ("\x1atime_s,x_mm\n", 22)],
)
@pytest.mark.parametrize("dated", [False, True])
def test_a_ctrl_z_in_the_middle_is_told_and_no_row_is_lost(tmp_path, between, line, dated):
    """Also where the cell behind it is a time of day, which is a word."""
    form = "2026-11-22 10:00:{:02d}" if dated else "{:d}"
    rows = [f"{form.format(n)},{n + 0.5}\n" for n in range(40)]
    text = "time_s,x_mm\n" + "".join(rows[:20]) + between + "".join(rows[20:])
    path = tmp_path / "log.csv"
    path.write_text(text)
    found = read_log(path)
    assert found.columns[0].values.tolist() == [n + 0.5 for n in range(40)]
    told = [d for d in found.decisions if d.check and d.lasting]
    assert [d.subject for d in told] == [f"line {line}"]
    assert "a Ctrl-Z (0x1A)" in told[0].taken_as
    assert found.rows.used == 40


@pytest.mark.parametrize("end", ["\x1a", "\x1a\n", "\x1a" * 50 + "\r\n"])
@pytest.mark.parametrize("last", ["39,39.5", "39,39.5\n"])
def test_a_ctrl_z_at_the_end_of_the_log_is_no_row(tmp_path, end, last):
    rows = "".join(f"{n},{n + 0.5}\n" for n in range(39))
    path = tmp_path / "log.csv"
    path.write_text("time_s,x_mm\n" + rows + last + end)
    found = read_log(path)
    assert len(found.columns[0].values) == found.rows.read == found.rows.used == 40
    assert not [d for d in found.decisions if "Ctrl-Z" in d.taken_as]


def test_a_log_in_utf_16_may_have_the_byte_of_a_ctrl_z(tmp_path):
    rows = "".join(f"{n},{n + 0.5}\n" for n in range(40))
    path = tmp_path / "log.csv"
    path.write_text("time_s,\u011asouhlas_mm\n" + rows, encoding="utf-16")
    assert read_log(path).rows.used == 40
