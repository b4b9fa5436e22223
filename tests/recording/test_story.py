"""The run in the header of its recording: the same when read, bounded, and checked."""

import json
from dataclasses import replace

import pytest

import mopro
from mopro.errors import DataError
from mopro.recording import FORMATS, Stall, open_sink, read
from mopro.recording.reading import MOST_HEADER_BYTES
from mopro.recording.run import MOST_MOVES, run_of, story_of

TEXT = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 1.0\nWX1\nMRI1 -1.0\nWX1\n"


@pytest.fixture(scope="module")
def recording():
    return mopro.emulate(mopro.compile(TEXT, "P.CMD"))


@pytest.fixture(scope="module")
def odd(recording):
    """A run with all that a run may have."""
    first, second = recording.run.moves
    return replace(
        recording.run,
        moves=(first, replace(second, max_lag=None, stall_margin=None, slipped=True)),
        trip={"kind": "over-temperature", "time_s": 0.1, "line": 6, "axis": None},
        stalls=(Stall(0.1, 6, 1, -2), Stall(None, 6, None, 0)),
        trouble="the link is lost", rate_hz=17.5,
    )  # fmt: skip


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_tells_how_the_moves_went(tmp_path, recording, odd, suffix):
    for number, run in enumerate((recording.run, odd)):
        path = tmp_path / f"{number}{suffix}"
        with open_sink(path, recording.header) as sink:
            sink.write(recording.columns)
            sink.run = run
        assert read(path).run == run
        assert read(path).header == recording.header


def test_what_the_command_writes_is_drawn_in_the_unit_of_the_program(mopro, tmp_path):
    assert mopro("run", "P.CMD", "--emulate", text=TEXT).returncode == 0
    recording = read(tmp_path / "run.parquet")
    assert [move.line for move in recording.run.moves] == [4, 6]
    figure = recording.plot()
    assert figure.axes[0].get_ylabel() == "position (in)"
    assert figure.legends


def test_a_file_without_a_run_has_none(tmp_path, recording):
    path = tmp_path / "r.csv"
    with open_sink(path, recording.header) as sink:
        sink.write(recording.columns)
    assert read(path).run is None


def test_of_very_many_moves_the_first_are_kept_and_the_rest_counted(recording):
    many = replace(recording.run, moves=recording.run.moves * MOST_MOVES)
    text = json.dumps(story_of(many))
    assert len(text) < MOST_HEADER_BYTES
    again = run_of(json.loads(text))
    assert (len(again.moves), again.moves_left_out) == (MOST_MOVES, MOST_MOVES)
    assert f"{2 * MOST_MOVES} moves in" in replace(recording, run=again)._repr_html_()
    assert again.as_json()["moves_left_out"] == MOST_MOVES


@pytest.mark.parametrize(
    "change",
    [
        {"duration_s": "1"}, {"duration_s": float("nan")}, {"complete": 1}, {"trip": {"kind": "x"}},
        {"moves": []}, {"moves": {"line": [1]}}, {"stalls": [{}]}, {"stalls": {}}, {"trouble": 3},
        {"platen": {"x": ["y"]}}, {"moves_left_out": True}, {"program": None},
    ],
)  # fmt: skip
def test_a_run_of_other_kinds_is_refused(tmp_path, recording, change):
    story = story_of(recording.run) | change
    with pytest.raises(ValueError, match=r"expected the keys|is no "):
        run_of(json.loads(json.dumps(story)))
    path = tmp_path / "r.csv"
    header = json.dumps({**recording.header.as_json(), "run": story})
    path.write_text(f"# mopro {header}\ntime_s\n0.0\n")
    with pytest.raises(DataError, match="is no recording"):
        read(path)


@pytest.mark.parametrize(
    ("key", "values"),
    [("axes", [[], []]), ("line", [1]), ("unit", [1, 2]), ("max_lag", ["x", None])],
)
def test_moves_of_other_kinds_are_refused(recording, key, values):
    story = story_of(recording.run)
    story["moves"][key] = values
    with pytest.raises(ValueError, match=r"no axis|lengths|is no "):
        run_of(json.loads(json.dumps(story)))


def test_a_unit_that_is_no_length_is_drawn_in_millimetres(recording):
    moves = tuple(replace(move, unit="kg") for move in recording.run.moves)
    figure = replace(recording, run=replace(recording.run, moves=moves)).plot()
    assert figure.axes[0].get_ylabel() == "position (mm)"
