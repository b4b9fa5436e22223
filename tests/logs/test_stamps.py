"""Stamps as loggers write them: dates in many forms, in one column or several, of any name."""

import numpy as np
import pytest

from mopro.errors import DataError
from mopro.logs import Asked, read_log

START = np.datetime64("2026-11-22T19:30:54.100", "ms")
# Two stretches with 72 h between them.
ELAPSED_S = np.concatenate((np.arange(40) / 10, 72 * 3600 + np.arange(40) / 10))
STAMPS = START + (1000 * ELAPSED_S + 0.5).astype("timedelta64[ms]")

DATES = {
    "iso": "%Y-%m-%d",
    "slashes": "%Y/%m/%d",
    "points": "%d.%m.%Y",
    "short year": "%d.%m.%y",
    "British": "%d/%m/%Y",
    "American": "%m/%d/%Y",
    "dashes": "%d-%m-%Y",
    "name": "%d-%b-%Y",
    "words": "%b %d, %Y",
    "long": "%d %B %Y",
    "weekday": "%a, %d %b %Y",
    "compact": "%Y%m%d",
}
TIMES = {
    "24 h": "%H:%M:%S.%f",
    "comma": "%H:%M:%S,%f",
    "12 h": "%I:%M:%S.%f %p",
    "ms": "%H:%M:%S:%f",
}


def shown(form):
    return [
        s.astype(object).strftime(form.replace("%f", f"{int(s.astype(int) % 1000):03d}"))
        for s in STAMPS
    ]


@pytest.fixture
def log(tmp_path):
    def read(columns, delimiter=";", **asked):
        columns = {**columns, "pos_mm": [f"{n % 17 + n / 100:.2f}" for n in range(len(STAMPS))]}
        lines = [delimiter.join(row) for row in zip(*columns.values(), strict=True)]
        (tmp_path / "log.csv").write_text("\n".join([delimiter.join(columns), *lines]) + "\n")
        return read_log(tmp_path / "log.csv", Asked(**asked))

    return read


def clock_of(found, elapsed=ELAPSED_S):
    (name,) = found.clocks
    assert found.rows.used == len(elapsed)
    assert found.clocks[name] == pytest.approx(elapsed, abs=2e-3)
    assert [c.raw for c in found.columns] == ["pos_mm"]
    return found.origins[name]


HEADINGS = [("Date", "Time"), ("Datum", "Uhrzeit"), ("日付", "時刻")]
# A number of eight digits is a date by its heading only.
DATED = [(date, h) for date in DATES for h in HEADINGS if date != "compact" or h[0] == "Date"]


@pytest.mark.parametrize(("date", "headings"), DATED)
@pytest.mark.parametrize("time", TIMES)
def test_a_date_beside_a_time_of_day_makes_the_stamp(log, date, time, headings):
    found = log(dict(zip(headings, (shown(DATES[date]), shown(TIMES[time])), strict=True)))
    assert clock_of(found) == pytest.approx(START.astype(float) / 1e3, abs=1e-3)


@pytest.mark.parametrize("date", [d for d in DATES if d != "compact"])
@pytest.mark.parametrize("between", [" ", "T", "_"])
@pytest.mark.parametrize("heading", ["timestamp", "Zeitpunkt", "quando"])
def test_a_date_and_time_in_one_column(log, date, between, heading):
    words = shown(f"{DATES[date]}{between}{TIMES['24 h']}")
    assert clock_of(log({heading: words})) == pytest.approx(START.astype(float) / 1e3, abs=1e-3)


@pytest.mark.parametrize(
    ("first", "check", "day"),
    [("03/04/2026", True, 3), ("13/04/2026", False, 13), ("04/13/2026", False, 13)],
)
def test_which_number_is_the_day_is_decided_by_the_cells_or_told(log, first, check, day):
    words = [f"{first} 10:00:{n / 10:06.3f}" for n in range(80)]
    found = log({"stamp": words})
    origin = np.datetime64(int(clock_of(found, np.arange(80) / 10)), "s")
    assert origin.astype(object).day == day
    assert [d.check for d in found.decisions if "h first" in str(d) or "y first" in str(d)] == [
        check
    ]


