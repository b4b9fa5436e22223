"""Data files in the encodings that spreadsheets write."""

import pytest

from mopro.errors import DataFileError
from mopro.experiment.read.data import read_data

TEXT = "# \u6e2c\u5b9a\ntime_s,position_1_in\r\n0.0,1.5\r\n0.1,2.5\r\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_data_are_read_in_utf_8_and_utf_16(tmp_path, encoding):
    path = tmp_path / "run.csv"
    mark = "\ufeff" if encoding in ("utf-16-le", "utf-16-be") else ""
    path.write_bytes((mark + TEXT).encode(encoding))
    found = read_data(path, "run.csv", {"time_s", "position_1_in"})
    assert found.columns["position_1_in"].tolist() == [1.5, 2.5]


def test_a_fault_in_utf_16_has_its_line(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(TEXT.replace("2.5", "x").encode("utf-16"))
    with pytest.raises(DataFileError, match=r"run.csv:4:5: .*\n  0.1,x\n"):
        read_data(path, "run.csv", {"time_s", "position_1_in"})
