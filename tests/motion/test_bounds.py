"""Motion beyond all bounds is refused at its line, before anything is computed for it."""

import time

import pytest

import mopro as package
from mopro import motion
from mopro.errors import MotionError
from mopro.motion import plan

TINY = "0.0000000000000000000000000001"
HUGE = "99999999999999999999999999999"


def program(velocity="40.0", acceleration="0.25", distance="15.0", units="12500/1"):
    lines = [f"UU0{units}", f"VEL0 {velocity}", f"ACC0 {acceleration}", f"MRI1 {distance}", "WX1"]
    return "".join(f"{line}\n" for line in lines)


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ({"velocity": TINY}, "the move would last 1.5e+29 s"),
        ({"acceleration": TINY}, "the move would last"),
        ({"velocity": TINY, "acceleration": TINY}, "the move would last"),
        ({"distance": HUGE}, "farther than 9.0072e+15 microsteps"),
        ({"distance": f"-{HUGE}"}, "farther than 9.0072e+15 microsteps"),
        ({"velocity": HUGE, "acceleration": HUGE}, "faster than"),
        ({"velocity": HUGE}, "faster than"),
        ({"acceleration": HUGE}, "faster than"),
        ({"units": f"{HUGE}/1"}, "farther than"),
    ],
)
def test_a_number_beyond_bounds_is_a_finding_at_its_line(mopro, numbers, expected):
    text = program(**numbers)
    ran = mopro("run", "P.CMD", "--emulate", "--out", "o.csv", text=text)
    assert ran.returncode == 2
    assert ran.stderr.startswith("P.CMD:4:1:")
    assert expected in ran.stderr
    assert "[motion-out-of-range]" in ran.stderr
    linted = mopro("lint", "P.CMD")
    assert linted.returncode == 1
    assert "motion-out-of-range" in linted.stdout


def test_the_slowest_and_the_fastest_move_that_may_be():
    slow = package.compile("UU01/1\nVEL0 1.0\nACC0 1.0\nMRI1 2678000\nWX1\n")
    assert plan(slow).duration_s == pytest.approx(2678000, rel=1e-6)
    assert motion.LONGEST_RUN_S == 2678400
    slower = package.compile("UU01/1\nVEL0 1.0\nACC0 1.0\nMRI1 2679000\nWX1\n")
    with pytest.raises(MotionError, match="motion-out-of-range"):
        plan(slower)


def test_a_program_too_long_to_record_is_refused_before_it_is_simulated(mopro):
    begun_s = time.monotonic()
    ran = mopro("run", "P.CMD", "--emulate", "--out", "o.csv", text="WT1000000000\n" * 2000)
    assert ran.returncode == 2
    assert "[too-long]" in ran.stderr
    assert time.monotonic() - begun_s < 10


@pytest.mark.parametrize("command", ["run", "measure"])
@pytest.mark.parametrize("duration", ["1000000000000s", "9" * 400, "32" + "0" * 5 + "min"])
def test_a_duration_beyond_31_days_is_refused(mopro, command, duration):
    more = ["--emulate"] if command == "run" else []
    ran = mopro(command, "P.CMD", *more, "--for", duration, "--out", "o.csv", text=program())
    assert ran.returncode == 2
    assert "at most 2.6784e+06 s" in ran.stderr or "is too large" in ran.stderr


def test_a_payload_beyond_bounds_is_refused(mopro):
    for payload in ("1000001kg", "9" * 400):
        ran = mopro(
            "run", "P.CMD", "--emulate", "--payload", payload, "--out", "o.csv", text=program()
        )
        assert ran.returncode == 2
        assert "at most 1e+06 kg" in ran.stderr or "is too large" in ran.stderr


def test_a_loop_of_too_many_rounds_is_refused_at_once():
    """Five million statements would be executed before the limit was met."""
    looping = package.compile(":B1\nWT1\nJUMP B1\n")
    begun_s = time.monotonic()
    with pytest.raises(MotionError, match="too-many-statements") as caught:
        plan(looping, motion.LONGEST_RUN_S)
    assert time.monotonic() - begun_s < 1.0
    assert "ask for at most 1666 s" in str(caught.value)


def test_a_loop_within_the_limit_is_planned_to_its_end():
    looping = package.compile(":B1\nWT1\nJUMP B1\n")
    assert plan(looping, 10.0).duration_s == 10.0
