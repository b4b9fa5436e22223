"""Kinds of clocks and of orders of rows, as loggers write them."""

import numpy as np

from helpers.many_logs.machines import Column
from helpers.many_logs.sheet import Stamps

EPOCH_S = 1_790_000_000
_ANY_NAMES = ("Uhrzeit", "zeitpunkt", "czas", "час", "時刻", "Heure", "when", "Time")


def _pick(sheet, *choices):
    return choices[int(sheet.rng.integers(len(choices)))]


def _whole(sheet, per_s):
    """Stamps in whole units; the truth is what they say."""
    return np.round(sheet.stamp_s * per_s)


def unit_of_time(sheet):
    name, unit, per_s, form = _pick(
        sheet, ("time", "ms", 1e3, "{:.3f}"), ("t", "us", 1e6, "{:.0f}"),
        ("elapsed time", "min", 1 / 60, "{:.10f}"), ("timestamp", "ns", 1e9, "{:.0f}"),
        ("t", "h", 1 / 3600, "{:.12f}"), ("uptime", "ms", 1e3, "{:.1f}"),
    )  # fmt: skip
    sheet.right.time_s = 1e-4
    sheet.stamps = [Stamps(name, unit, [form.format(v) for v in sheet.stamp_s * per_s])]


def epoch(sheet):
    per_s, form = _pick(sheet, (1, "{:.6f}"), (1e3, "{:.0f}"), (1e6, "{:.0f}"), (1e9, "int"))
    sheet.right.time_s = 1.1e-3 if per_s == 1e3 else 1e-5
    begin = EPOCH_S + int(sheet.rng.integers(10**7))
    values = begin + sheet.stamp_s
    if form == "int":
        cells = [f"{begin + int(s // 1)}{round(s % 1 * 1e9):09d}" for s in sheet.stamp_s]
    else:
        cells = [form.format(v * per_s) for v in values]
    sheet.stamps = [Stamps(_pick(sheet, "timestamp", "ts", "unix time", "stamp"), "", cells)]


def _dates(sheet, first, digits):
    """Dates with times of all rows from a first one, as numpy has them, with digits after it."""
    per_s = 10**digits
    ticks = np.floor(sheet.stamp_s * per_s + 1e-6).astype(np.int64)
    sheet.right.time_s = 1.1 / per_s
    unit = {0: "s", 3: "ms", 6: "us"}[digits]
    return np.datetime64(first, unit) + ticks.astype(f"timedelta64[{unit}]")


def time_of_day(sheet):
    first = _pick(sheet, "2026-11-22T23:59:56", "2026-11-22T09:12:01", "2026-11-22T00:00:00")
    stamps = _dates(sheet, first, _pick(sheet, 3, 6))
    cells = [str(s).split("T")[1] for s in stamps]
    if _pick(sheet, True, False, False):
        cells = [c.replace(".", ",") for c in cells]
    sheet.stamps = [Stamps(_pick(sheet, *_ANY_NAMES), "", cells, numeric=False)]
    if first.endswith("59:56"):
        sheet.right.may.append("midnight")


def twelve_hours(sheet):
    first = _pick(sheet, "2026-11-22T11:59:55", "2026-11-22T23:59:55", "2026-11-22T07:00:00")
    cells = []
    for s in _dates(sheet, first, 3):
        hour, rest = str(s).split("T")[1].split(":", 1)
        cells.append(f"{(int(hour) - 1) % 12 + 1}:{rest} {'AM' if int(hour) < 12 else 'PM'}")
    sheet.stamps = [Stamps(_pick(sheet, *_ANY_NAMES), "", cells, numeric=False)]


def iso(sheet):
    zone = _pick(sheet, "", "Z", "+01:00", "-0530")
    between = _pick(sheet, "T", " ")
    stamps = _dates(sheet, "2026-07-01T08:30:00", _pick(sheet, 3, 6))
    cells = [str(s).replace("T", between) + zone for s in stamps]
    sheet.stamps = [Stamps(_pick(sheet, *_ANY_NAMES), "", cells, numeric=False)]


def changing_offset(sheet):
    stamps = _dates(sheet, "2026-10-25T02:59:57", 3)
    hour = np.timedelta64(3_600_000, "ms")
    late = sheet.stamp_s > 3
    cells = [f"{s - hour}+01:00" if w else f"{s}+02:00" for s, w in zip(stamps, late, strict=True)]
    sheet.stamps = [Stamps("time", "", cells, numeric=False)]


def end_of_summer(sheet):
    stamps = _dates(sheet, "2026-10-25T02:59:57", 3)
    late = sheet.stamp_s >= 3
    hour = np.timedelta64(3_600_000, "ms")
    cells = [str(s - hour if w else s).replace("T", " ") for s, w in zip(stamps, late, strict=True)]
    sheet.stamps = [Stamps("local time", "", cells, numeric=False)]
    sheet.right.must.append("an hour")
    sheet.right.again.append("an hour")


_MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]


def date_and_time(sheet):
    form = _pick(sheet, "iso", "de", "us", "name", "compact")
    if _pick(sheet, True, False):
        # `compare` integrates a machine through its pauses: 72 h of an axis take minutes.
        pause_s = 259_200 if sheet.machine.kind == "kinematic" else 600
        sheet.time_s = sheet.time_s + np.where(sheet.time_s > 5, pause_s, 0)
    stamps = _dates(sheet, "2026-11-22T15:30:00", 3)
    dates = []
    for s in stamps:
        y, m, d = str(s)[:10].split("-")
        dates.append({
            "iso": f"{y}-{m}-{d}", "de": f"{d}.{m}.{y}", "us": f"{m}/{d}/{y}",
            "name": f"{d}-{_MONTHS[int(m) - 1]}-{y}", "compact": f"{y}{m}{d}",
        }[form])  # fmt: skip
    times = [str(s)[11:] for s in stamps]
    names = _pick(sheet, ("Date", "Time"), ("Datum", "Uhrzeit"), ("date", "clock"))
    sheet.stamps = [Stamps(names[0], "", dates, False), Stamps(names[1], "", times, False)]


def coarse(sheet):
    tick = _pick(sheet, 1.0, 1.0, 0.1) if sheet.rate_hz > 20 else 1.0
    sheet.time_s = sheet.time_s + float(sheet.rng.uniform(0, 0.9)) * tick
    stamps = np.floor(sheet.stamp_s / tick + 1e-9) * tick
    how = _pick(sheet, "s", "epoch", "day", "iso") if tick == 1.0 else "s"
    if how in ("s", "epoch"):
        begin = EPOCH_S if how == "epoch" else 0
        cells = [f"{begin + v:.{0 if tick == 1 else 1}f}" for v in stamps]
        sheet.stamps = [Stamps("time", "s" if how == "s" else "", cells)]
    else:
        dates = np.datetime64("2026-11-22T19:30:00") + stamps.astype("timedelta64[s]")
        cells = [str(d).replace("T", " ")[11 if how == "day" else 0 :] for d in dates]
        sheet.stamps = [Stamps("time", "", cells, numeric=False)]
    sheet.right.must.append("spread evenly")
    sheet.right.again.append("spread evenly")
    sheet.right.time_s = 1.01 * tick


def float32_epoch(sheet):
    cells = [f"{np.float32(EPOCH_S + v):.0f}" for v in sheet.stamp_s]
    sheet.stamps = [Stamps("timestamp", "s", cells)]
    sheet.right.refusals.append(({"clock", "which-time"}, None))


