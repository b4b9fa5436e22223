"""A log in memory on its way to a file: rows, stamps, style, and what is right to read from it."""

import re
from dataclasses import dataclass, field

import numpy as np

from helpers.many_logs.units import from_si


@dataclass
class Stamps:
    """A column of times: its heading, unit and cells (strings, one for each row of the arrays)."""

    heading: str
    unit: str
    cells: list[str]
    numeric: bool = True


@dataclass
class Style:
    """Layout of a text: encoding, delimiter, decimals, ends of lines."""

    delimiter: str = ","
    decimal: str = "."
    newline: str = "\n"
    encoding: str = "utf-8"
    mark: bytes = b""
    units: str = "[]"
    comment: str = ""
    above: tuple[str, ...] = ()
    quoted: bool = False
    trailing: str = ""
    last_newline: bool = True
    listed: bool = False
    padding: str = ""
    suffix: str = ".csv"


@dataclass
class Right:
    """The right reading of a log.

    `lost` are rows that must be left out, `lost_lines` lines that are no rows. `must` are words
    that a CHECK must say, `may` words of a CHECK that names a doubt which may make other data,
    `again` those that compare must repeat. `refusals` are (rules, row or None): any is right.
    """

    lost: set = field(default_factory=set)
    lost_lines: int = 0
    must: list = field(default_factory=list)
    may: list = field(default_factory=list)
    again: list = field(default_factory=list)
    refusals: list = field(default_factory=list)
    compare_may: set = field(default_factory=set)
    time_s: float = 2e-6
    turns_known: bool = True


class Sheet:
    """The rows of a machine's log: arrays of all recordings one after the other."""

    def __init__(self, name, machine, rng):
        self.name, self.machine, self.rng = name, machine, rng
        self.rate_hz = float(rng.choice([20, 25, 50, 50, 100, 100, 200, 33.3]))
        self.style, self.right = Style(), Right()
        self.options = list(machine.options)
        self.time_s, self.columns = self.recorded()
        self.recording = np.zeros(len(self.time_s), int)
        self.starts_s = [0.0]
        self.order = np.arange(len(self.time_s))
        self.stamps = None
        self.between = {}
        self.words = []
        self.line_of = {}
        self.stray, self.remarks = {}, {}
        self.cut_rows, self.cut_last = set(), False
        self.packed, self.odd, self.paired = None, False, False
        self.time_last, self.words_first, self.split = False, False, False

    def recorded(self):
        """Times (s) and columns of one recording of the machine."""
        seconds = float(self.rng.uniform(9, 14)) * max(1.0, 50 / self.rate_hz)
        times = np.arange(int(seconds * self.rate_hz)) / self.rate_hz
        return times, self.machine.make(self.rng, times)

    @property
    def rows(self):
        return len(self.time_s)

    @property
    def stamp_s(self):
        """Times of the log's own clock, which may begin again."""
        return self.time_s + np.array(self.starts_s)[self.recording]

    def sensors(self):
        return [c for c in self.columns if c.role == "sensor"]

    def some_row(self, low=0.1, high=0.9):
        """A row of the order of the file."""
        return int(self.order[int(self.rng.uniform(low, high) * len(self.order))])

    def clock(self):
        if self.stamps is None:
            cells = [f"{t:.6f}" for t in self.stamp_s]
            self.stamps = [Stamps("time", "s", cells)]
        return self.stamps


def cells_of(column):
    """The cells of a column: numbers in its unit, or the words that stand for them."""
    values = from_si(column.values, column.unit)
    form = column.form or f"{{:.{column.digits}g}}"
    cells = [column.blank if np.isnan(v) else form.format(v) for v in values]
    for row, word in (column.cells or {}).items():
        cells[row] = word
    return cells


def headed(name, unit, style):
    """The heading of a column in a style of units."""
    if not unit or style.units in ("line", "none"):
        return name
    if style.units == "suffix":
        return f"{name}_{unit.replace('/', '_')}".replace(" ", "_")
    if style.units == "blank":
        return f"{name} {unit}"
    left, right = style.units
    return f"{name} {left}{unit}{right}"


