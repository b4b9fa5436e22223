"""The grid `base`: numbers of the machine are off, within the tolerance that its file states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mopro.blind.cases.effects import POSITION, THERMAL
from mopro.blind.cases.spec import ENCODER, LASER, CaseSpec, single

# The share by which each number with a tolerance is off, and the tolerance that is stated.
DEVIATION, TOLERANCE = 0.10, 0.15
# Effects that are nothing but a base number that is off.
_BASE = ("electrical_damping", "force_constant", "force_constant_temperature", "payload_mass")


def base(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Each effect that is no base number, with two sensors in turn, and nothing hidden."""
    for i, name in enumerate(n for n in (*POSITION, *THERMAL) if n not in _BASE):
        size = str(g.choice(["clear", "strong"]))
        yield replace(single(name, size, (LASER, ENCODER)[i % 2], runs=3), base=True)
    for sensor in (LASER, LASER, LASER, LASER, ENCODER, ENCODER, ENCODER, ENCODER):
        yield CaseSpec("none", sensor, runs=3, base=True)
