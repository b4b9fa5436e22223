"""First values of a machine of which only the kind is known, from logs with gaps."""

import re

import numpy as np
import pytest

from mopro.stated.rough import Sampled, axis_lines

GAIN, DAMPING = 0.45, 4.0


def driven(seed):
    """A speed (m/s) under held duties in closed form, and its place."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 10, 0.005)
    duty = np.repeat(rng.uniform(-1, 1, 40), 50)
    speed, place, v, x = [], [], 0.0, 0.0
    for push in duty:
        speed.append(v)
        place.append(x)
        end = GAIN / DAMPING * push
        fade = np.exp(-DAMPING * 0.005)
        x += end * 0.005 + (v - end) * (1 - fade) / DAMPING
        v = end + (v - end) * fade
    return t, duty, np.array(speed), np.array(place)


@pytest.mark.parametrize("of_place", [False, True])
@pytest.mark.parametrize("gaps", [(), ((500, 900),), ((300, 420), (1200, 1500))])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_happened_in_a_gap_does_not_count(of_place, gaps, seed):
    t, duty, speed, place = driven(seed)
    kept = np.ones(len(t), bool)
    for begin, end in gaps:
        kept[begin:end] = False
    seen = Sampled(
        t[kept], (place if of_place else speed)[kept], {"duty": duty[kept]}, frozenset({"duty"})
    )
    text = "\n".join(axis_lines("m", {"duty": "1"}, seen, of_place))
    gain, damping = (
        float(re.search(rf"^{name} = {{ value = ([-\d.e]+)", text, re.M)[1])
        for name in ("gain_duty", "damping")
    )
    assert gain == pytest.approx(GAIN, rel=0.02)
    assert damping == pytest.approx(DAMPING, rel=0.02)
