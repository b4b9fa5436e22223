"""Extremes of long series: none is lost, whatever the chunks; their number is bounded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mopro.viewer.envelope import Envelope

VALUES = arrays(np.float32, st.integers(1, 300), elements=st.floats(-9, 9, width=16))


def enveloped(values, most, chunk):
    envelope = Envelope(most)
    times = np.arange(float(len(values)))
    for first in range(0, len(values), chunk):
        part = slice(first, first + chunk)
        envelope.add(times[part], np.vstack([values[part], -values[part]]))
    return envelope.buckets()


@given(VALUES, st.integers(2, 40), st.integers(1, 100))
def test_each_bucket_has_the_extremes_of_its_samples_in_their_order(values, most, chunk):
    found = enveloped(values, most, chunk)
    assert found.size == 1 or most / 2 <= len(found) <= most + 1
    assert found.start[0] == 0
    assert found.end[-1] == len(values) - 1
    assert (found.start[1:] == found.end[:-1] + 1).all()
    for row, channel in enumerate((values, -values)):
        for bucket in range(len(found)):
            own = channel[int(found.start[bucket]) : int(found.end[bucket]) + 1]
            first, second = found.first[row, bucket], found.second[row, bucket]
            assert {first, second} == {own.min(), own.max()}
            assert np.argmax(own == first) <= len(own) - 1 - np.argmax(own[::-1] == second)


@given(VALUES, st.integers(1, 100))
def test_few_samples_are_kept_as_they_are(values, chunk):
    found = enveloped(values, 300, chunk)
    assert found.size == 1
    assert (found.first[0] == values).all()
    assert (found.second[0] == values).all()


@pytest.mark.parametrize("place", [0, 1, 123_456, 999_999])
def test_a_peak_of_one_sample_in_a_million_is_kept(place):
    values = np.zeros(1_000_000, np.float32)
    values[place] = 1.0
    found = enveloped(values, 1000, 65_536)
    assert found.second.max() == 1.0 or found.first.max() == 1.0
    at = np.flatnonzero(np.maximum(found.first[0], found.second[0]))
    assert found.start[at] <= place <= found.end[at]


def test_what_was_not_measured_counts_as_no_sample():
    values = np.full(100, np.nan, np.float32)
    values[40] = 2.0
    found = enveloped(values, 10, 7)
    assert np.nanmax(found.first) == 2.0
    assert np.isnan(found.first).sum() > len(found)
