"""Kinds of cells: missing, absurd, wrapped, off by a factor, unreadable."""

import numpy as np

from helpers.many_logs.machines import Column
from helpers.many_logs.units import SIZES, TURN, WARMTHS, alike, from_si


def _pick(sheet, *choices):
    return choices[int(sheet.rng.integers(len(choices)))]


def _sensor(sheet):
    return _pick(sheet, *sheet.sensors())


def _rows(sheet, count):
    return sheet.rng.choice(sheet.order[20:-20], count, replace=False)


def _put(column, rows, word):
    column.cells = {**(column.cells or {}), **{int(r): word for r in rows}}


def _forget(column, rows):
    column.values = column.values.copy()
    column.values[rows] = np.nan


def missing(sheet):
    column = _sensor(sheet)
    column.blank = _pick(sheet, "", "nan", "NULL", "n/a", "-", "None", "#N/A")
    share = _pick(sheet, 0.005, 0.03, 0.2)
    _forget(column, sheet.rng.random(sheet.rows) < share)


def missing_word(sheet):
    column = _sensor(sheet)
    column.blank = _pick(sheet, "ERR", "OVER", "Bad Input", "****")
    sheet.options += ["--missing", column.blank]
    _forget(column, _rows(sheet, 8))


def blank_stretch(sheet):
    column = _sensor(sheet)
    begin = int(sheet.rng.uniform(0.2, 0.7) * sheet.rows)
    _forget(column, slice(begin, begin + int(sheet.rng.uniform(0.7, 2.0) * sheet.rate_hz)))


def overload(sheet):
    column = _sensor(sheet)
    rows = _rows(sheet, int(sheet.rng.integers(1, 6)))
    _forget(column, rows)
    _put(column, rows, _pick(sheet, "9.9E37", "+9.90000000E+37", "9.91e+37", "-9.9E37"))


def _far(column, code):
    own = from_si(column.values, column.unit)
    low, high = np.nanmin(own), np.nanmax(own)
    return max(code - high, low - code) > 40 * (high - low)


def absurd(sheet):
    """A code for no reading, taken as it is and told; left out where it is stated."""
    column, code = _sensor(sheet), _pick(sheet, -9999, -999, 65535, 99999, -32768)
    if not _far(column, code):
        return False
    rows = _rows(sheet, int(sheet.rng.integers(1, 6)))
    _put(column, rows, str(code))
    if _pick(sheet, True, False):
        sheet.options += ["--missing", str(code)]
        _forget(column, rows)
        return True
    column.values = column.values.copy()
    column.values[rows] = code * SIZES[column.unit] if column.unit not in WARMTHS else np.nan
    if column.unit in WARMTHS:
        factor, offset = WARMTHS[column.unit]
        column.values[rows] = (code - offset) / factor
    sheet.right.must.append("far from all others")
    sheet.right.compare_may.add("*")
    return True


def _wrap(column, span, low):
    column.span = span
    own = column.values
    wrapped = (own - low) % span + low
    column.cells = {}
    for row, value in enumerate(from_si(wrapped, column.unit)):
        if not np.isnan(value):
            column.cells[row] = f"{value:.{column.digits}g}"


def wrapped_angle(sheet):
    """Readings, and perhaps the command too, within a turn."""
    low = _pick(sheet, 0.0, -TURN / 2)
    both = _pick(sheet, True, False)
    for column in sheet.columns:
        if column.role == "sensor" or both:
            _wrap(column, TURN, low)
    sheet.right.must.append("it wraps at")


def wrapped_counter(sheet):
    (column,) = (c for c in sheet.columns if c.unit == "count")
    reach = float(np.ptp(column.values))
    bits = _pick(sheet, *[b for b in (12, 14, 16, 24, 32) if b <= 16 or reach < 2**b])
    if 2**bits < 50 * np.max(np.abs(np.diff(column.values))):
        bits = 24
    begin = _pick(sheet, 0.0, -(2.0 ** (bits - 1)))
    column.values = column.values + begin + 2.0**bits - reach / 2
    _wrap(column, 2.0**bits, begin)
    sheet.right.must.append("it wraps at")


