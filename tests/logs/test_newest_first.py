"""Logs whose newest row is the first: read from the end, in the order of time, and told."""

import numpy as np
import pytest

from mopro.errors import DataFileError
from mopro.logs import read_log

TIMES = np.arange(300) / 20


def stamps_of(kind):
    if kind == "seconds":
        return [f"{t:.3f}" for t in TIMES]
    if kind == "whole seconds":
        return [f"{t:.0f}" for t in np.floor(TIMES)]
    if kind == "epoch in ns":
        return [f"{1_790_000_000_000_000_000 + round(t * 1e9)}" for t in TIMES]
    first = np.datetime64("2026-11-22T23:59:55", "ms")
    words = [str(first + np.timedelta64(round(1000 * t), "ms")) for t in TIMES]
    return [w[11:] for w in words] if kind == "over midnight" else words


def written(folder, kind, cell=None):
    values = [f"{n}" for n in range(300)]
    values = values if cell is None else [*values[:40], cell, *values[41:]]
    rows = [f"{s},{v}" for s, v in zip(stamps_of(kind), values, strict=True)]
    (folder / "log.csv").write_text("\n".join(["time,x_mm", *rows[::-1]]) + "\n")
    return folder / "log.csv"


@pytest.mark.parametrize(
    "kind", ["seconds", "whole seconds", "epoch in ns", "dates", "over midnight"]
)
def test_it_is_read_from_the_end(tmp_path, kind):
    found = read_log(written(tmp_path, kind))
    assert found.recordings == 1
    assert found.columns[0].values.tolist() == list(range(300))
    assert found.clocks["time"] == pytest.approx(
        TIMES, abs=0.1 if kind == "whole seconds" else 2e-3
    )
    (told,) = [d for d in found.decisions if "read from the end" in str(d)]
    assert told.check
    assert told.lasting
    assert (found.line_of(0), found.line_of(299)) == (301, 2)


def test_a_bad_cell_is_told_at_its_line(tmp_path):
    with pytest.raises(DataFileError, match=r"log\.csv:261:"):
        read_log(written(tmp_path, "seconds", "bad"))


def test_a_column_that_falls_is_no_clock_for_that(tmp_path):
    rows = [f"{t:.3f},{300 - n}" for n, t in enumerate(TIMES)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,x_mm", *rows]) + "\n")
    found = read_log(tmp_path / "log.csv")
    assert found.columns[0].values.tolist() == list(range(300, 0, -1))
    assert not any("read from the end" in str(d) for d in found.decisions)
