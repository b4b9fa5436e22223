"""Kinds of text around the cells: delimiters, headings, notes, encodings, containers."""

import gzip
import io
import zipfile

import numpy as np

from helpers.many_logs.sheet import columns_of, headed


def _pick(sheet, *choices):
    return choices[int(sheet.rng.integers(len(choices)))]


def semicolons(sheet):
    sheet.style.delimiter, sheet.style.decimal = ";", ","


def other_delimiter(sheet):
    sheet.style.delimiter = _pick(sheet, "\t", "|", ";", " ")


def quoted(sheet):
    sheet.style.quoted = True


def padded(sheet):
    """Blanks behind each delimiter."""
    sheet.style.padding = _pick(sheet, " ", "   ")


def trailing(sheet):
    """A delimiter behind each row, and perhaps behind the headings."""
    sheet.style.trailing = _pick(sheet, "r", "rh")


def units_beside(sheet):
    sheet.style.units = _pick(sheet, "()", "{}", "suffix", "line", "line")


def units_stated(sheet):
    """Headings without units, which the user states."""
    sheet.style.units = "none"


def comment(sheet):
    sheet.style.comment = _pick(sheet, "# ", "#", "% ")


def facts_above(sheet):
    sheet.style.above = _pick(
        sheet, ("Logger v2.1", "Operator: nobody", ""), ("# file of the second shift", "#"),
        ("Sample rate;100", "Channels;2", ""), ("Date,2026-11-22", "Serial,4711", "Gain,2.5"),
    )  # fmt: skip


def notes(sheet):
    words = _pick(
        sheet,
        "INFO: settling started",
        "# operator pressed pause",
        "; comment here",
        "--- marker ---",
    )
    count = int(sheet.rng.integers(1, 5))
    for _ in range(count):
        at = int(sheet.rng.uniform(0.1, 0.9) * len(sheet.order))
        sheet.between.setdefault(at, []).append(words)
    sheet.right.lost_lines += count


def remarks(sheet):
    """Words behind a few rows, in a cell without a heading."""
    word = _pick(sheet, "pause", "operator away", "Störung")
    sheet.remarks = {sheet.some_row(): word for _ in range(3)}


def last_line(sheet):
    sheet.between.setdefault(len(sheet.order), []).append(
        _pick(sheet, "END", "# end of log", "EOF")
    )
    sheet.right.lost_lines += 1


def separator(sheet):
    """The first line by which Excel is told the delimiter."""
    sheet.style.above = (f"sep={sheet.style.delimiter}",)


def blank_lines(sheet):
    for _ in range(3):
        at = int(sheet.rng.uniform(0.1, 0.9) * len(sheet.order))
        sheet.between.setdefault(at, []).append("")


def column_of_words(sheet):
    words = _pick(sheet, ("IDLE", "RUN"), ("ok", "ok "), ("läuft", "steht"), ("G1 X1", "M0"))
    cells = [words[int(n)] for n in sheet.rng.integers(0, 2, sheet.rows)]
    sheet.words.append((_pick(sheet, "state", "Status", "mode"), cells))


def column_of_counts(sheet):
    cells = [str(n) for n in range(sheet.rows)]
    sheet.words.append((_pick(sheet, "sample", "index", "No", "frame"), cells))
    sheet.words_first = _pick(sheet, True, False)


def lists(sheet):
    sheet.style.listed = True
    unit = sheet.sensors()[0].unit
    for nth, column in enumerate(sheet.sensors()):
        column.unit = unit
        if unit == "count":  # nothing else says that they are places
            sheet.options += ["--measured", f"q[{nth}] [count]"]


def cut_off(sheet):
    """The last row breaks off within its cells."""
    sheet.cut_last = True
    sheet.right.lost_lines += 1


NAMES = (
    ("Sollwert", "Istwert"), ("consigne", "mesure"), ("목표", "실제"), ("指令", "実測"),
    ("задание", "факт"), ("CH1", "CH2"), ("a", "b"), ("Kanal 1", "Kanal 2"), ("in 1", "out 1"),
)  # fmt: skip


