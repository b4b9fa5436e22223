"""Envelopes of recordings: constant memory, and no extreme is lost."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import mopro
from mopro.motion import plan, plan_profile
from mopro.recording import MoveOutcome, MoveReport
from mopro.recording.envelope import Band, Envelopes
from mopro.recording.phases import phases_of


def chunks_of(values, sizes):
    """Columns of `values` in chunks of these sizes, then the rest."""
    edges = [0, *np.minimum(np.cumsum(sizes), len(values)).tolist(), len(values)]
    for start, end in pairwise(edges):
        yield {"time_s": np.arange(start, end) / 100.0, "value": values[start:end]}


@given(
    arrays(float, st.integers(1, 400), elements=st.floats(-1e3, 1e3)),
    st.lists(st.integers(0, 90), max_size=6),
)
def test_intervals_hold_the_extremes_however_the_samples_arrive(values, sizes):
    envelopes = Envelopes(most=16)
    for chunk in chunks_of(values, sizes):
        envelopes.write(chunk)
    width, band = envelopes.samples_per_interval, envelopes.band("value")
    assert len(band.low) == -(-len(values) // width) <= 16
    parts = [values[i : i + width] for i in range(0, len(values), width)]
    assert band.low.tolist() == [part.min() for part in parts]
    assert band.high.tolist() == [part.max() for part in parts]
    assert envelopes.end_s == (len(values) - 1) / 100.0
    assert envelopes.beginning().band("value").low.tolist() == values[:16].tolist()


def test_a_peak_of_one_sample_in_an_hour_is_kept():
    envelopes = Envelopes()
    for start in range(0, 1_000_000, 65536):
        time_s = np.arange(start, min(start + 65536, 1_000_000)) / 2000.0
        envelopes.write({"time_s": time_s, "value": np.where(time_s == 321.5, 7.0, 0.0)})
    area = envelopes.band("value").coarse(1000)
    assert len(area.low) <= 1000
    (at,) = np.flatnonzero(area.high == 7.0)
    assert area.time_s[at] == pytest.approx(321.5, abs=0.5)


def test_missing_readings_are_no_extremes():
    nan = np.nan
    columns = {"time_s": np.arange(4.0), "seen": np.array([nan, 1, 2, nan]), "no": np.full(4, nan)}
    envelopes = Envelopes.of(columns, most=2)
    assert envelopes.band("seen").low.tolist() == [1.0, 2.0]
    assert ("seen" in envelopes, "no" in envelopes, "absent" in envelopes) == (True, False, False)
    assert Band.of(np.arange(2.0), np.full(2, nan)).reach == 0


def test_changes_of_the_line_are_found_across_chunks():
    lines = np.array([4, 4, 7, 7, 7, 4])
    envelopes = Envelopes()
    for part in (slice(0, 3), slice(3, 6)):
        envelopes.write({"time_s": np.arange(6.0)[part], "line": lines[part]})
    assert envelopes.changes == [(0.0, 4), (2.0, 7), (5.0, 4)]


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
