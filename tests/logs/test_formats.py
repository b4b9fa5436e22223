"""Logs of programs and instruments, as they write them: headings, notes, lists in cells."""

import numpy as np
import pytest

from mopro.errors import DataError
from mopro.logs import Asked, Rows, read_log

N = 300


@pytest.fixture
def log(tmp_path):
    def read(text, name="log.csv", **asked):
        (tmp_path / name).write_text(text)
        return read_log(tmp_path / name, Asked(**asked))

    return read


def lines(form, count=N, start=0):
    return "".join(form.format(n=n, t=n / 10, x=n % 17 + 0.5) + "\n" for n in range(start, count))


def names(found):
    return [c.raw for c in found.columns]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time_s,x_mm\n" + lines("{t},{x},"), ["x_mm"]),
        ("time_s,x_mm,\n" + lines("{t},{x}"), ["x_mm"]),
        ("time_s,x_mm,\n" + lines("{t},{x},"), ["x_mm"]),
        ("time_s,x_mm\n" + lines("{t},{x},,"), ["x_mm"]),
        ("time_s;x_mm;y\n" + lines("{t};{x};{n};"), ["x_mm", "y"]),
        ("time_s\tx_mm\tComment\n" + lines("{t}\t{x}"), ["x_mm"]),
        ("time_s\tx_mm\tComment\n" + lines("{t}\t{x}\t"), ["x_mm"]),
        ("time_s,x_mm\ns,mm\n" + lines("{t},{x},"), ["x_mm"]),
    ],
)
def test_headings_over_rows_of_another_width(log, text, expected):
    found = log(text)
    assert names(found) == expected
    assert found.columns[0].values.tolist() == [n % 17 + 0.5 for n in range(N)]
    assert found.rows == Rows(N)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,x_mm\n" + lines("{t},{x},{n}"), "1:1: 2 headings stand over rows of 3 cells"),
        ("time_s,x_mm,y\n" + lines("{t},{x}"), "1:1: 3 headings stand over rows of 2 cells"),
        (lines("{t},{x}"), "expected headings above the numbers"),
        ("# a\n\n\ntime_s;x\n0;1,5\n\n1;1.234,5\n2;1,5\n", r"log.csv:7:3: '1.234,5' groups"),
        ("time_s;x\n" + lines("{n};{n},5") + "300;1.234,5\n", r"log.csv:302:5: x: '1.234,5'"),
    ],
)
def test_what_is_wrong_with_headings_and_thousands_is_told_at_its_line(log, text, words):
    with pytest.raises(DataError) as error:
        log(text)
    assert words in error.value.render()


@pytest.mark.parametrize("form", ["{t},{x}", "{n} {t} {x} ", "{t};{x};"])
def test_a_log_without_headings_is_read_where_its_times_are_stated(log, form):
    found = log(lines(form), rate_hz=100.0)
    assert found.columns[-1].raw.startswith("column ") or form.endswith(";")
    assert found.rows == Rows(N)


def test_halsampler_with_an_overrun(log):
    text = lines("{n} {t:.6f} {x} 0 ", 100) + "overrun\n" + lines("{n} {t:.6f} {x} 1 ", N, 100)
    found = log(text, name="hal.log", rate_hz=1000.0)
    assert names(found) == ["column 1", "column 2", "column 3", "column 4"]
    assert found.rows.read == N + 1
    assert sum(found.rows.left_out.values()) == 1


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tOne
Date\t2015/08/24
Time\t16:55:12.7
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t{n}\t{n}\t
Date\t2015/08/24\t2015/08/24\t
Time\t16:55:12.76\t16:55:12.76\t
Y_Unit_Label\tVolts\tVolts\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.100000\t0.100000\t
***End_of_Header***\t\t\t
X_Value\tVoltage_0\tVoltage_1\tComment
"""


@pytest.mark.parametrize("end", ["", "\t"])
def test_labview_measurement(log, end):
    text = LVM.format(n=N) + lines("{t:.6f}\t{x}\t{n}" + end)
    found = log(text, name="log.lvm")
    assert names(found) == ["Voltage_0", "Voltage_1"]
    assert found.columns[0].values[:3].tolist() == [0.5, 1.5, 2.5]
    assert found.rows == Rows(N)


TEKTRONIX = """Model,MDO3024
Firmware Version,1.26

