"""Recordings on disk: exact both ways, whole or not there."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

import mopro
from mopro.errors import DataError
from mopro.recording import FORMATS, Header, Recording, open_sink, read

PROGRAM = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 1.0\nWX1\n"
SUFFIXES = list(FORMATS)
HEADER = Header("P.CMD", "00", "chow1992", "emulator", 2000.0, 0.0, 7, {"mopro": "0"})


@pytest.fixture(scope="module")
def recording():
    return mopro.emulate(mopro.compile(PROGRAM, "P.CMD"), seed=7)


def write(path, recording, pieces=3):
    with open_sink(path, recording.header) as sink:
        for part in np.array_split(np.arange(len(recording)), pieces):
            sink.write({name: values[part] for name, values in recording.columns.items()})


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_reading_back_is_exact(tmp_path, recording, suffix):
    path = tmp_path / f"run{suffix}"
    write(path, recording)
    again = read(path)
    assert again.header == recording.header
    assert list(again.columns) == list(recording.columns)
    for name, values in recording.columns.items():
        assert again[name].dtype == values.dtype
        assert np.array_equal(again[name], values), name
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=npst.arrays(np.float64, st.integers(1, 20), elements=st.floats(allow_nan=False)))
def test_any_number_comes_back_bit_by_bit(tmp_path, suffix, values):
    path = tmp_path / f"any{suffix}"
    lines = np.arange(len(values), dtype=np.int32)
    write(path, Recording(HEADER, {"time_s": values, "line": lines}), pieces=1)
    again = read(path)
    assert again["time_s"].tobytes() == values.tobytes()


def test_the_header_tells_how_the_recording_came_to_be(recording):
    header = recording.header
    assert header.program == "P.CMD"
    assert header.program_sha256 == mopro.compile(PROGRAM).source.sha256
    assert (header.machine, header.seed, header.rate_hz) == ("chow1992", 7, 2000.0)
    assert {"mopro", "numpy", "python"} <= header.versions.keys()


def test_other_tools_read_the_files(tmp_path, recording):
    import pandas as pd
    import pyarrow.parquet as pq

    for suffix in SUFFIXES:
        write(tmp_path / f"run{suffix}", recording)
    frame = recording.to_pandas()
    assert pd.read_parquet(tmp_path / "run.parquet").equals(frame)
    csv = pd.read_csv(tmp_path / "run.csv", comment="#")
    # Old versions of pandas read 16 digits.
    pd.testing.assert_frame_equal(csv.astype(frame.dtypes), frame, rtol=1e-12, atol=1e-15)
    metadata = pq.read_schema(tmp_path / "run.parquet").metadata
    assert json.loads(metadata[b"mopro"])["program"] == "P.CMD"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_run_leaves_the_old_file_and_nothing_else(tmp_path, recording, suffix):
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"the one before")

    def run_that_fails():
        with open_sink(path, recording.header) as sink:
            sink.write(recording.columns)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_that_fails()
    assert path.read_bytes() == b"the one before"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "content", [b"", b"junk", b"# mopro {}\ntime_s\n1,2\n", b"PAR1" * 9, b"PK\3\4"]
)
def test_files_that_are_no_recordings_are_refused_by_name(tmp_path, suffix, content):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(DataError, match=rf"bad{suffix}: is no recording"):
        read(path)


def test_missing_files_and_unknown_formats(tmp_path):
    with pytest.raises(DataError, match="cannot be read"):
        read(tmp_path / "none.parquet")
    with pytest.raises(DataError, match=r"expected one of .parquet, .csv, .npz"):
        read(tmp_path / "run.xls")
    with pytest.raises(DataError, match="is not a recording's suffix"):
        open_sink(tmp_path / "run.xls", HEADER)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_that_is_missing_or_in_the_way_is_told_before_the_run(tmp_path, suffix):
    for path in (tmp_path / "no" / f"run{suffix}", tmp_path):
        target = path if path.suffix else path.with_name(path.name + suffix)
        if not path.suffix:
            target.mkdir()
        with pytest.raises(DataError, match="cannot be written"), open_sink(target, HEADER):
            pytest.fail("the run began")


def test_new_files_are_as_readable_as_any(tmp_path, recording):
    path = tmp_path / "run.csv"
    write(path, recording)
    plain = tmp_path / "plain"
    plain.touch()
    assert path.stat().st_mode == plain.stat().st_mode


def repeated(chunks, rows):
    """Chunks of a motion that repeats itself and of a clock that does not."""
    loop = np.tile(np.random.default_rng(0).normal(size=rows // 4), 5)
    for n in range(chunks):
        at = n * rows % (rows // 4)
        yield {
            "time_s": np.arange(n * rows, (n + 1) * rows) / 2000.0,
            "position_1_m": loop[at : at + rows],
            "line": np.full(rows, 7, dtype=np.int32),
        }


def test_a_repeated_motion_takes_hardly_more_on_disk_than_once(tmp_path):
    path, rows = tmp_path / "loop.parquet", 40_000
    with open_sink(path, HEADER) as sink:
        for columns in repeated(20, rows):
            sink.write(columns)
    once = rows // 4 * 8
    assert path.stat().st_size < 2 * once
    again = read(path)
    assert np.array_equal(again["position_1_m"], np.tile(again["position_1_m"][: rows // 4], 80))
    assert np.array_equal(again["time_s"], np.arange(20 * rows) / 2000.0)


def test_rows_that_wait_take_bounded_memory(tmp_path):
    import pyarrow.parquet as pq

    path, rows = tmp_path / "long.parquet", 100_000
    names = [f"position_{n}_m" for n in range(16)]
    with open_sink(path, HEADER) as sink:
        for _ in range(6):
            time_s = np.arange(rows) / 2000.0
            sink.write({"time_s": time_s} | {name: time_s + n for n, name in enumerate(names)})
    groups = pq.ParquetFile(path).metadata
    most = max(groups.row_group(n).num_rows for n in range(groups.num_row_groups))
    assert most * 8 * len(names) <= 40 << 20