def columns_of(sheet, roles=None):
    """Headings, units, cells and whether they are numbers, in the file's order, of one role."""
    times = []
    for one in sheet.clock():
        cells = list(one.cells)
        for row, word in sheet.stray.items():
            cells[row] = word
        times.append((one.heading, one.unit, cells, one.numeric))
    found = [(c.name, c.unit, cells_of(c), True) for c in sheet.columns if roles in (None, c.role)]
    words = [(name, "", cells, False) for name, cells in sheet.words]
    if sheet.paired:
        return [*times, found[0], *words, found[1]]
    if sheet.time_last:
        return [*found, *words, *times]
    return [*words, *times, *found] if sheet.words_first else [*times, *found, *words]


def plain(text, style):
    """The text without blanks where they separate cells."""
    return text.replace(" ", "_") if style.delimiter == " " else text


def name_columns(sheet):
    """Write each column's heading as mopro calls it."""
    for column in sheet.columns:
        column.heading = plain(headed(column.name, column.unit, sheet.style), sheet.style)
    if sheet.style.listed:
        for nth, column in enumerate(sheet.sensors()):
            column.heading = f"q[{nth}] [{column.unit.replace('/', '_')}]"


def _with_list(sheet, found):
    """The sensors in one column of lists."""
    names = {c.name for c in sheet.sensors()}
    own = [n for n, (name, *_) in enumerate(found) if name in names]
    cells = [f"[{', '.join(parts)}]" for parts in zip(*(found[n][2] for n in own), strict=True)]
    kept = [one for n, one in enumerate(found) if n not in own]
    return [*kept, ("q", sheet.sensors()[0].unit, cells, False)]


class _Text:
    """The lines of a log, and the line of each row of the arrays."""

    def __init__(self, sheet, role):
        self.sheet, self.style = sheet, sheet.style
        self.found = columns_of(sheet, role)
        if self.style.listed:
            self.found = _with_list(sheet, self.found)
        if self.style.decimal == ",":
            self.found = [(h, u, list(map(_comma, c)) if n else c, n) for h, u, c, n in self.found]
        self.header = self._header()
        self.lines = [*self.style.above, self.header]
        if self.style.units == "line":
            self.lines.append(self.style.delimiter.join(u or "-" for _, u, *_ in self.found))

    def _header(self):
        style = self.style
        titles = [self._cell(headed(h, u, style), style.quoted) for h, u, *_ in self.found]
        tail = style.delimiter if style.trailing == "rh" else ""
        return style.comment + (style.delimiter + style.padding).join(titles) + tail

    def _cell(self, cell, always=False):
        delimiter = self.style.delimiter
        if always or (delimiter in cell and delimiter != " "):
            return f'"{cell}"'
        return plain(cell, self.style) or ("nan" if delimiter == " " else "")

    def _row(self, row):
        return [self._cell(c[row], self.style.quoted and not n) for _, _, c, n in self.found]

    def add_rows(self):
        sheet, tail = self.sheet, self.style.delimiter if self.style.trailing else ""
        for nth, row in enumerate(sheet.order):
            self._notes(nth)
            cells = self._row(row)
            sheet.line_of.setdefault(int(row), len(self.lines) + 1)
            cells = cells[:-1] if int(row) in sheet.cut_rows else cells
            line = (self.style.delimiter + self.style.padding).join(cells) + tail
            self.lines.append(line + self._remark(int(row)))
        self._notes(len(sheet.order))
        if sheet.cut_last:
            self.lines.append(self.style.delimiter.join(self._row(sheet.order[-1])[:-1]))

    def _remark(self, row):
        word = self.sheet.remarks.get(row)
        return "" if word is None else self.style.delimiter + plain(word, self.style)

    def _notes(self, nth):
        notes = self.sheet.between.get(nth, ())
        self.lines += [self.header if note == "HEADER" else note for note in notes]


def _comma(cell):
    return re.sub(r"^([-+\d]*)\.", r"\1,", cell)


def text_of(sheet, role=None):
    """The bytes of the log as a text, of one role or all; notes the line of each row."""
    text, style = _Text(sheet, role), sheet.style
    text.add_rows()
    written = style.newline.join(text.lines) + (style.newline if style.last_newline else "")
    return style.mark + written.encode(style.encoding)
