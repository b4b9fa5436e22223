"""Kinds of files that are not read as logs, by their first bytes, and what to do with each."""

from __future__ import annotations

import re
import zipfile
import zlib
from pathlib import Path

from mopro.errors import DataError

_HEAD_BYTES = 1 << 16
_EXPORT = "export it as CSV"
# First bytes -> what the file is, what to do.
_BEGINNINGS: tuple[tuple[bytes, str, str], ...] = (
    (b"BZh", "a bzip2 archive", "unpack it with bunzip2"),
    (b"\xfd7zXZ\0", "an xz archive", "unpack it with unxz"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive", "unpack it with unzstd"),
    (b"\x04\x22\x4d\x18", "an LZ4 archive", "unpack it with unlz4"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it with 7z x"),
    (b"Rar!\x1a\x07", "a RAR archive", "unpack it first"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel or Office file", f"in Excel, {_EXPORT}"),
    (b"MDF     ", "an MDF (MF4) measurement", f"{_EXPORT}, for example with asammdf"),
    (b"UnFinMF ", "an MDF (MF4) measurement that was not finished", f"repair it, then {_EXPORT}"),
    (b"TDSm", "a TDMS file of LabVIEW", f"{_EXPORT}, for example with npTDMS"),
    (b"TDSh", "a TDMS index of LabVIEW", f"take the .tdms file beside it and {_EXPORT}"),
    (b"MATLAB 5.0 MAT-file", "a MAT file of MATLAB", "write its table as CSV with writetable"),
    (b"MATLAB 7.3 MAT-file", "a MAT file of MATLAB", "write its table as CSV with writetable"),
    (b"#ROSBAG", "a ROS 1 bag", "export its topics as CSV with rostopic echo -b FILE -p TOPIC"),
    (b"ULog\x01\x12\x35", "a ULog of PX4", "convert it with ulog2csv"),
    (b"\xa3\x95\x80", "a DataFlash log of ArduPilot", "convert it with mavlogdump.py --format csv"),
    (b"LOGG", "a BLF log of CAN messages", "decode it with its DBC to CSV"),
    (b"<SALEAE>", "a binary export of Saleae Logic", "export it as CSV"),
    (b"ARROW1", "an Arrow (Feather) file", "write it as Parquet or CSV"),
    (b"\x93NUMPY", "an NPY array", "save it with names by numpy.savez, or as CSV"),
    (b"Obj\x01", "an Avro file", _EXPORT),
    (b"RIFF", "a RIFF file (WAV sound)", _EXPORT),
    (b"%PDF", "a PDF document", "export the numbers as CSV where they come from"),
    (b"\x89PNG", "a PNG picture", "a picture has no numbers: take the log itself"),
    (b"\xff\xd8\xff", "a JPEG picture", "a picture has no numbers: take the log itself"),
    (b"\x7fELF", "a program", "take the log that it writes"),
    (b"<?xml", "an XML file", _EXPORT),
    (b"<!DOCTYPE", "an HTML page", "save the table as CSV"),
    (b"<html", "an HTML page", "save the table as CSV"),
)  # fmt: skip
_COLUMNS = "write a column for each number, as CSV or Parquet"
_GZIP = b"\x1f\x8b"
# Klipper ends each of its messages so.
_KLIPPER_END = b"\x03"
_SQLITE, _ZIP = b"SQLite format 3\0", b"PK\x03\x04"
_PICKLE = re.compile(rb"\x80[\x02-\x05][\x95\]}\x8c(cX\x88K]")
_JSON = re.compile(rb"\s*(?:\[\s*)?[\[{]\s*[\"\[\]{}\d-]")
_TABLES = re.compile(rb"CREATE TABLE.{0,3}(?:topics|messages)\b", re.IGNORECASE)
# Inside of a ZIP archive -> what the archive is.
_INSIDE = (
    ("xl/", "an Excel workbook", f"in Excel, {_EXPORT}"),
    ("content.xml", "an OpenDocument file", f"in its program, {_EXPORT}"),
    ("word/", "a Word document", "save the table in it as CSV"),
    ("digital-0.bin", "a capture of Saleae Logic", "export it as CSV in Logic"),
    ("meta.json", "a capture of Saleae Logic", "export it as CSV in Logic"),
)
_MARKS = {b"PAR1": ".parquet", b"\x89HDF\r\n\x1a\n": ".h5", b"\x89MCAP0\r\n": ".mcap"}


def suffix_of(path: Path) -> str:
    """The suffix of a file's name; that of its format where the file begins with its mark."""
    with open(path, "rb") as file:
        head = file.read(8)
    marks = [suffix for mark, suffix in _MARKS.items() if head.startswith(mark)]
    return marks[0] if marks else path.suffix.lower()


def refuse_foreign(path: Path) -> bytes:
    """The first bytes of a text; DataError that says what any other file is, and what to do."""
    with open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
    found = kind_of(head, path)
    if found is not None:
        kind, advice = found
        message = f"{path}: this is {kind}, which is not read as a log"
        raise DataError(f"{message}; {advice}", "foreign-format")
    return head


def kind_of(head: bytes, path: Path) -> tuple[str, str] | None:
    """Kind of a file by its first bytes, and what to do; None for a text of rows."""
    for beginning, kind, advice in _BEGINNINGS:
        if head.startswith(beginning):
            return kind, advice
    if head.startswith(_SQLITE):
        return _database(head)
    if head.startswith(_ZIP):
        return _archive(path)
    if _PICKLE.match(head):
        return "a pickle of Python, which could run code", "write it as CSV or Parquet"
    if head.startswith(_GZIP):
        return _capture(_unpacked(head)) or ("a gzip archive", "unpack it with gunzip")
    if _JSON.match(head):
        return _capture(head) or ("a JSON file", _COLUMNS)
    return None


def _unpacked(head: bytes) -> bytes:
    """The beginning of what a gzip archive has in it; nothing if it is damaged."""
    try:
        return zlib.decompressobj(wbits=31).decompress(head, _HEAD_BYTES)
    except zlib.error:
        return b""


def _capture(head: bytes) -> tuple[str, str] | None:
    """Messages in JSON that Klipper's motan recorded."""
    if not (_JSON.match(head) and _KLIPPER_END in head):
        return None
    advice = f"{_COLUMNS}, for example with readlog.py of klipper/scripts/motan"
    return "a capture of Klipper's motan", advice


def _database(head: bytes) -> tuple[str, str]:
    if _TABLES.search(head):
        advice = "export its topics as CSV, for example with ros2 topic echo --csv while it plays"
        return "a bag of ROS 2 (SQLite)", advice
    return "an SQLite database", "export its table: sqlite3 -header -csv FILE 'select * from TABLE'"


def _archive(path: Path) -> tuple[str, str]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return "a damaged ZIP archive", "copy it once more"
    for start, kind, advice in _INSIDE:
        if any(name.startswith(start) for name in names):
            return kind, advice
    if names and all(name.endswith(".npy") for name in names):
        return "an NPZ archive of another name", "rename it to end in .npz"
    return "a ZIP archive", "unpack it and import the log in it"
