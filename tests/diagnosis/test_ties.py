"""Explanations that only rounding parts: the catalogue's order decides which is named."""

import numpy as np
import pytest
from mopro.diagnosis.ties import TIE, lowest_first

from helpers.signals import candidates, diagnosed, of_size, sizes, times

TWINS = ("stretched", "amplified")


@pytest.mark.parametrize("catalogue", [TWINS, TWINS[::-1]])
@pytest.mark.parametrize("parted_by", [-1e-12, 1e-12])
@pytest.mark.parametrize("other", [0.0, 1.0])
def test_of_two_effects_of_one_response_the_first_in_the_catalogue_is_named(
    catalogue, parted_by, other
):
    t = times()

    def simulate(settings):
        stretched, amplified, hum = sizes(settings, *TWINS, "hum")
        parted = np.sin(7 * t) + parted_by * np.cos(11 * t)
        return [stretched * np.sin(7 * t) + amplified * parted + hum * np.sin(23 * t)]

    truth = of_size(stretched=1.0, hum=other)
    verdict = diagnosed(simulate, candidates(*catalogue, "hum"), truth, 0.2, 1)
    named = {effect.name: effect.indistinguishable_from for effect in verdict.effects}
    assert named[catalogue[0]] == [catalogue[1]]


def test_beyond_a_tie_the_lower_comes_first():
    ebic = {"a": 5.0, "b": 5.0 - 0.9 * TIE, "c": 5.0 - 1.1 * TIE, "d": float("inf")}
    assert lowest_first("dabc", ebic.__getitem__, str) == ["b", "c", "a", "d"]
