"""Files that are no logs are named for what they are, with what to do; texts in UTF-16 are read."""

import bz2
import gzip
import io
import lzma
import pickle
import sqlite3
import zipfile

import numpy as np
import pytest

from mopro.errors import DataError
from mopro.experiment.data_file import read_data
from mopro.logs import read_log

TEXT = b"time_s,x_mm\n" + b"".join(b"%d,%d\n" % (n, n % 7) for n in range(200))

MOTAN = b"".join(b'{"q": "status", "eventtime": %d.5}\x03' % n for n in range(200))


def zipped(*names):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name in names:
            archive.writestr(name, TEXT)
    return file.getvalue()


def database(folder, *tables):
    path = folder / "made.sqlite"
    connection = sqlite3.connect(path)
    for table in tables:
        connection.execute(f"create table {table} (id integer, data blob)")
    connection.commit()
    connection.close()
    return path.read_bytes()


def npy():
    file = io.BytesIO()
    np.save(file, np.arange(9))
    return file.getvalue()


KINDS = {
    "gzip": lambda _: (gzip.compress(TEXT), "a gzip archive", "gunzip"),
    "bzip2": lambda _: (bz2.compress(TEXT), "a bzip2 archive", "bunzip2"),
    "xz": lambda _: (lzma.compress(TEXT), "an xz archive", "unxz"),
    "zip": lambda _: (zipped("a.csv"), "a ZIP archive", "unpack"),
    "xlsx": lambda _: (zipped("[Content_Types].xml", "xl/workbook.xml"), "an Excel", "as CSV"),
    "ods": lambda _: (zipped("mimetype", "content.xml"), "an OpenDocument file", "as CSV"),
    "sal": lambda _: (zipped("digital-0.bin", "meta.json"), "Saleae", "as CSV"),
    "xls": lambda _: (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "old Excel", "as CSV"),
    "7z": lambda _: (b"7z\xbc\xaf\x27\x1c" + bytes(99), "a 7-Zip archive", "7z x"),
    "mf4": lambda _: (b"MDF     4.10    " + bytes(99), "an MDF", "asammdf"),
    "tdms": lambda _: (b"TDSm" + bytes(99), "a TDMS file", "npTDMS"),
    "mat": lambda _: (b"MATLAB 5.0 MAT-file, Platform: X" + bytes(99), "a MAT file", "writetable"),
    "pickle": lambda _: (pickle.dumps({"t": [1, 2]}), "a pickle of Python", "CSV or Parquet"),
    "sqlite": lambda folder: (database(folder, "log"), "an SQLite database", "sqlite3 -header"),
    "bag": lambda folder: (database(folder, "topics", "messages"), "ROS 2", "export its topics"),
    "npy": lambda _: (npy(), "an NPY array", "numpy.savez"),
    "json": lambda _: (b'[{"t": 0, "x": 1}, {"t": 1, "x": 2}]', "a JSON file", "as CSV"),
    "json lines": lambda _: (b'{"t": 0, "x": 1}\n{"t": 1, "x": 2}\n', "a JSON file", "as CSV"),
    "motan": lambda _: (gzip.compress(MOTAN), "a capture of Klipper's motan", "readlog.py"),
    "motan, unpacked": lambda _: (MOTAN, "a capture of Klipper's motan", "as CSV"),
    "cut gzip": lambda _: (gzip.compress(TEXT)[:14], "a gzip archive", "gunzip"),
    "ulog": lambda _: (b"ULog\x01\x12\x35" + bytes(99), "a ULog of PX4", "ulog2csv"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["log.csv", "log.dat", "log"])
def test_what_is_no_text_of_rows_is_named_with_what_to_do(tmp_path, kind, name):
    data, words, advice = KINDS[kind](tmp_path)
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DataError, match=words) as error:
        read_log(tmp_path / name)
    assert advice in error.value.render()
    with pytest.raises(DataError, match=words) as error:
        read_data(tmp_path / name, name, {"time_s"})
    assert advice in error.value.render()


@pytest.mark.parametrize("cut", [1, 4, 7, 20, 100])
@pytest.mark.parametrize("kind", KINDS)
def test_beginnings_of_foreign_files_are_refused_in_words(tmp_path, kind, cut):
    (tmp_path / "log.csv").write_bytes(KINDS[kind](tmp_path)[0][:cut])
    with pytest.raises(DataError):
        read_log(tmp_path / "log.csv")


MARK = "\ufeff"
ENCODINGS = {
    "utf-8": "", "utf-8-sig": "", "utf-16": "", "utf-16-le": "", "utf-16-be": "",
    "utf-16-be with its mark": MARK, "utf-32": "", "utf-32-be": MARK,
}  # fmt: skip


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_text_of_any_encoding_is_read_as_a_log_and_as_data(tmp_path, encoding):
    text = ENCODINGS[encoding] + TEXT.decode().replace("x_mm", "L\u00e4nge_mm")
    (tmp_path / "log.csv").write_bytes(text.encode(encoding.split()[0]))
    found = read_log(tmp_path / "log.csv")
    assert [(c.name, c.unit, len(c.values)) for c in found.columns] == [("L\u00e4nge", "mm", 200)]
    data = read_data(tmp_path / "log.csv", "log.csv", {"time_s", "L\u00e4nge_mm"})
    assert data.columns["L\u00e4nge_mm"].tolist() == [n % 7 for n in range(200)]
    assert data.source.line(3) == "1,1"


def test_a_log_in_windows_1252_is_read(tmp_path):
    (tmp_path / "log.csv").write_bytes(TEXT.replace(b"x_mm", b"L\xe4nge [mm]"))
    assert read_log(tmp_path / "log.csv").columns[0].name == "L\u00e4nge"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32-le"])
@pytest.mark.parametrize(
    ("old", "new", "place"),
    [("9,2\n", "9,wrong\n", "11:3"), ("9,2\n", "9\n", "11:1"), ("9,2\n", "9,2\x1a\n", "11:4")],
)
def test_a_fault_in_wide_data_is_told_at_its_place(tmp_path, encoding, old, new, place):
    text = TEXT.decode().replace(f"\n{old}", f"\n{new}")
    (tmp_path / "log.csv").write_bytes(text.encode(encoding))
    with pytest.raises(DataError) as error:
        read_data(tmp_path / "log.csv", "log.csv", {"time_s", "x_mm"})
    assert f"log.csv:{place}: " in error.value.render()


def test_a_format_that_is_read_is_known_by_its_mark(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"time_s": [0.0, 1.0], "x_mm": [1.0, 2.0]}), tmp_path / "log.csv")
    assert read_log(tmp_path / "log.csv").columns[0].unit == "mm"
