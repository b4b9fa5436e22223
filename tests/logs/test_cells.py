"""Numbers that are no readings: an overload, what the user states, values far from all others."""

import numpy as np
import pytest

from mopro.logs import Asked, read_log


@pytest.fixture
def log(tmp_path):
    def read(values, name="log.csv", **asked):
        path = tmp_path / name
        if name.endswith("npz"):
            np.savez(path, time_s=np.arange(len(values)) / 10, x_mm=np.array(values, float))
        else:
            rows = [f"{n / 10},{v}" for n, v in enumerate(values)]
            path.write_text("\n".join(["time_s,x_mm", *rows]) + "\n")
        return read_log(path, Asked(**asked))

    return read


def readings(seed=0, count=200):
    return [f"{v:.4f}" for v in np.random.default_rng(seed).normal(20, 0.5, count)]


@pytest.mark.parametrize("word", ["9.9E37", "9.91E+37", "-9.9e37", "1e38", "-1E38", "3.4e38"])
@pytest.mark.parametrize("rows", [[7], [3, 90, 91]])
@pytest.mark.parametrize("name", ["log.csv", "log.npz"])
def test_an_overload_is_missing_and_told(log, word, rows, name):
    values = readings()
    for row in rows:
        values[row] = word
    found = log(values, name)
    assert np.flatnonzero(np.isnan(found.columns[0].values)).tolist() == rows
    assert any(f"{len(rows)} readings of 9e37 or more" in str(d) for d in found.decisions)
    assert found.rows.used == 200


@pytest.mark.parametrize("word", ["-9999", "65535", "-32768.0", "1e6", "-1"])
@pytest.mark.parametrize("rows", [[3, 90], [50, 51, 52]])
def test_a_few_absurd_values_are_told_and_believed_with_missing(log, word, rows):
    values = readings() if word != "-1" else [f"{20 + n % 2 / 10}" for n in range(200)]
    for row in rows:
        values[row] = word
    found = log(values)
    (told,) = [d for d in found.decisions if "far from all others" in str(d)]
    assert told.check
    assert f"--missing {float(word):g}" in told.reason
    assert not np.isnan(found.columns[0].values).any()
    for stated in (word, f"{float(word):g}", f"{float(word):.1f}"):
        found = log(values, missing=(stated,))
        assert np.flatnonzero(np.isnan(found.columns[0].values)).tolist() == rows
        assert not any(d.check for d in found.decisions)


@pytest.mark.parametrize(
    "values",
    [
        [0, 0, 1, 1, 0, 0] * 30,
        [0] * 195 + [20] * 5,
        [*range(200)],
        [*np.random.default_rng(0).standard_cauchy(200).round(2)],
        [21.5] * 200,
        [0.0, 100.0] * 100,
    ],
)
def test_ordinary_values_are_not_called_absurd(log, values):
    assert not any("far from all" in str(d) for d in log(values).decisions)


def test_a_number_stated_as_missing_stays_in_the_times(log):
    found = log(readings(), missing=("0", "5.0"))
    assert found.rows.used == 200


@pytest.mark.parametrize(
    "word", ["None", "Null", "Nan", "NaN", "N/A", "Na", "NULL", "none", "#N/A"]
)
@pytest.mark.parametrize("beside", ["", " ", "   "])
def test_a_word_for_a_missing_reading_is_one_in_any_spelling(log, word, beside):
    values = readings()
    values[3] = values[150] = f"{beside}{word}{beside}"
    values[90] = beside
    found = log([*values[:199], values[199]])
    assert np.flatnonzero(np.isnan(found.columns[0].values)).tolist() == [3, 90, 150]