def two_parts(sheet):
    (whole, finer), per_s = _pick(
        sheet, (("header.stamp.sec", "header.stamp.nanosec"), 1e9), (("sec", "nsec"), 1e9),
        (("tv_sec", "tv_usec"), 1e6), (("seconds", "milliseconds"), 1e3),
        (("time_s", "time_us"), 1e6),
    )  # fmt: skip
    begin = int(_pick(sheet, 0, EPOCH_S, 17))
    ticks = np.round(sheet.stamp_s * per_s).astype(np.int64)
    n = int(per_s)
    sheet.right.time_s = 1.1 / per_s + 1e-6
    sheet.stamps = [
        Stamps(whole, "", [str(begin + t // n) for t in ticks]),
        Stamps(finer, "", [str(t % n) for t in ticks]),
    ]


def counter_wraps(sheet):
    choices = [("ms", 32, 1e3), ("ms", 16, 1e3), ("us", 32, 1e6)]
    unit, bits, per_s = _pick(sheet, *choices)
    ticks = np.round(sheet.stamp_s * per_s)
    begin = 2**bits - round(float(sheet.rng.uniform(0.3, 0.7)) * ticks[-1])
    cells = [f"{(begin + t) % 2**bits:.0f}" for t in ticks]
    sheet.stamps = [Stamps(_pick(sheet, "time", "millis", "tick time"), unit, cells)]
    sheet.right.must.append("its counter wrapped")
    sheet.right.time_s = 1.1e-3


def set_back(sheet):
    back = float(sheet.rng.uniform(0.5, 3.0))
    at = float(sheet.rng.uniform(0.6, 0.8)) * sheet.time_s[-1]
    cells = [f"{t - (back if t >= at else 0):.6f}" for t in sheet.stamp_s]
    sheet.stamps = [Stamps("time", "s", cells)]
    sheet.right.must.append("was set back")
    sheet.right.again.append("was set back")
    sheet.right.may.append("recordings of")
    sheet.right.time_s = 0.6 / sheet.rate_hz


def no_clock(sheet):
    sheet.stamps = []
    sheet.options += ["--rate", f"{sheet.rate_hz:g}"]


def bare_clock(sheet):
    if _pick(sheet, True, False):
        sheet.stamps = [Stamps("time", "", [f"{t:.6f}" for t in sheet.stamp_s])]
        sheet.right.must.append("no unit is stated")
    else:
        cells = [f"{t:.1f}" for t in 1e3 * sheet.stamp_s]
        sheet.right.time_s = 1e-4
        sheet.stamps = [Stamps(_pick(sheet, "t", "time"), "", cells)]
        sheet.options += ["--time-unit", "ms"]


def odd_named_clock(sheet):
    sheet.stamps = [
        Stamps(_pick(sheet, "Zp", "時間", "кадр"), "s", [f"{t:.6f}" for t in sheet.stamp_s])
    ]


def two_clocks(sheet):
    """A second column Time of the same times: behind the others, or before each column its own."""
    unit, per_s = _pick(sheet, ("s", 1), ("ms", 1e3))
    cells = [f"{t * per_s:.6f}" for t in sheet.stamp_s]
    sheet.stamps = [Stamps("Time", unit, cells)]
    sheet.paired = len(sheet.columns) == 2 and bool(_pick(sheet, True, False))
    sheet.words.append((f"Time [{unit}]", cells))


def minutes_and_seconds(sheet):
    """As Excel shows times of day when it saves a CSV: the hours are gone."""
    ticks = np.floor(10 * sheet.stamp_s + 1e-6).astype(int) + 7000
    cells = [f"{t // 600 % 60:02}:{t // 10 % 60:02}.{t % 10}" for t in ticks]
    sheet.stamps = [Stamps("Time", "", cells, numeric=False)]
    sheet.right.may.append("spread evenly")
    sheet.right.time_s = 0.11


def time_last(sheet):
    sheet.time_last = True


# -- orders -------------------------------------------------------------------------------


def recordings(sheet):
    again = int(_pick(sheet, 1, 1, 2))
    same, heading = _pick(sheet, True, False, False), _pick(sheet, True, False)
    mirrored = not same and sheet.machine.kind == "kinematic" and _pick(sheet, True, False)
    parts = [(sheet.time_s, sheet.columns)]
    for _ in range(again):
        parts.append(parts[0] if same else sheet.recorded())
        if mirrored:
            _mirror(parts[-1][1])
    start = float(_pick(sheet, 0.0, 0.0, 5.0))
    sheet.starts_s = [
        start,
        *(_pick(sheet, start, start + 0.0037, start - 0.5) for _ in range(again)),
    ]
    if start == 0:
        sheet.starts_s = [abs(s) for s in sheet.starts_s]
    edges = np.cumsum([len(t) for t, _ in parts])[:-1]
    sheet.recording = np.repeat(np.arange(again + 1), [len(t) for t, _ in parts])
    sheet.time_s = np.concatenate([t for t, _ in parts])
    sheet.columns = [
        Column(one.role, one.name, one.unit, np.concatenate([c[n].values for _, c in parts]))
        for n, one in enumerate(sheet.columns)
    ]
    sheet.order = np.arange(len(sheet.time_s))
    if heading:
        for edge in edges:
            sheet.between.setdefault(int(edge), []).append("HEADER")
        sheet.right.lost_lines += again
    sheet.right.must.append(f"{again + 1} recordings of")
    sheet.right.again.append(f"{again + 1} recordings of")


def _mirror(columns):
    for column in columns:
        column.values = -column.values


def duplicates(sheet):
    twice = sheet.rng.random(len(sheet.order)) < _pick(sheet, 0.01, 0.1, 1.0)
    sheet.order = np.repeat(sheet.order, 1 + twice)


def jitter(sheet):
    n = len(sheet.order)
    late = 2.5 * sheet.rng.random(n) * (sheet.rng.random(n) < 0.02)
    sheet.order = sheet.order[np.argsort(np.arange(n) + late, kind="stable")]


def stray(sheet):
    row = sheet.some_row()
    sheet.clock()
    sheet.stray[row] = f"{_pick(sheet, 0.0, 90_000.0, 5e6):.6f}"
    sheet.right.lost.add(row)


def gap(sheet):
    begin = int(sheet.rng.uniform(0.2, 0.7) * len(sheet.order))
    wide = int(sheet.rng.uniform(0.5, 2.0) * sheet.rate_hz)
    sheet.order = np.delete(sheet.order, slice(begin, begin + wide))
    if any(column.span for column in sheet.columns):
        sheet.right.turns_known = False
        sheet.right.must.append("the turns in a gap of the readings are not known")


def newest_first(sheet):
    sheet.order = sheet.order[::-1]
    sheet.right.must.append("read from the end")
    sheet.right.again.append("read from the end")