def odd_names(sheet):
    """Names that say nothing; the user says which is which."""
    told, seen = _pick(sheet, *NAMES)
    number = 0
    for column in sheet.columns:
        if column.role == "sensor":
            number += 1
            column.name = seen if number == 1 else f"{seen} {number}"
        else:
            column.name = told
    sheet.odd = True


def upper_case(sheet):
    for one in [*sheet.columns, *sheet.clock()]:
        if hasattr(one, "name"):
            one.name = one.name.upper()
        else:
            one.heading = one.heading.upper()


def two_files(sheet):
    """Commands in one file and readings in another, of one clock."""
    sheet.split = True


def utf16(sheet):
    encoding, mark = _pick(
        sheet, ("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff"), ("utf-16-le", b"")
    )
    sheet.style.encoding, sheet.style.mark = encoding, mark


def mark_of_utf8(sheet):
    sheet.style.mark = b"\xef\xbb\xbf"


def windows(sheet):
    """Windows-1252 with letters that UTF-8 writes otherwise."""
    if any(one.heading.encode("cp1252", "ignore").decode("cp1252") != one.heading
           for one in sheet.clock()):  # fmt: skip
        return False
    sheet.style.encoding = "cp1252"
    sheet.words.append(("Prüfer", ["Müller" if n % 7 else "Weiß" for n in range(sheet.rows)]))
    return True


def line_ends(sheet):
    sheet.style.newline = _pick(sheet, "\r\n", "\r\n", "\r")


def no_last_newline(sheet):
    sheet.style.last_newline = False


# -- containers ---------------------------------------------------------------------------


def _zipped(name):
    def pack(data):
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr(name, data)
        return file.getvalue()

    return pack


CONTAINERS = {
    "gzip": gzip.compress, "zip": _zipped("log.csv"), "xlsx": _zipped("xl/workbook.xml"),
    "ods": _zipped("content.xml"), "MF4": lambda d: b"MDF     4.10    " + d,
    "TDMS": lambda d: b"TDSm\x0e\0\0\0" + d, "MAT": lambda d: b"MATLAB 5.0 MAT-file, x" + d,
    "pickle": lambda d: b"\x80\x04\x95" + d, "JSON": lambda d: b'[{"time": 0}]',
    "SQLite": lambda d: b"SQLite format 3\0" + d, "bz2": lambda d: b"BZh91AY" + d,
    "xz": lambda d: b"\xfd7zXZ\0" + d, "bag": lambda d: b"#ROSBAG V2.0\n" + d,
    "zstd": lambda d: b"\x28\xb5\x2f\xfd" + d, "HTML": lambda d: b"<html><table>" + d,
}  # fmt: skip


def container(sheet):
    name = _pick(sheet, *CONTAINERS)
    sheet.packed = CONTAINERS[name]
    sheet.right.refusals = [({"foreign-format"}, None)]


def binary(sheet):
    """Parquet or NPZ instead of a text."""
    numbers = all(one.numeric for one in sheet.clock())
    sheet.style.suffix = _pick(sheet, ".parquet", ".npz") if numbers else ".parquet"
    sheet.right.lost_lines -= sum(map(len, sheet.between.values()))


def binary_of(sheet):
    """The bytes of the log as Parquet or NPZ."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {}
    for name, unit, cells, number in columns_of(sheet):
        own = [cells[row] for row in sheet.order]
        numbers = number or all(c.isdigit() for c in own)
        blanks = {"", "nan", "NULL", "n/a", "-", "None", "#N/A"}
        values = [np.nan if c in blanks else float(c) for c in own] if numbers else own
        columns[headed(name, unit, sheet.style)] = values
    file = io.BytesIO()
    if sheet.style.suffix == ".npz":
        np.savez(file, **{k: np.array(v) for k, v in columns.items()})
    else:
        pq.write_table(pa.table({k: pa.array(v) for k, v in columns.items()}), file)
    return file.getvalue()
