"""Files that cannot be used: each says what is wrong, where, and what to do."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mopro.errors import DataError, MoproError
from mopro.experiment import load_experiment
from mopro.experiment.data_file import read_data
from mopro.experiment.sawyer.readings import reading
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.logs.log import cell_span

RUN = 'program = "fast.CMD"\ndata = "fast.csv"'


def refusal(lab):
    with pytest.raises(MoproError) as caught:
        lab.load()
    return caught.value.render()


@pytest.fixture
def fast(lab):
    """The lab with one good run."""
    lab.record("fast.CMD", "fast.csv")
    lab.experiment([RUN])
    return lab


def lines(lab, name="fast.csv"):
    return lab.path(name).read_text().splitlines()


def rewrite(lab, rows, name="fast.csv"):
    lab.write(name, "\n".join(rows) + "\n")


def test_a_good_run_is_read_as_it_stands(fast):
    experiment = fast.load()
    (trial,) = experiment.trials
    assert (trial.name, trial.payload_kg, trial.partial) == ("fast.csv", 0.0, False)
    assert trial.span.line == 13
    (reading,) = trial.readings
    assert reading.sensor.name == "laser"
    assert reading.values[0] == pytest.approx(float(lines(fast)[1].split(",")[1]))
    assert np.diff(reading.time_s) == pytest.approx(1 / 2000)
    assert experiment.notes == ()


def test_a_file_from_dos_or_a_spreadsheet_is_read_as_well(fast):
    plain = fast.load().trials[0].readings[0]
    text = "\r\n".join(['"time_s", "position_1_in"', *lines(fast)[1:]]) + "\r\n\x1a"
    fast.path("fast.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert np.array_equal(fast.load().trials[0].readings[0].values, plain.values)


def test_cells_in_quotes_may_have_commas(fast):
    plain = fast.load().trials[0].readings[0]
    quoted = [
        f'"a, ""b"" ,c", "{row.split(",")[0]}" ,{row.split(",")[1]}' for row in lines(fast)[1:]
    ]
    rewrite(fast, ['"note, of a person",time_s, "position_1_in"', *quoted])
    assert np.array_equal(fast.load().trials[0].readings[0].values, plain.values)


def test_the_place_of_a_cell_behind_one_in_quotes(fast):
    rows = [f'"a,b",{row}' for row in lines(fast)]
    rows[3], rows[6] = '"a,b",0.001, "o,ops"', '"a,b",0.0025,"5"",",7'
    rewrite(fast, rows)
    text = refusal(fast)
    assert "fast.csv:4:14: 'o,ops' is no number that can be measured" in text
    assert "fast.csv:7:1: 4 cells, expected 3 as in the header [wrong-cells]" in text
    shown = text.splitlines()
    caret = shown[shown.index(f"  {rows[3]}") + 1]
    assert caret == " " * 15 + "^" + "~" * (len('"o,ops"') - 1)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('time_s,position_1_in\n0,1\n\n1,"2\n2,3\n', "4:1"),
        ('time_s,"position_1_in\n0,1\n', "1:1"),
        ('# by hand\ntime_s,position_1_in\n0,"1', "3:1"),
    ],
)
def test_a_quote_that_is_not_closed_names_its_line(fast, text, place):
    fast.write("fast.csv", text)
    assert f"fast.csv:{place}: a quote is not closed [open-quote]" in refusal(fast)


@pytest.mark.parametrize(
    ("text", "nth", "columns"),
    [
        ("1,2,3", 0, (1, 2)),
        ("1,2,3", 2, (5, 6)),
        ("1,  22 ,3", 1, (5, 8)),
        ('"a,b","c,d",e', 1, (7, 12)),
        ('5",6", 7', 1, (4, 6)),
        ('"a""b,", 7', 1, (10, 11)),
        ("1,2", 2, (4, 5)),
        ("1,", 1, (3, 4)),
        ("", 0, (1, 2)),
    ],
)
def test_where_a_cell_stands(text, nth, columns):
    span = cell_span(text, 3, nth, ",")
    assert (span.line, span.column, span.end_column) == (3, *columns)


# -- columns and cells ------------------------------------------------------------


def test_a_column_that_is_not_there_lists_those_that_are(fast):
    rewrite(fast, ["time_s,depth", *lines(fast)[1:]])
    text = refusal(fast)
    assert "fast.csv:1:1: the file has no column of any sensor [missing-column]" in text
    assert "expected position_1_in; the file has time_s, depth" in text


def test_a_misspelt_column_is_suggested(fast):
    rewrite(fast, ["time_s,postion_1_in", *lines(fast)[1:]])
    text = refusal(fast)
    assert "there is no column position_1_in [missing-column]" in text
    assert "did you mean postion_1_in?" in text


def test_a_column_in_another_unit_is_not_converted_by_guess(fast):
    rewrite(fast, ["time_s,position_1_mm", *lines(fast)[1:]])
    text = refusal(fast)
    message = "fast.csv:1:1: the file has position_1_mm, and position_1_in was expected"
    assert f"{message} [mixed-units]" in text


def test_a_file_without_time(fast):
    rewrite(fast, ["t_s,position_1_in", *lines(fast)[1:]])
    assert "there is no column time_s [missing-column]" in refusal(fast)


def test_all_cells_that_are_no_numbers_are_named_at_once(fast):
    rows = lines(fast)
    rows[4], rows[7] = f"{rows[4].split(',')[0]},oops", "inf,0.1"
    rows[9] = "1,2,3"
    rewrite(fast, rows)
    text = refusal(fast)
    assert re.search(r"fast\.csv:5:\d+: 'oops' is no number that can be measured", text)
    assert "fast.csv:8:1: 'inf' is no number" in text
    assert "fast.csv:10:1: 3 cells, expected 2 as in the header [wrong-cells]" in text
    place = text.splitlines()
    caret = place[place.index(f"  {rows[4]}") + 1]
    assert caret.index("^") == 2 + rows[4].index("oops")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "fast.csv:1:1: the file is empty: expected a header and data [empty-file]"),
        ("time_s,position_1_in\n", "fast.csv:1:1: there are no data below the header"),
        ("0,1\n1,2\n", "fast.csv:1:1: expected a header, found numbers [no-header]"),
        ("time_s,a,a\n0,1,2\n", "fast.csv:1:10: there are two columns a [double-column]"),
        ("time_s,position_1_in\n0," + "1" * 20_000, "fast.csv:2:1: a line of more than 9999"),
        ("time_s,position_1_in\n,1\n1,1\n", "fast.csv:2:1: the row has no time [clock]"),
        ("time_s,position_1_in\n0,\n1,\n", "position_1_in has 0 samples, expected at least two"),
    ],
)
def test_files_that_hold_no_data(fast, text, message):
    fast.write("fast.csv", text)
    assert message in refusal(fast)


def test_a_file_of_bytes_is_no_data(fast):
    fast.path("fast.csv").write_bytes(bytes(range(256)) * 50)
    assert "fast.csv:" in refusal(fast)


# -- clock and gaps ---------------------------------------------------------------


def test_a_clock_that_runs_backwards_names_the_line(fast):
    rows = lines(fast)
    rows[101], rows[102] = rows[102], rows[101]
    rewrite(fast, rows)
    text = refusal(fast)
    assert "fast.csv:103:1: the clock runs backwards: 0.05 s after 0.0505 s [clock]" in text
    assert "expected times that ascend" in text


def test_a_clock_that_stands_still(fast):
    rows = lines(fast)
    rows.insert(51, rows[50])
    rewrite(fast, rows)
    assert "fast.csv:52:1: the clock stands still: 0.0245 s after 0.0245 s" in refusal(fast)


def test_another_sampling_rate_says_both(fast):
    rows = lines(fast)
    rewrite(fast, [rows[0], *rows[1::2]])
    text = refusal(fast)
    assert "position_1_in has 1000 samples a second, and sensor laser" in text
    assert "is said to give 2000 [wrong-rate]" in text


def test_a_clock_in_milliseconds_is_asked_about(fast):
    rows = [row.split(",") for row in lines(fast)]
    late = [f"{float(t) * 1000:.6g},{x}" for t, x in rows[1:]]
    rewrite(fast, [",".join(rows[0]), *late])
    assert "is the column time_s in milliseconds?" in refusal(fast)


def test_a_clock_that_does_not_begin_with_the_program(fast):
    rows = [row.split(",") for row in lines(fast)]
    late = [f"{float(t) + 1.7e9:.10f},{x}" for t, x in rows[1:]]
    rewrite(fast, [",".join(rows[0]), *late])
    message = "fast.csv:2:1: the clock begins at 1.7e+09 s, and t = 0 is the first statement"
    assert message in refusal(fast)


def test_samples_before_the_start_are_left_out_and_told(fast):
    rows = lines(fast)
    early = [f"{n / 2000:.6g},0.0" for n in range(-20, 0)]
    rewrite(fast, [rows[0], *early, *rows[1:]])
    experiment = fast.load()
    assert experiment.notes[0].endswith("fast.csv: 20 samples before t = 0 are left out")
    assert experiment.trials[0].readings[0].time_s[0] == 0.0


def without(rows, first, count, word):
    blank = [f"{row.split(',')[0]},{word}" for row in rows[first : first + count]]
    return [*rows[:first], *blank, *rows[first + count :]]


@pytest.mark.parametrize("word", ["nan", "", "NaN"])
def test_a_few_missing_samples_are_left_out_and_told(fast, word):
    rows = lines(fast)
    rewrite(fast, without(without(rows, 100, 2, word), 700, 1, word))
    experiment = fast.load()
    assert len(experiment.trials[0].readings[0].values) == len(rows) - 1 - 3
    (note,) = experiment.notes
    assert "fast.csv: 3 samples of position_1_in are missing" in note
    assert "2 in a row after 0.049 s" in note


def test_a_hole_in_the_data_is_refused_with_its_place_and_length(fast):
    rewrite(fast, without(lines(fast), 301, 40, "nan"))
    text = refusal(fast)
    assert re.search(r"fast\.csv:302:\d+: 40 samples of position_1_in are missing", text)
    assert "40 in a row after 0.1495 s (0.0205 s long) [gap]" in text
    assert "at most 1% of the samples, and 10 in a row" in text


def test_rows_that_are_not_there_are_a_gap_as_well(fast):
    rows = lines(fast)
    rewrite(fast, rows[:301] + rows[341:])
    assert "40 in a row after 0.1495 s" in refusal(fast)


def test_many_scattered_gaps_are_too_many(fast):
    rows = lines(fast)
    for first in range(10, len(rows), 50):
        rows = without(rows, first, 1, "nan")
    rewrite(fast, rows)
    assert "(2.0" in refusal(fast)


# -- the experiment file ------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('quantity = "position"', 'quantity = "speed"', ":5:1: expected quantity to be position"),
        ("axis = 1", "axis = 2", ":6:1: the column position_1_in is named after axis 1, not 2"),
        ("axis = 1", "axis = 3", ":6:1: expected axis: 1 or 2"),
        ("rate_hz = 2000.0", "rate_hz = 0", ":8:1: expected rate_hz: a number above 0"),
        ("rate_hz = 2000.0", "rate_hz = inf", ":8:1: expected rate_hz: a number above 0"),
        ("rate_hz = 2000.0", "", ":3:3: the sensor has no rate_hz [missing-key]"),
        ("noise_rms = 2e-5", "noise_rms = -1", ":9:1: expected noise_rms: a number of at least"),
        ("noise_rms = 2e-5", "noise_rms = 0", ":9:1: sensor laser has no noise: state noise_rms"),
        ("noise_rms", "noise_rsm", "did you mean `noise_rms`?"),
        (
            "noise_rms",
            "linearity = -1\nnoise_rms",
            ":9:1: expected linearity: a number",
        ),
        ("noise_rms", "linearity = true\nnoise_rms", "expected linearity: a number of at least 0"),
        (
            "noise_rms",
            'gain_tolerance = "1%"\nnoise_rms',
            "expected gain_tolerance: a number",
        ),
        ("noise_rms", "clock_tolerance = 50\nnoise_rms", "clock_tolerance: a number from 0 to 1"),
        (
            "noise_rms",
            "range = [1, 1]\nnoise_rms",
            ":9:1: expected range = [-10.0, 10.0]",
        ),
        ("noise_rms", "range = [0, 1, 2]\nnoise_rms", "or its length"),
        ("noise_rms", "range = [nan, 1]\nnoise_rms", "or its length"),
        ("noise_rms", "range = -20\nnoise_rms", "or its length"),
        ("noise_rms", "range = []\nnoise_rms", "or its length"),
        ("noise_rms", 'range = "20"\nnoise_rms', "or its length"),
        ('"position_1_in"', '"position_1_C"', "column position_1_C has no unit of a position"),
        ('"laser"\n', '"laser"\nkind = "radar"\n', "expected one of lvdt, thermocouple"),
        ('"laser"\n', '"laser"\nkind = []\n', "expected one of lvdt, thermocouple"),
        ('data = "fast.csv"', "", ":12:1: the run has no data [missing-key]"),
        ('data = "fast.csv"', 'data = "no.csv"', "there is no file "),
        ('program = "fast.CMD"', "", "expected one of program, command, table, found none"),
        ('program = "fast.CMD"', 'program = "fast.CMD"\npayload = "5 s"', "is not a unit of mass"),
        ('program = "fast.CMD"', 'program = "fast.CMD"\npayload_kg = -1', "must be at least 0"),
        ('program = "fast.CMD"', 'program = "fast.CMD"\nsensor = "x"', "no sensor is called x"),
        ('machine = "chow1992"', 'machine = "mine.toml"', ":1:1: there is no file "),
        ('machine = "chow1992"', "", 'expected a machine, such as machine = "chow1992"'),
        ("[[run]]", "[[runs]]", "unknown key runs"),
        ('machine = "chow1992"', 'machine = "chow1992', ":1:20: Illegal character"),
    ],
)
def test_findings_stand_at_their_place_in_the_experiment_file(fast, old, new, message):
    path = fast.path("e.toml")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    assert message in refusal(fast)


def test_all_findings_of_the_file_are_told_at_once(fast):
    fast.experiment(['program = "no.CMD"\ndata = "no.csv"', 'table = "no.csv"\npayload_kg = 1'])
    text = refusal(fast)
    assert text.count("there is no file") == 3
    assert "a table is a run of its own, without payload_kg" in text


def test_an_experiment_that_is_not_there(tmp_path):
    with pytest.raises(MoproError) as caught:
        load_experiment(tmp_path / "no.toml")
    assert "no.toml:1:1: cannot be read: No such file or directory [unreadable]" in str(
        caught.value
    )


def test_two_runs_cannot_have_the_same_data(fast):
    fast.program("slow.CMD")
    fast.experiment([RUN, 'program = "slow.CMD"\ndata = "fast.csv"'])
    assert ":17:1: fast.csv is the data of run 1 already [same-data]" in refusal(fast)


def test_a_raw_file_needs_a_sensor_of_its_kind(fast):
    fast.write("L.DAT", " 1.5 \n")
    fast.experiment(['program = "fast.CMD"\ndata = "L.DAT"'])
    text = refusal(fast)
    assert "e.toml:13:1:" in text
    assert 'a .DAT file is of one sensor of kind "lvdt" or "thermocouple": there are none' in text


def test_a_program_with_an_error_says_so_itself(fast):
    fast.write("fast.CMD", "UU012500/1\nBOGUS 3\n")
    assert "fast.CMD:2:1:" in refusal(fast)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    text=st.one_of(
        st.text(max_size=200),
        st.lists(
            st.lists(
                st.sampled_from(
                    ["time_s", "position_1_in", "0", "1e3", "-1", "nan", "", "x", "\x1a"]
                ),
                max_size=4,
            ).map(",".join),
            max_size=8,
        ).map("\n".join),
    )
)
def test_whatever_stands_in_a_file_it_is_read_or_refused(tmp_path, text):
    path = tmp_path / "any.csv"
    path.write_text(text, encoding="utf-8", errors="replace", newline="")
    sensor = Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5)
    found, words = None, ""
    try:
        found, _ = reading(read_data(path, "any.csv", {"time_s", "position_1_in"}), sensor)
    except DataError as error:
        words = error.render()
    assert words.startswith("any.csv:") if found is None else np.isfinite(found.values).all()
    assert found is None or (np.diff(found.time_s) > 0).all()