Waveform Type,ANALOG,
Point Format,Y,,
Horizontal Units,s,
Horizontal Scale,4.0E-3,
Sample Interval,4.0E-6,
Record Length,10000,
Gating,0.0% to 100.0%,,
Probe Attenuation,1,1
Vertical Units,V,V
Vertical Offset,0,0
Vertical Scale,1,1
Label,,

TIME,CH1,CH2
"""


def test_tektronix(log):
    found = log(TEKTRONIX + lines("{t:.4e},{x},{n}"))
    assert names(found) == ["CH1", "CH2"]
    assert found.rows == Rows(N)


def test_klipper_accelerometer(log):
    found = log("#time,accel_x,accel_y,accel_z\n" + lines("{t:.6f},{x},{n},9806.5"))
    assert names(found) == ["accel_x", "accel_y", "accel_z"]


def test_saleae(log):
    assert names(log("Time [s],Channel 0,Channel 1\n" + lines("{t:.9f},{x},{n}"))) == [
        "Channel 0",
        "Channel 1",
    ]


PHD2_HEAD = """PHD2 version 2.6.11, Log version 2.5. Log enabled at 2022-02-08 20:15:03

Calibration Begins at 2022-02-08 20:15:10
Camera = Simulator, gain = 50, Pixel size = 3.8 um
Direction,Step,dx,dy,x,y,Dist
West,0,0.000,0.000,640.1,480.2,0.000
West,1,5.120,0.310,645.2,480.5,5.129
Calibration complete, mount = Mount.

