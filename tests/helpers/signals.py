"""A probe's voltage over 5 s as a model: each effect has one `size` (V) and a shape in time."""

from __future__ import annotations

import numpy as np

import mopro
from mopro.engine import Candidate, Parameter, Series

SIZE = Parameter("size", "V", -10.0, 10.0, (1.0,))


def times(samples: int = 2000):
    return np.linspace(0.0, 5.0, samples)


def candidates(*names, size=SIZE):
    return [Candidate(name, (size,)) for name in names]


def sizes(settings, *names):
    """The sizes of the effects of these names, 0 where they are off."""
    return tuple(settings.get(name, {}).get("size", 0.0) for name in names)


def of_size(**values):
    """Settings of the effects of these names, at these sizes."""
    return {name: {"size": size} for name, size in values.items()}


def measured(values, sigma, seed):
    """One run of five moves in which the probe shows `values` with white noise of `sigma`."""
    n = len(values)
    noisy = values + sigma * np.random.default_rng(seed).standard_normal(n)
    return [Series("run", "probe", "V", noisy, sigma, times(n), np.arange(n) // (n // 5))]


def diagnosed(simulate, effects, truth, sigma, seed, **how):
    """The verdict on data with the effects in `truth`."""
    (values,) = simulate(truth)
    return mopro.reconcile(simulate, effects, measured(values, sigma, seed), **how)


def names(verdict):
    return {effect.name for effect in verdict.effects}


def family(effect):
    """An effect and all that the data cannot tell from it."""
    return {effect.name, *effect.indistinguishable_from}
