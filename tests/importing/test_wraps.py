"""Angles and counters that wrap, of any unit, and fast motions that do not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.commands import run_here
from mopro.formula import factor_of
from mopro.importing.ranges import wraps_of

TIMES = np.arange(0, 20, 0.02)
SPANS = {"deg": 360.0, "rad": 2 * np.pi, "rev": 1.0, "mrad": 2000 * np.pi, "arcsec": 1_296_000.0}


def motion(rng, turns):
    """Moves of some turns between rests (turns)."""
    knots = np.cumsum(rng.uniform(-turns, turns, 12))
    phase = np.clip((TIMES % 2) - 0.5, 0, 1)
    n = (TIMES // 2).astype(int)
    return knots[n] + (knots[n + 1] - knots[n]) * (3 * phase**2 - 2 * phase**3)


def wrapped(values, span, signed):
    return (values + span / 2) % span - span / 2 if signed else values % span


@given(
    st.integers(0, 10**6), st.sampled_from(sorted(SPANS)), st.booleans(), st.floats(1.2, 6.0),
    st.sampled_from([0.0, 1e-4, 1e-3]), st.sampled_from([4, 5, 9]),
)  # fmt: skip
def test_an_angle_that_wraps_is_recognised_in_any_unit(seed, unit, signed, turns, noise, digits):
    rng = np.random.default_rng(seed)
    span = SPANS[unit]
    true = span * (motion(rng, turns) + noise * rng.normal(size=len(TIMES)))
    seen = np.array([float(f"{v:.{digits}g}") for v in wrapped(true, span, signed)])
    jumps = np.count_nonzero(np.abs(np.diff(seen)) > span / 2)
    found = wraps_of(seen, unit, factor_of(unit))
    passed = np.ptp(motion(rng, turns)) > 1.5 and jumps
    if found is None:
        # A reading that only trembles at the end of its range shows no motion.
        assert not passed or np.ptp(true) < 1.5 * span
    else:
        assert found.span == pytest.approx(span)
        assert found.count == jumps


@given(
    st.integers(0, 10**6), st.sampled_from([1 << 12, 1 << 16, 1 << 24, 1 << 32, 4000, 10_000]),
    st.booleans(), st.floats(1.2, 3.0),
)  # fmt: skip
def test_a_counter_that_wraps_is_recognised_at_its_own_span(seed, span, signed, turns):
    true = np.rint(span * motion(np.random.default_rng(seed), turns))
    found = wraps_of(wrapped(true, span, signed), "count")
    if np.ptp(true) > 1.5 * span:
        assert found is not None
        # Of a span that is no power of two, a fast motion does not tell the last counts.
        assert found.span == span if span & (span - 1) == 0 else True
    if found is not None:
        assert abs(found.span - span) <= 0.02 * span


@given(st.integers(0, 10**6), st.sampled_from(sorted(SPANS)), st.sampled_from([0.0, 1e-5, 1e-3]))
def test_steps_of_a_whole_turn_are_no_wraps(seed, unit, noise):
    """A command that goes 0, 360, 0, and a reading that follows within a sample."""
    rng = np.random.default_rng(seed)
    told = SPANS[unit] * (np.floor(TIMES / rng.uniform(1, 4)) % 2)
    seen = told + noise * SPANS[unit] * rng.normal(size=len(told))
    assert wraps_of(told, unit, factor_of(unit)) is None
    assert wraps_of(seen, unit, factor_of(unit)) is None


@given(st.integers(0, 10**6), st.floats(0.5, 40.0), st.sampled_from([1, 5, 25]))
def test_a_fast_move_is_no_wrap(seed, turns, every):
    """Moves of up to many turns, sampled so coarsely that a step is most of a turn."""
    seen = 360 * motion(np.random.default_rng(seed), turns)[::every]
    assert wraps_of(seen, "deg", factor_of("deg")) is None


@given(st.floats(20.0, 355.0), st.integers(3, 60))
def test_a_saw_of_less_than_a_turn_is_no_wrap(height, rows):
    """A scan that flies back within a sample."""
    seen = height * (np.arange(300) % rows) / rows
    step = height / rows
    found = wraps_of(seen, "deg", factor_of("deg"))
    assert found is None or abs(height - 360) < step


@pytest.mark.parametrize(
    ("unit", "span", "signed"),
    [("deg", 360, False), ("deg", 360, True), ("rad", 2 * np.pi, True), ("rev", 1, False),
     ("count", 1 << 16, True), ("count", 1 << 16, False)],
)  # fmt: skip
def test_import_tells_and_unwraps(tmp_path, unit, span, signed):
    rng = np.random.default_rng(4)
    told = span * motion(rng, 2.0)
    seen = told + 1e-4 * span * rng.normal(size=len(TIMES))
    if unit == "count":
        told, seen = np.rint(told), np.rint(seen)
    columns = (TIMES, wrapped(told, span, signed), wrapped(seen, span, signed))
    rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))
    text = f"time_s,target_{unit},encoder_{unit}\n{rows}\n"
    (tmp_path / "log.csv").write_text(text, "utf-8")
    done = run_here(tmp_path, "import", "log.csv", "--as", "out")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(f"CHECK: column target_{unit}: unwrapped in the data") == 1
    assert f"wraps at {span:.10g} {unit}" in done.stdout
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    for name, true in ((f"target_{unit}", told), (f"encoder_{unit}", seen)):
        off = (data[name] - true) / span
        assert np.ptp(off) < 1e-6
        assert off[0] == pytest.approx(np.rint(off[0]), abs=1e-6)
    assert run_here(tmp_path, "compare", "out/experiment.toml").returncode in (0, 1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_an_axis_that_rests_at_the_end_of_its_range_trembles_over_it(seed, unit):
    """At home, at 0, noise takes the readings over the end and back, again and again."""
    rng = np.random.default_rng(seed)
    turns = motion(rng, 2.0)
    turns = np.where(TIMES < 6, 0.0, turns - turns[TIMES >= 6][0])
    seen = wrapped(SPANS[unit] * (turns + 3e-4 * rng.normal(size=len(TIMES))), SPANS[unit], False)
    found = wraps_of(seen, unit, factor_of(unit))
    assert found is not None
    assert found.span == pytest.approx(SPANS[unit])


@pytest.mark.parametrize("missing", [0.0, 0.3, 0.5])
def test_a_wrap_is_recognised_beside_a_gap_whose_turns_nobody_knows(tmp_path, missing):
    place = 300.0 * TIMES + 40 * np.sin(TIMES)
    kept = (TIMES < 7) | (7 + 360 * (1 + missing) / 300 < TIMES)
    rows = [f"{t:.3f},{x:.4f},{x % 360:.4f}" for t, x in zip(TIMES, place, strict=True)]
    lines = [row for row, there in zip(rows, kept, strict=True) if there]
    text = "\n".join(["time_s,target_deg,angle_deg", *lines]) + "\n"
    (tmp_path / "log.csv").write_text(text)
    done = run_here(tmp_path, "import", "log.csv", "--as", "out")
    assert "CHECK: column angle_deg: unwrapped" in done.stdout
    assert "the turns in a gap of the readings are not known" in done.stdout
    data = np.genfromtxt(tmp_path / "out/data.csv", delimiter=",", names=True)
    turns = (data["angle_deg"] - place[kept]) / 360
    assert turns == pytest.approx(np.round(turns), abs=1e-5)
    assert np.all(np.diff(turns[data["time_s"] < 7]) == pytest.approx(0, abs=1e-5))
    assert np.all(np.diff(turns[data["time_s"] > 7.5]) == pytest.approx(0, abs=1e-5))