def stuck(sheet):
    column = _sensor(sheet)
    begin = int(sheet.rng.uniform(0.2, 0.6) * sheet.rows)
    column.values = column.values.copy()
    column.values[begin : begin + int(0.15 * sheet.rows)] = column.values[begin]


def saturated(sheet):
    column = _sensor(sheet)
    low, high = np.nanmin(column.values), np.nanmax(column.values)
    column.values = np.clip(column.values, low, low + 0.8 * (high - low))


def rounded(sheet):
    column = _sensor(sheet)
    own = from_si(column.values, column.unit)
    step = 10.0 ** np.floor(np.log10(np.nanmax(own) - np.nanmin(own)) - 2)
    column.digits = 15
    size = SIZES.get(column.unit, 1.0)
    if column.unit in WARMTHS:
        return False
    column.values = np.round(own / step) * step * size
    return True


def off_by_a_factor(sheet):
    factor = _pick(sheet, 2.0, 0.5, 4.0, 25.4, 1 / 25.4, 10.0, 1e3, 1e-3, -1.0, 57.29577951)
    for column in sheet.sensors():
        column.values = column.values * factor
    sheet.right.must.append("sign is opposite" if factor < 0 else "times the command")
    sheet.right.compare_may.add("wrong-scale")


def late(sheet):
    delay = float(sheet.rng.uniform(0.25, 0.5))
    n = round(delay * sheet.rate_hz)
    for column in sheet.sensors():
        column.values = np.concatenate((np.full(n, column.values[0]), column.values[:-n]))
    sheet.right.must.append("after the command")


def empty_column(sheet):
    sheet.columns.append(Column("unused", "spare", "V", np.full(sheet.rows, np.nan)))


def exponents(sheet):
    for column in sheet.columns:
        column.form = "{:+.12E}"


def swapped(sheet):
    """The readings stand before what the machine was told."""
    sheet.columns = sheet.columns[::-1]


def told_on_changes(sheet):
    """The command stands in the rows in which it changes."""
    for column in sheet.columns:
        if column.role != "sensor":
            same = np.concatenate(([False], np.diff(column.values) == 0))
            _forget(column, same)


def uneven(sheet):
    """Intervals that vary by a third; the times are known."""
    sheet.time_s = sheet.time_s + sheet.rng.uniform(0, 0.3, sheet.rows) / sheet.rate_hz


def other_unit(sheet):
    for column in sheet.columns:
        if _pick(sheet, True, False):
            column.unit = _pick(sheet, *alike(column.unit))


# -- cells that cannot be read ------------------------------------------------------------


def bad_cell(sheet):
    column, row = _sensor(sheet), sheet.some_row(0.02, 0.98)
    word = _pick(sheet, "abc", "1.2.3", "#REF!", "0x1F", "12.3mm", "1..5", "OL", "--1")
    _put(column, [row], word)
    sheet.right.refusals.append(({"not-a-number"}, row))


def infinite(sheet):
    column, row = _sensor(sheet), sheet.some_row(0.02, 0.98)
    _put(column, [row], _pick(sheet, "inf", "-inf", "Infinity"))
    sheet.right.refusals.append(({"not-a-number"}, row))


def thousands(sheet):
    column, row = _sensor(sheet), sheet.some_row(0.02, 0.98)
    word = "1,234.5" if sheet.style.decimal == "." else "1.234,5"
    _put(column, [row], word)
    sheet.right.refusals.append(({"not-a-number", "bad-number"}, row))


def ragged(sheet):
    """A row in the middle that lacks cells."""
    row = sheet.some_row(0.02, 0.98)
    sheet.cut_rows = {row}
    sheet.right.refusals.append(({"wrong-cells"}, row))