"""
PHD2_PART = """Guiding Begins at 2022-02-08 20:{minute}:03
Dither = both axes, Dither scale = 1.000, Image noise reduction = none
Pixel scale = 1.20 arc-sec/px, Binning = 1, Focal length = 480 mm
Frame,Time,mount,dx,dy,RARawDistance,SNR,ErrorCode
"""


def phd2_part(minute):
    rows = lines('{n},{t:.3f},"Mount",{x},-0.04,0.3,41.8,0').splitlines()[1:]
    rows.insert(50, "INFO: SETTLING STATE CHANGE, Settling started")
    rows.insert(100, "INFO: Guiding parameter change, MinMove = 0.200")
    rows.insert(150, '149,14.95,"DROP",,,,0.00,2,"Star lost, low SNR"')
    return PHD2_PART.format(minute=minute) + "\n".join(rows) + "\n"


def test_phd2_guide_log_with_two_sections(log):
    text = PHD2_HEAD + phd2_part(16) + "Guiding Ends at 2022-02-08 20:17:03\n\n" + phd2_part(20)
    found = log(text, name="PHD2_GuideLog.txt")
    assert "dx" in names(found)
    assert found.recordings == 2
    first = found.recording(0)
    assert first.columns[1].values[0] == 1.5
    assert found.rows.used == 2 * N
    assert found.rows.read == found.rows.used + sum(found.rows.left_out.values())
    assert found.rows.left_out["headings again"] == 1
    assert found.rows.left_out["notes between the rows, no rows of the table"] == 8


def test_files_joined_with_their_headings_are_recordings(log):
    text = 3 * ("time_s,x_mm\n" + lines("{t},{x}"))
    found = log(text)
    assert found.recordings == 3
    assert found.rows.as_json()["left_out"] == [{"why": "headings again", "count": 2}]
    assert found.recording(1).line_of(0) == 2 + N + 1


@pytest.mark.parametrize("row", ["5.5,1,2", "5.5", "5.5,oops", "noon,1"])
def test_a_damaged_row_is_no_note(log, row):
    text = (
        "time_s,x_mm\n" + lines("{t},{x}", 100) + "a note\n" + row + "\n" + lines("{t},{x}", N, 101)
    )
    with pytest.raises(DataError, match=r"log\.csv:103:"):
        log(text)


@pytest.mark.parametrize(
    "cell",
    ['"[{x}, -1.5e-3, 4]"', '"({x},0.25,3)"', "[{x} 0.5 2]", '"array([{x}, 1, 2])"', "[{x};1;2]"],
)
def test_lists_in_cells_are_columns(log, cell):
    found = log("time_s,q [rad],type\n" + lines("{t}," + cell + ",STATE"))
    assert [(c.name, c.unit) for c in found.columns] == [(f"q[{n}]", "rad") for n in range(3)]
    assert found.columns[0].values[:3].tolist() == [0.5, 1.5, 2.5]


def test_lists_of_different_lengths_are_told(log):
    rows = [f'{n},{n},"[{", ".join("1" * (1 + n % 2))}]"' for n in range(50)]
    found = log("\n".join(["time_s,x,q", *rows]))
    assert names(found) == ["x"]
    assert any("lists of different lengths" in str(d) and d.check for d in found.decisions)


def test_a_parquet_file_with_lists_and_episodes(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    times = np.tile(np.arange(50) / 30, 2)
    states = pa.array([[float(n), -float(n)] for n in range(100)], pa.list_(pa.float32(), 2))
    table = pa.table({"observation.state": states, "action": states, "timestamp": times})
    pq.write_table(table, tmp_path / "episode.parquet")
    found = read_log(tmp_path / "episode.parquet")
    assert names(found)[:2] == ["observation.state[0]", "observation.state[1]"]
    assert found.recordings == 2


@pytest.mark.parametrize(
    ("before", "clock"),
    [("{t},", True), ("{t} ", True), ("[10:00:{t:06.3f}] ", True), ("10:00:{t:06.3f} > ", True),
     ("2026-11-22 10:00:{t:06.3f}: ", True), ("", False), (">>> ", False)],
)  # fmt: skip
def test_status_reports_of_grbl(log, before, clock):
    form = before + "<Run|MPos:{x},2.000,-{n}|Bf:15,127|FS:500,8000|Pn:XZ>"
    text = "Grbl 1.1h ['$' for help]\nok\n" + lines(form) + "ok\n[MSG:Caution: Unlocked]\n"
    asked = {} if clock else {"rate_hz": 10.0}
    found = log(text, name="grbl.log", **asked)
    assert names(found)[:3] == ["MPos_x_mm", "MPos_y_mm", "MPos_z_mm"]
    assert found.columns[0].values[:3].tolist() == [0.5, 1.5, 2.5]
    assert found.rows.left_out == {"other lines than status reports": 4}
    assert found.rows.used == N
    if not clock:
        with pytest.raises(DataError, match="--rate HZ"):
            log(text, name="grbl.log")


FACTS = [
    ("Name", "Axis1.SetPos", "Axis1.ActPos"), ("SymbolComment", "", ""),
    ("Data-Type", "REAL64", "REAL64"), ("SampleTime[ms]", "10", "10"), ("VariableSize", "8", "8"),
    ("SymbolName", "Axes.Axis 1.SetPos", "Axes.Axis 1.ActPos"), ("Port", "501", "501"),
    ("Offset", "0", "0"), ("ScaleFactor", "1", "1"),
]  # fmt: skip


@pytest.mark.parametrize("delimiter", ["\t", ";", ","])
@pytest.mark.parametrize("unit", [None, "mm"])
@pytest.mark.parametrize("without", [None, "Name"])
def test_twincat_scope(log, delimiter, unit, without):
    """A pair of times and values for each channel, below lines of pairs of a key and a value."""
    head = [["Name", "YT Scope"], ["StartTime of export", "1335", "Monday", "10:00:00.000"], [""]]
    facts = [fact for fact in FACTS if fact[0] != without]
    facts += [("Unit", unit, unit)] if unit else []
    head += [[key, one, key, other] for key, one, other in facts]
    rows = [[f"{10 * n}", f"{n + 0.5}", f"{10 * n + 3}", f"{n + 0.25}"] for n in range(N)]
    text = "\r\n".join(delimiter.join(cells) for cells in [*head, [""], *rows]) + "\r\n"
    found = log(text.replace(".", ",") if delimiter == ";" else text)
    one, other = ("Axes,Axis 1,", "Axis1,") if delimiter == ";" else ("Axes.Axis 1.", "Axis1.")
    stem = one if without else other
    assert [(c.raw, c.unit) for c in found.columns] == [
        (f"{stem}SetPos", unit), (f"{stem}ActPos", unit),
    ]  # fmt: skip
    assert found.columns[1].values[:2].tolist() == [0.25, 1.25]
    assert found.time_of(found.columns[1])[2] == pytest.approx(0.02)
    assert found.origins[found.columns[1].clock] == pytest.approx(0.003)
    assert found.rows.used == N
