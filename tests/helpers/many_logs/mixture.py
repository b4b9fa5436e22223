"""Random mixtures of kinds of logs: which kinds there are, which go together, and the file."""

from dataclasses import dataclass

import numpy as np

from helpers.many_logs import clocks, readings, texts
from helpers.many_logs.machines import MACHINES
from helpers.many_logs.sheet import Sheet, name_columns, plain, text_of


@dataclass(frozen=True)
class Kind:
    """A kind of log: `change(sheet)` makes it, False where it cannot.

    Kinds of a lower `stage` come first. It goes with no other that `takes` the same, and with
    machines only that have its tag.
    """

    change: object
    stage: int
    takes: tuple[str, ...]
    tag: str = ""


def _kinds():
    made = {}

    def add(stage, takes, *changes, tag=""):
        for change in changes:
            made[change.__name__] = Kind(change, stage, tuple(takes.split()), tag)

    add(0, "order jump edges", clocks.recordings)
    add(1, "unit", readings.other_unit)
    add(2, "blank values", readings.missing, readings.blank_stretch)
    add(2, "blank word values", readings.missing_word, readings.overload)
    add(2, "word absurd values edges", readings.absurd)
    add(2, "values turn edges word", readings.wrapped_angle, tag="turns")
    add(2, "values edges word", readings.wrapped_counter, tag="counts")
    add(2, "values", readings.exponents)
    add(1, "columns", readings.swapped, readings.empty_column)
    add(2, "told turn", readings.told_on_changes)
    add(2, "clock", readings.uneven)
    add(2, "values", readings.stuck, readings.saturated)
    add(2, "values", readings.rounded)
    add(2, "values scale", readings.off_by_a_factor, tag="factor")
    # Over a pause of 72 h a delay is not looked for closely enough.
    add(2, "values scale pause", readings.late, tag="factor")
    add(2, "word unreadable", readings.bad_cell, readings.infinite, readings.ragged)
    add(5, "word unreadable quotes", readings.thousands)
    add(
        3, "clock", clocks.unit_of_time, clocks.epoch, clocks.time_of_day, clocks.twelve_hours,
        clocks.iso, clocks.two_parts, clocks.bare_clock,
        clocks.odd_named_clock, clocks.time_last,
    )  # fmt: skip
    add(3, "clock pause", clocks.date_and_time)
    add(3, "clock stamp", clocks.coarse, clocks.minutes_and_seconds)
    add(3, "clock order", clocks.float32_epoch, clocks.no_clock)
    add(3, "clock jump", clocks.changing_offset, clocks.end_of_summer, clocks.counter_wraps)
    add(3, "clock jump stamp edges", clocks.set_back)
    add(3, "clock units delimiter names order quotes binary words columns", clocks.two_clocks)
    add(4, "order stamp", clocks.duplicates, clocks.jitter)
    add(4, "order stamp jump", clocks.newest_first)
    add(4, "order clock", clocks.stray)
    add(4, "order unreadable", clocks.gap)
    add(5, "delimiter text", texts.semicolons, texts.other_delimiter)
    add(5, "quotes text", texts.quoted)
    add(5, "quotes delimiter text", texts.padded)
    add(5, "trailing text", texts.trailing)
    add(5, "units", texts.units_beside, texts.units_stated)
    add(5, "comment text", texts.comment)
    add(5, "above text", texts.facts_above, texts.separator)
    add(5, "trailing comment quotes text", texts.remarks)
    add(6, "names", texts.upper_case)
    add(
        6, "order between end words unreadable binary packed delimiter columns", texts.two_files,
        tag="files",
    )  # fmt: skip
    add(6, "between text", texts.notes, texts.blank_lines)
    add(5, "words", texts.column_of_words, texts.column_of_counts)
    add(5, "delimiter units names blank word unit absurd text", texts.lists)
    add(6, "end text", texts.cut_off, texts.no_last_newline, texts.last_line)
    add(5, "names", texts.odd_names)
    add(5, "bytes text", texts.utf16, texts.mark_of_utf8)
    add(5, "bytes text names", texts.windows)
    add(5, "ends text", texts.line_ends)
    add(6, "packed binary", texts.container)
    add(5, "text word units binary", texts.binary)
    return made


KINDS = _kinds()
_MOST = 4
# Share of the logs of a machine with kinds of its own that have one of them.
_OWN = 0.5


def chosen(rng, machine):
    """One to four kinds that go together, in the order in which they are made."""
    wanted, taken, found = int(rng.integers(1, _MOST + 1)), set(), []
    names = list(rng.permutation(list(KINDS)))
    # Kinds that few machines have would hardly be drawn.
    own = [name for name in names if KINDS[name].tag and KINDS[name].tag in machine.tags]
    if own and rng.random() < _OWN:
        names.insert(0, names.pop(names.index(own[0])))
    for name in names:
        kind = KINDS[name]
        text = "text" in kind.takes and name != "binary"
        own = set(kind.takes) - {"text"} | ({"is text"} if text else set())
        clash = own & (taken - {"is text"}) or (name == "binary" and "is text" in taken)
        clash = clash or (text and "binary" in found)
        if clash or (kind.tag and kind.tag not in machine.tags):
            continue
        taken |= own
        found.append(str(name))
        if len(found) == wanted:
            break
    return sorted(found, key=lambda name: KINDS[name].stage)


def drawn(seed):
    """The log of a seed: its sheet, the names of its kinds, its bytes."""
    rng = np.random.default_rng([57, seed])
    name = list(MACHINES)[seed % len(MACHINES)]
    sheet = Sheet(name, MACHINES[name], rng)
    kinds = [k for k in chosen(rng, sheet.machine) if KINDS[k].change(sheet) is not False]
    return sheet, kinds, finished(sheet)


def finished(sheet):
    """The bytes of each file of the log; headings and options are those of the file."""
    sheet.clock()
    name_columns(sheet)
    if sheet.odd:
        for column in sheet.columns:
            role = "--measured" if column.role == "sensor" else "--command"
            sheet.options += [role, column.heading] if column.role != "unused" else []
    if sheet.style.units == "none":
        _state_units(sheet)
    if sheet.split:
        return [text_of(sheet, role) for role in ("sensor", "command")]
    data = texts.binary_of(sheet) if sheet.style.suffix != ".csv" else text_of(sheet)
    return [sheet.packed(data) if sheet.packed else data]


def _state_units(sheet):
    for column in sheet.columns:
        if column.role != "unused":
            sheet.options += ["--unit", f"{column.heading}={column.unit}"]
    for one in sheet.clock():
        if len(sheet.clock()) == 1:
            sheet.options += ["--time", plain(one.heading, sheet.style)]
        if one.unit and "--time-unit" not in sheet.options:
            sheet.options += ["--time-unit", one.unit]
