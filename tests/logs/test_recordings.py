"""The order of rows: recordings, clocks that wrap or are set, jitter, coarse stamps, the ledger."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mopro.errors import DataError
from mopro.logs import Asked, Rows, read_log

RATE_HZ = 100.0


def moved(times):
    return 10 * np.sin(times) + 3 * np.sin(2.7 * times)


@pytest.fixture
def log(tmp_path):
    def read(stamps, values=None, heading="time_s", form="{:.6f}", **asked):
        values = moved(np.arange(len(stamps)) / RATE_HZ) if values is None else values
        cells = [s if isinstance(s, str) else form.format(s) for s in stamps]
        rows = [f"{cell},{value:.5f}" for cell, value in zip(cells, values, strict=True)]
        (tmp_path / "log.csv").write_text("\n".join([f"{heading},pos_mm", *rows]) + "\n")
        return read_log(tmp_path / "log.csv", Asked(**asked))

    return read


def said(log, words):
    return [d for d in log.decisions if words in str(d)]


@pytest.mark.parametrize("starts_s", [(0.0, 0.0037), (0.0, 0.0), (5.0, 5.0, 5.2), (3.0, 1.0, 2.0)])
@pytest.mark.parametrize("lengths", [(1200, 1200, 1200), (400, 1500, 90)])
def test_a_jump_back_begins_a_recording_in_the_order_of_the_file(log, starts_s, lengths):
    times = [s + np.arange(n) / RATE_HZ for s, n in zip(starts_s, lengths, strict=False)]
    rng = np.random.default_rng(1)
    values = [rng.normal(size=len(own)) + 10 * n for n, own in enumerate(times)]
    found = log(np.concatenate(times), np.concatenate(values))
    assert found.recordings == len(times)
    assert (found.rows.read, found.rows.used) == (len(np.concatenate(times)),) * 2
    assert np.all(np.diff(found.clocks["time_s"]) > 0)
    (told,) = said(found, "recordings of")
    assert told.check
    assert told.lasting
    for nth, (own, expected) in enumerate(zip(times, values, strict=True)):
        part = found.recording(nth)
        assert part.columns[0].values == pytest.approx(expected, abs=1e-4)
        assert part.clocks["time_s"] == pytest.approx(own - own[0], abs=1e-5)
        assert part.origins["time_s"] == pytest.approx(own[0], abs=1e-5)
        assert part.line_of(0) == 2 + sum(lengths[:nth])


def counted(per_s, bits, begin_s, gap_s, signed=False, at=600, rows=1200):
    """Stamps of a counter with a gap after row `at`, and the times (s) that they tell."""
    times = np.arange(rows) / RATE_HZ
    times[at:] += gap_s
    counts = np.round((begin_s + times) * per_s) % 2**bits
    return np.where(signed & (counts >= 2 ** (bits - 1)), counts - 2**bits, counts), times


GAPS = [("us", 32, 1e6, 0.3), ("us", 32, 1e6, 30.0), ("ms", 32, 1e3, 9000.0), ("ms", 16, 1e3, 0.5)]


@pytest.mark.parametrize(("unit", "bits", "per_s", "gap_s"), GAPS)
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_counter_that_wraps_in_a_gap_goes_on(log, unit, bits, per_s, gap_s, signed, share):
    begin_s = 2.0**bits / per_s * (0.5 if signed else 1) - 5.99 - share * gap_s
    counts, times = counted(per_s, bits, begin_s, gap_s, signed)
    found = log(counts, heading=f"time_{unit}", form="{:.0f}")
    assert found.recordings == 1
    assert found.clocks[f"time_{unit}"] == pytest.approx(times, abs=1.1 / per_s)
    (told,) = said(found, "its counter wrapped in a gap of")
    assert (told.check, told.lasting) == (True, True)


@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_may_wrap_twice_each_time_in_a_gap(log, signed):
    # Each row of 100 s, with half a second more where the counter wraps.
    times = np.arange(1100) / 10.0
    begin_s = 40.0
    for wrap in (1, 2):
        times[(begin_s + times) > 65.536 * wrap - 0.2] += 0.4
    counts = np.round((begin_s + times) * 1e3) % 2**16
    counts = np.where(signed & (counts >= 2**15), counts - 2**16, counts)
    found = log(counts, moved(times), heading="time_ms", form="{:.0f}")
    assert found.recordings == 1
    assert found.clocks["time_ms"] == pytest.approx(times, abs=1.1e-3)


@pytest.mark.parametrize(
    ("begin_s", "gap_s", "form", "again_s"),
    [
        (59.3, 3.0, "{:.0f}", None),  # too long a gap for so short a range
        (0.0, 0.2, "{:.0f}", 0.0),  # the log began at zero, too
        (0.1, 0.2, "{:.0f}", 0.2),
        (59.3, 0.5, "{:.1f}", None),  # fractions are no counts
    ],
)
def test_what_may_be_another_recording_is_told_as_one(log, begin_s, gap_s, form, again_s):
    rows, at = (1200, 600) if again_s is None else (7000, 6540)
    counts, _ = counted(1e3, 16, begin_s, gap_s, at=at, rows=rows)
    if again_s is not None:
        counts[at:] = 1e3 * (again_s + np.arange(rows - at) / RATE_HZ)
    values = np.random.default_rng(1).normal(size=rows) + 10 * (np.arange(rows) >= at)
    found = log(counts + (0.3 if form == "{:.1f}" else 0), values, heading="time_ms", form=form)
    assert found.recordings == 2
    assert not said(found, "its counter wrapped")


@pytest.mark.parametrize(
    ("unit", "bits", "per_s"),
    [("us", 32, 1e6), ("ms", 32, 1e3), ("ms", 16, 1e3), ("us", 16, 1e6)],
)
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_that_wraps_goes_on(log, unit, bits, per_s, signed):
    rate_hz = 1000.0 if (unit, bits) == ("us", 16) else RATE_HZ
    ticks = 2**bits - 300 * per_s / rate_hz + np.arange(1000) * per_s / rate_hz
    ticks %= 2**bits
    if signed:
        ticks = (ticks + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)
    found = log(ticks, heading=f"time_{unit}", form="{:.0f}", time_unit=unit)
    assert found.recordings == 1
    assert np.diff(found.clocks[f"time_{unit}"]) == pytest.approx(1 / rate_hz, abs=1e-5)
    if np.any(np.diff(ticks) < 0):
        assert said(found, "its counter wrapped")[0].check


@pytest.mark.parametrize("when", ["end of summer time", "midnight", "noon of 12 h"])
def test_a_clock_of_the_wall_goes_on(log, when):
    start = {"end of summer time": "2026-10-25T02:59:58", "midnight": "2026-10-25T23:59:58"}
    first = np.datetime64(start.get(when, "2026-10-25T11:59:58"), "ms")
    stamps = first + (1000 * np.arange(800) / RATE_HZ).astype("timedelta64[ms]")
    words = [str(s).replace("T", " ") for s in stamps]
    if when == "end of summer time":
        words[200:] = [str(s - np.timedelta64(1, "h")).replace("T", " ") for s in stamps[200:]]
    if when == "midnight":
        words = [w.split()[1] for w in words]
    if when == "noon of 12 h":
        words = [w.split()[1] for w in words]
        words = [w + (" AM" if n < 200 else " PM") for n, w in enumerate(words)]
    found = log(words, heading="Uhrzeit")
    assert found.recordings == 1
    assert found.clocks["Uhrzeit"] == pytest.approx(np.arange(800) / RATE_HZ, abs=2e-3)
    if when == "end of summer time":
        assert said(found, "an hour")[0].lasting


@pytest.mark.parametrize("back_s", [0.05, 0.5, 3.0])
def test_a_clock_that_is_set_back_while_the_machine_goes_on_is_told(log, back_s):
    times = np.arange(2000) / RATE_HZ
    stamps = np.where(times < 15, times, times - back_s)
    found = log(stamps, moved(times))
    assert found.recordings == 1
    assert found.clocks["time_s"] == pytest.approx(times, abs=1e-4)
    assert said(found, "was set back")[0].lasting
    assert found.rows.used == 2000


@pytest.mark.parametrize("seed", range(5))
def test_jitter_is_sorted_and_told(log, seed):
    rng = np.random.default_rng(seed)
    times = np.arange(1000) / RATE_HZ
    late = np.argsort(np.arange(1000) + 2.5 * rng.random(1000) * (rng.random(1000) < 0.02))
    found = log(times[late], moved(times)[late])
    assert found.recordings == 1
    assert found.columns[0].values == pytest.approx(moved(times), abs=1e-4)
    assert found.rows.used == 1000
    assert not any(d.check for d in found.decisions)


@pytest.mark.parametrize(("row", "stamp"), [(500, 0.0), (500, 9000.0), (1, 90.0), (998, 1.0)])
def test_one_stamp_that_is_out_of_place_is_left_out(log, row, stamp):
    times = np.arange(1000) / RATE_HZ
    stamps = times.copy()
    stamps[row] = stamp
    found = log(stamps, moved(times))
    assert found.recordings == 1
    assert found.rows.as_json()["left_out"] == [{"why": "whose time is out of place", "count": 1}]
    assert found.clocks["time_s"] == pytest.approx(np.delete(times, row), abs=1e-6)


@pytest.mark.parametrize("rate_hz", [10.0, 7.3, 3.0, 48.0])
@pytest.mark.parametrize("kind", ["seconds", "date", "of day", "float32"])
def test_stamps_coarser_than_the_sampling_are_spread(log, rate_hz, kind):
    times = 0.4 / rate_hz + np.arange(600) / rate_hz
    stamps = np.floor(times)
    tick = 1.0
    if kind == "float32":
        times = np.arange(60_000) / rate_hz
        stamps = (1.6e9 + times).astype(np.float32).astype(float)
        tick = 128.0
    elif kind != "seconds":
        dates = np.datetime64("2026-11-22T19:30:00") + stamps.astype("timedelta64[s]")
        stamps = [str(d).replace("T", " ")[11 if kind == "of day" else 0 :] for d in dates]
    found = log(stamps, moved(times), heading="time", form="{:.0f}")
    (told,) = said(found, "spread evenly")
    assert told.lasting
    assert f"over {tick:g} s" in told.taken_as
    assert found.rows.used == len(times)
    within = found.clocks["time"] - (times - times[0])
    assert np.ptp(within) < (0.02 if kind == "float32" else 1.0) / rate_hz * 60


def test_stamps_that_are_all_the_same_ask_for_the_rate(log):
    with pytest.raises(DataError, match="--rate HZ"):
        log([5.0] * 50 + [6.0] * 50)


def test_rows_that_are_written_twice_are_one(log):
    times = np.arange(500) / RATE_HZ
    found = log(np.repeat(times, 2), np.repeat(moved(times), 2))
    assert found.clocks["time_s"] == pytest.approx(times)
    assert said(found, "500 rows are one with the next row")


def test_rows_of_one_time_with_a_reading_each_keep_both(tmp_path):
    rows = [f"{n / 10},{n},\n{n / 10},,{-n}" for n in range(50)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,x_mm,y_mm", *rows]) + "\n")
    found = read_log(tmp_path / "log.csv")
    assert found.columns[0].values.tolist() == list(range(50))
    assert (-found.columns[1].values).tolist() == list(range(50))
    assert found.rows == Rows(100)


def test_a_clock_that_goes_back_all_the_time_is_none(log):
    stamps = np.tile(np.arange(20.0), 300)
    with pytest.raises(DataError, match=r"no column of times|--rate HZ"):
        log(stamps, time="time_s")


def test_a_recording_of_a_single_time_is_left_out_and_counted(log):
    stamps = np.concatenate((np.arange(500) / RATE_HZ, [0.0, 0.0, 0.0], np.arange(-201, 200) / 50))
    found = log(stamps)
    assert [len(found.recording(n).clocks["time_s"]) for n in range(found.recordings)] == [500, 401]
    assert found.rows.left_out == {"in a recording of a single time": 3}


@given(
    st.lists(
        st.one_of(
            st.none(), st.integers(0, 5), st.floats(0, 100).map(lambda x: round(x, 3)),
            st.just("up"),
        ),
        min_size=2, max_size=60,
    ),
    st.sampled_from(["", "9,", "9"]),
)  # fmt: skip
def test_the_ledger_adds_up(tmp_path_factory, stamps, last):
    path = tmp_path_factory.mktemp("log") / "log.csv"
    up = [n if s == "up" else s for n, s in enumerate(stamps)]
    lines = [f"{'' if s is None else s},{n % 7}" for n, s in enumerate(up)]
    path.write_text("\n".join(["time_s,x_mm", *lines, last]))
    try:
        found = read_log(path, Asked(time="time_s"))
    except DataError:
        return
    rows = found.rows
    assert rows.read == len(lines) + bool(last)
    assert rows.read == rows.used + sum(rows.left_out.values())
    assert rows.used >= len(next(iter(found.clocks.values())))
    for nth in range(found.recordings):
        assert np.all(np.diff(found.recording(nth).clocks["time_s"]) > 0)


@pytest.mark.parametrize("start", ["23:59:55", "23:59:00", "12:00:00"])
@pytest.mark.parametrize("back_s", [0.0, 0.5, -0.3])
def test_a_recording_that_begins_before_midnight_again(log, start, back_s):
    seconds = np.arange(1300) / RATE_HZ
    first = np.datetime64(f"2026-11-22T{start}", "ms")
    own = [*seconds, *(seconds - back_s)]
    stamps = [str(first + np.timedelta64(round(1000 * s), "ms"))[11:] for s in own]
    found = log(stamps, np.random.default_rng(2).normal(size=2600), heading="time")
    assert found.recordings == 2
    for nth in range(2):
        assert found.recording(nth).clocks["time"] == pytest.approx(seconds, abs=2e-3)
