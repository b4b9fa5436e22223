"""Recordings from anywhere: what is none is refused by name, and before memory is taken for it."""

import io
import json
import struct
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mopro import recording
from mopro.errors import DataError
from mopro.recording import Header, read

HEADER = Header("P.CMD", "00", "chow1992", "emulator", 2000.0, 0.0, 7, {"mopro": "0"})
TEXT = json.dumps(HEADER.as_json())
TIMES = np.arange(4) / 2000


def refusal(path):
    with pytest.raises(DataError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def parquet(path, columns, text=TEXT, **options):
    table = pa.table(columns).replace_schema_metadata({"mopro": text})
    pq.write_table(table, path, **options)
    return path


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"time_s": ["a", "b"]}, "'time_s' has values of type string"),
        ({"time_s": [[1.0], [2.0]]}, "'time_s' has values of type list"),
        ({"time_s": [True, False]}, "'time_s' has values of type bool"),
        ({"time_s": TIMES, "x": [{"a": 1}] * 4}, "'x' has values of type struct"),
        ({"time_s": pa.array([], pa.float64())}, "it has no rows"),
        ({"position_1_m": TIMES}, "it has no column time_s"),
        ({}, "0 columns"),
        ({f"c{i}": TIMES for i in range(300)}, "300 columns, expected 1 to 200"),
    ],
)
def test_a_table_that_is_no_recording(tmp_path, columns, expected):
    assert expected in refusal(parquet(tmp_path / "r.parquet", columns))


def test_a_small_file_of_very_many_rows_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """Run-length coding makes megabytes of gigabytes."""
    monkeypatch.setattr("mopro.recording.reading.MOST_ROWS", 100_000)
    path = parquet(tmp_path / "r.parquet", {"time_s": np.zeros(100_001)}, compression="zstd")
    assert path.stat().st_size < 10_000
    monkeypatch.setattr(pq.ParquetFile, "read", None)
    assert "100001 rows of 1 columns, expected at most 100000 rows" in refusal(path)


def with_header(path, text):
    """The recording `path` of one column, in the format of its suffix, with `text` as header."""
    if path.suffix == ".parquet":
        parquet(path, {"time_s": TIMES}, text)
    elif path.suffix == ".csv":
        path.write_text(f"# mopro {text}\ntime_s\n0.0\n")
    else:
        np.savez(path, time_s=TIMES, mopro=np.frombuffer(text.encode(), np.uint8))
    return path


@pytest.mark.parametrize(
    "text", ["", "{}", "[1]", "null", '{"a": 1}', "[" * 100_000, "9" * 6000, '"' * 10]
)
@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".npz"])
def test_a_header_that_is_none(tmp_path, text, suffix):
    path = with_header(tmp_path / f"r{suffix}", text)
    assert "is no recording" in refusal(path)


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".npz"])
def test_a_header_beyond_its_bound(tmp_path, suffix):
    path = with_header(tmp_path / f"r{suffix}", " " * (1 << 20) + TEXT)
    assert "is no recording" in refusal(path)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("", "no rows"),
        ("time_s\n", "no rows"),
        ("time_s\n" + "1" * 70_000 + "\n", "a line of more than 65535 characters"),
        ("time_s,line\n0.0,1\n0.5\n", "line 4 has not 2 cells"),
        ('time_s\n"' + "1\n" * 200_000, "field larger than field limit"),
        ("time_s,line\n0.0," + "9" * 5000 + "\n", "is no recording"),
        ("time_s,line\n0.0,99999999999\n", "line has a number of more than 32 bits"),
        ("time_s\nabc\n", "could not convert"),
    ],
)
def test_csv_that_is_no_recording(tmp_path, rows, expected):
    path = tmp_path / "r.csv"
    path.write_text(f"# mopro {TEXT}\n{rows}")
    if rows == "":
        expected = "0 columns"
    assert expected in refusal(path)


def member(shape, descr="<f8"):
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


