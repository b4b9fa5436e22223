"""Envelopes of recordings: constant memory, and no extreme is lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import mopro
from mopro.motion import plan, plan_profile
from mopro.recording import MoveOutcome, MoveReport
from mopro.recording.envelope import Band, Envelope, Envelopes
from mopro.recording.figure import phases_of

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


def test_the_band_of_a_channel_has_its_extremes_and_the_beginning_its_samples():
    values = np.sin(np.arange(1000.0))
    envelopes = Envelopes(most=64, head=100)
    for start in range(0, 1000, 77):
        part = slice(start, start + 77)
        envelopes.write({"time_s": np.arange(1000)[part] / 100, "value": values[part]})
    width, band = envelopes.samples_per_bucket, envelopes.band("value", 2.0)
    parts = [2 * values[i : i + width] for i in range(0, 1000, width)]
    assert band.low == pytest.approx([part.min() for part in parts], rel=1e-6)
    assert band.high == pytest.approx([part.max() for part in parts], rel=1e-6)
    assert len(band.coarse(10).low) <= 10
    assert band.coarse(10).high.max() == band.high.max()
    assert envelopes.end_s == 9.99
    assert envelopes.beginning().band("value").low == pytest.approx(values[:100], rel=1e-6)
    assert len(envelopes.head()) == 100


def test_missing_readings_are_no_extremes():
    nan = np.nan
    columns = {"time_s": np.arange(4.0), "seen": np.array([nan, 1, 2, nan]), "no": np.full(4, nan)}
    envelopes = Envelopes(most=2)
    envelopes.write(columns)
    assert envelopes.band("seen").low.tolist() == [1.0, 2.0]
    assert ("seen" in envelopes, "no" in envelopes, "absent" in envelopes) == (True, False, False)
    assert Band.of(np.arange(2.0), np.full(2, nan)).reach == 0


def test_changes_of_the_line_are_found_across_chunks():
    lines = np.array([4, 4, 7, 7, 7, 4])
    envelopes = Envelopes()
    for part in (slice(0, 3), slice(3, 6)):
        envelopes.write({"time_s": np.arange(6.0)[part], "x": lines[part] / 1, "line": lines[part]})
    times, found = envelopes.changes()
    assert (times.tolist(), found.tolist()) == ([0.0, 2.0, 5.0], [4, 7, 4])


@pytest.mark.parametrize(
    ("parabolic", "distance", "names"),
    [
        (False, 15.0, ["accelerate", "cruise", "decelerate"]),
        (True, 20.0, ["accelerate", "cruise", "decelerate"]),
        (False, 1.0, ["accelerate", "decelerate"]),
        (True, 15.0, ["accelerate", "decelerate"]),
    ],
)
def test_phases_are_those_of_the_profile(parabolic, distance, names):
    text = f"UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 {distance}\nWX1\n"
    (move,) = plan(mopro.compile(text)).moves
    p = move.profile
    move = replace(move, profile=plan_profile(p.distance, p.velocity, p.acceleration, parabolic))
    phases = phases_of(MoveReport.of(move, MoveOutcome(), 2.032e-6))
    assert [phase.name for phase in phases] == names
    corners = [segment.end_s for segment in move.profile.segments(move.start_s)]
    assert [phase.end_s for phase in phases] == pytest.approx(corners)
