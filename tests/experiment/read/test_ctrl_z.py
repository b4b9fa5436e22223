"""A Ctrl-Z, at which a text ends under DOS, in data files: never the silent end of the data."""

import pytest

from mopro.errors import DataFileError
from mopro.experiment.data_file import read_data

HEAD = "time_s,position_1_in\n0.0,1.5\n"


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        (HEAD + "\x1a0.1,2.5\n", 3, 1),
        (HEAD + "\x1a\n0.1,2.5\n", 3, 1),
        (HEAD + "0.1,2.5\x1a\n\n0.2,3.5\n", 3, 8),
        (HEAD + "0.1,2.\x1a5\n", 3, 7),
        (HEAD + "\x1a" * 20_000 + "junk", 3, 1),
    ],
)
def test_text_behind_a_ctrl_z_is_told_at_its_place(tmp_path, text, line, column):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(DataFileError, match="this Ctrl-Z") as refused:
        read_data(path, "run.csv", {"time_s", "position_1_in"})
    (found,) = refused.value.diagnostics
    assert (found.rule, found.span.line, found.span.column) == ("text-after-end", line, column)


@pytest.mark.parametrize("end", ["\x1a", "\x1a" * 128, "\x1a\r\n\x1a\0\0\n \n", "0.1,2.5\x1a"])
def test_a_ctrl_z_at_the_end_is_the_end(tmp_path, end):
    path = tmp_path / "run.csv"
    path.write_text(HEAD + end, newline="")
    found = read_data(path, "run.csv", {"time_s", "position_1_in"})
    assert found.columns["position_1_in"].tolist()[:1] == [1.5]