def test_days_that_follow_each_other_tell_which_number_is_the_day(log):
    words = [f"03/{4 + n // 40:02d}/2026 10:00:{n % 40:02d}" for n in range(80)]
    elapsed = np.arange(80) % 40 + 86400.0 * (np.arange(80) // 40)
    found = log({"stamp": words})
    assert np.datetime64(int(clock_of(found, elapsed)), "s").astype(object).month == 3


@pytest.mark.parametrize("zones", [("+02:00", "+01:00"), ("-0500", "-0600"), ("+01", "Z")])
def test_stamps_whose_offset_changes(log, zones):
    hours = {"+02:00": 2, "+01:00": 1, "-0500": -5, "-0600": -6, "+01": 1, "Z": 0}
    words = []
    for n, stamp in enumerate(STAMPS):
        zone = zones[n >= 20]
        words.append(f"{stamp + np.timedelta64(hours[zone], 'h')}{zone}")
    assert clock_of(log({"time": words})) == pytest.approx(START.astype(float) / 1e3, abs=1e-3)


@pytest.mark.parametrize(
    ("whole", "part", "per_s"),
    [
        ("sec", "nsec", 1e9),
        ("header.stamp.sec", "header.stamp.nanosec", 1e9),
        ("field.header.stamp.secs", "field.header.stamp.nsecs", 1e9),
        ("Time_s", "Time_ms", 1e3),
        ("time [s]", "time [us]", 1e6),
        ("t_s", "micros", 1e6),
        ("tv_sec", "tv_usec", 1e6),
    ],
)
@pytest.mark.parametrize("start", [0, 1_790_000_000])
@pytest.mark.parametrize("rate_hz", [10, 200])
def test_two_columns_are_one_stamp(log, whole, part, per_s, start, rate_hz):
    ticks = np.arange(len(STAMPS)) + 37
    seconds, rest = ticks // rate_hz, ticks % rate_hz
    columns = {whole: [str(start + s) for s in seconds],
               part: [str(int(r * per_s / rate_hz)) for r in rest]}  # fmt: skip
    if seconds[-1] == seconds[0]:
        return
    found = log(columns)
    assert clock_of(found, np.arange(len(STAMPS)) / rate_hz) == pytest.approx(start + 37 / rate_hz)


def test_a_time_of_day_with_its_milliseconds_in_another_column(log):
    words = shown("%H:%M:%S")
    rest = [str(int(s.astype(int) % 1000)) for s in STAMPS]
    clock_of(log({"Date": shown("%Y-%m-%d"), "Time": words, "ms": rest}))


def test_two_columns_named_time(log):
    found = log({"Time": shown("%H:%M:%S.%f")[:40] * 2, "x": ["1"] * 80, "Time ": ["2"] * 80})
    assert found.rows.read == 80


@pytest.mark.parametrize("heading", ["Zeit", "temps", "X_Value", "elapsed [ms]", "czas [s]", "A"])
def test_numbers_that_ascend_as_a_clock_are_one_by_any_name(log, heading):
    scale = 1000 if "ms" in heading else 1
    found = log({heading: [f"{scale * n / 10:.4f}" for n in range(80)]})
    clock_of(found, np.arange(80) / 10)
    if heading in ("temps", "X_Value", "A"):
        assert any(d.check for d in found.decisions)


@pytest.mark.parametrize("heading", ["sample", "command", "x"])
def test_what_may_be_no_clock_asks(log, heading):
    with pytest.raises(DataError, match="no column of times"):
        log({heading: [str(n) for n in range(80)]})


@pytest.mark.parametrize(
    "bad",
    [
        "32.11.2026 10:00:00",
        "22.13.2026 10:00:00",
        "22.11.2026 59:00:00",
        "22.11.2026 10:61:00",
        "22.11.2026",
        "x",
    ],
)
def test_a_stamp_that_is_none_is_named_with_its_line(log, bad):
    words = shown("%d.%m.%Y %H:%M:%S.%f")
    words[5] = bad
    if bad == "22.11.2026":
        assert log({"time": words}).rows.read == 80
        return
    with pytest.raises(DataError, match=r"log.csv:7:1"):
        log({"time": words})


def test_two_clocks_named_time_each_have_their_columns(tmp_path):
    rows = [f"{n / 10},{n},{n / 5 + 3},{-n}" for n in range(50)]
    (tmp_path / "log.csv").write_text("\n".join(["Time,x,Time,y", *rows]) + "\n")
    found = read_log(tmp_path / "log.csv")
    assert [(c.raw, c.clock) for c in found.columns] == [("x", "Time"), ("y", "Time (2)")]
    assert found.origins == {"Time": 0.0, "Time (2)": 3.0}


def test_a_date_in_digits_is_one_under_any_name(log):
    dates = [s[:8] for s in shown("%Y%m%d")]
    times = shown("%H:%M:%S.%f")
    clock_of(log({"Datum": dates, "Uhrzeit": times}))


@pytest.mark.parametrize("digits", ["20261399", "20260100", "20260732.5", "19000101"])
def test_digits_that_are_no_date_are_readings(log, digits):
    found = log({"serial": [digits] * len(STAMPS), "Uhrzeit": shown("%H:%M:%S.%f")})
    assert [c.raw for c in found.columns] == ["serial", "pos_mm"]


@pytest.mark.parametrize("mark", [".", ","])
def test_minutes_and_seconds_go_on_over_the_hour(tmp_path, mark):
    """As Excel saves times of day that it shows without their hours."""
    ticks = 35_900 + np.arange(300)
    cells = [f"{t // 600 % 60:02}:{t // 10 % 60:02}{mark}{t % 10}" for t in ticks]
    rows = [f"{c};{n}" for n, c in enumerate(cells)]
    (tmp_path / "log.csv").write_text("\n".join(["Time;x_mm", *rows]) + "\n")
    found = read_log(tmp_path / "log.csv")
    assert found.recordings == 1
    assert found.clocks["Time"] == pytest.approx(np.arange(300) / 10, abs=1e-6)


@pytest.mark.parametrize("heading", ["Time [ms]", "Time (ms)", "Time_ms"])
def test_a_second_column_of_the_same_times_is_the_same_clock(tmp_path, heading):
    rows = [f"{10 * n},{n},{10 * n},{-n}," for n in range(100)]
    text = "\n".join([f"{heading},a_mm,{heading},b_mm", *rows]) + "\n"
    (tmp_path / "log.csv").write_text(text)
    found = read_log(tmp_path / "log.csv")
    assert list(found.clocks) == [heading]
    assert found.clocks[heading] == pytest.approx(np.arange(100) / 100)
    assert [c.raw for c in found.columns] == ["a_mm", "b_mm"]
    assert not any(d.check for d in found.decisions)


def test_a_second_column_of_times_has_the_unit_of_its_heading(tmp_path):
    rows = [f"{10 * n},{n},{10 * n + 3},{-n}" for n in range(100)]
    text = "\n".join(["Time [ms],a_mm,Time [ms],b_mm", *rows]) + "\n"
    (tmp_path / "log.csv").write_text(text)
    found = read_log(tmp_path / "log.csv")
    assert [own[-1] for own in found.clocks.values()] == pytest.approx([0.99, 0.99])


def test_blanks_before_the_cells_of_a_date_and_a_time(log):
    dates = [f"  {d}" for d in shown("%d.%m.%Y")]
    clock_of(log({"Date": dates, "Time": [f"   {t} " for t in shown("%H:%M:%S.%f")]}))


@pytest.mark.parametrize("words", [(), ("runs",), ("runs", "ok")])
@pytest.mark.parametrize("delimiter", ["\t", ";", ",", "|"])
def test_the_blank_in_a_stamp_parts_no_cells(tmp_path, delimiter, words):
    stamps = [str(START + np.timedelta64(100 * n, "ms")).replace("T", " ") for n in range(400)]
    rows = [delimiter.join((stamp, f"{n}", "nan", *words)) for n, stamp in enumerate(stamps)]
    names = ("time", "x [mm]", "y [mm]", *(f"state {n}" for n in range(len(words))))
    text = "\n".join([delimiter.join(names), *rows]) + "\n"
    (tmp_path / "log.csv").write_text(text)
    clock = read_log(tmp_path / "log.csv").clocks["time"]
    assert clock == pytest.approx(np.arange(400) / 10, abs=2e-3)
