"""The grid `noise`: the experiment states a noise of the sensor that is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mopro.blind.hidden.effects import POSITION, THERMAL
from mopro.blind.hidden.spec import ENCODER, LASER, LVDT, CaseSpec, single, warm

FACTORS = (0.3, 3.0)


def noise(g: np.random.Generator) -> Iterator[CaseSpec]:
    """For each factor 24 effects at two sizes, 4 thermal ones, and nothing hidden."""
    for factor in FACTORS:
        for name in g.choice(POSITION, 24, replace=False):
            sensor, size = str(g.choice([LASER, ENCODER])), str(g.choice(["clear", "strong"]))
            yield replace(single(str(name), size, sensor, runs=3), noise_factor=factor)
        for name in g.choice(THERMAL, 4, replace=False):
            yield replace(single(str(name), "strong", LASER), noise_factor=factor)
        for sensor in (LASER, LASER, LASER, ENCODER, ENCODER, ENCODER, LVDT, LVDT):
            yield CaseSpec("none", sensor, runs=3, noise_factor=factor)
        yield replace(warm("none"), noise_factor=factor)