def archive(path, **members):
    with zipfile.ZipFile(path, "w") as file:
        for name, data in {"mopro": TEXT.encode(), **members}.items():
            head = member((len(data),), "|u1") if name == "mopro" else b""
            file.writestr(f"{name}.npy", head + data)
    return path


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"time_s": TIMES.reshape(2, 2)}, "no column of numbers: float64 of shape (2, 2)"),
        ({"time_s": np.float64(3)}, "of shape ()"),
        ({"time_s": TIMES, "x": TIMES[:2]}, "different lengths: [2, 4]"),
        ({"time_s": np.array(["a", "b"])}, "no column of numbers"),
        ({"time_s": np.array([{}, {}])}, "no column of numbers"),
        ({"time_s": TIMES.astype(complex)}, "no column of numbers"),
        ({"time_s": TIMES[:0]}, "it has no rows"),
        ({"x": TIMES}, "it has no column time_s"),
    ],
)
def test_arrays_that_are_no_recording(tmp_path, columns, expected):
    path = tmp_path / "r.npz"
    np.savez(path, mopro=np.frombuffer(TEXT.encode(), np.uint8), **columns)
    assert expected in refusal(path)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (member((2**50,)), "1125899906842624 rows of 1 columns"),
        (member((10**30,)), "rows of 1 columns"),
        (member((-1,)), "no rows"),
        (member((1000,)) + bytes(8), "is no recording"),
        (member((4,), "<f16") + bytes(64), "no column of numbers"),
        (b"\x93NUMPY\x09\x00", "format (9, 0)"),
        (b"\x93NUMPY\x01\x00" + struct.pack("<H", 9000) + b"(" * 9000, "is no recording"),
        (b"", "is no recording"),
    ],
)
def test_an_array_that_claims_what_it_has_not(tmp_path, data, expected):
    assert expected in refusal(archive(tmp_path / "r.npz", time_s=data))


def test_an_encrypted_archive(tmp_path):
    path = archive(tmp_path / "r.npz", time_s=member((1,)) + bytes(8))
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\1\2")  # the entry of time_s in the directory
    data[at + 8] |= 1
    path.write_bytes(bytes(data))
    assert "it is encrypted" in refusal(path)


def test_what_older_versions_stored_beside_the_columns_is_no_column(tmp_path):
    text = np.frombuffer(TEXT.encode(), np.uint8)
    with zipfile.ZipFile(tmp_path / "r.npz", "w") as file:
        for name, values in {"time_s": TIMES, "mopro": text, "allow_pickle": np.False_}.items():
            data = io.BytesIO()
            np.lib.format.write_array(data, np.asanyarray(values))
            file.writestr(f"{name}.npy", data.getvalue())
    assert list(read(tmp_path / "r.npz").columns) == ["time_s"]


def test_only_the_columns_that_are_wanted_are_read(tmp_path):
    many = {"time_s": TIMES, "x": TIMES, "y": TIMES}
    for suffix in (".parquet", ".csv", ".npz"):
        path = tmp_path / f"r{suffix}"
        with recording.open_sink(path, HEADER) as sink:
            sink.write(many)
        assert list(read(path, ["y"]).columns) == ["time_s", "y"]


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_an_infinite_reading_is_refused_with_its_row(mopro, tmp_path, value):
    """It gave rows of nan, and the verdict `disagreement`."""
    (tmp_path / "P.CMD").write_text("UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 0.5\nWX1\n")
    times = np.arange(200) / 2000
    values = np.zeros(200)
    values[7] = value
    parquet(tmp_path / "d.parquet", {"time_s": times, "position_1_in": values})
    (tmp_path / "e.toml").write_text(
        'machine = "chow1992"\n[[sensor]]\nname = "laser"\nquantity = "position"\naxis = 1\n'
        'column = "position_1_in"\nrate_hz = 2000.0\nnoise_rms = 2e-5\n'
        '[[run]]\nprogram = "P.CMD"\ndata = "d.parquet"\n'
    )
    compared = mopro("compare", "e.toml")
    assert compared.returncode == 2
    assert "position_1_in is " in compared.stderr
    assert "in row 8" in compared.stderr
