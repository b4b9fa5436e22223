"""A model with free-form terms in its predictions."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from threading import Lock

import numpy as np
from cachetools import LRUCache, cached

from mopro.engine.candidate import Candidate
from mopro.engine.series import Floats, Series, Settings, Simulate, key_of

# Bytes of the predictions that are kept: a term that is fitted beside effects asks for the same
# ones again, and so do searches from several sets. Halved, more of a search is simulated twice.
_CACHE_BYTES = 1 << 26


class WithLaws:
    """The model `simulate`, with the free-form terms in the settings added to its predictions."""

    def __init__(
        self, simulate: Simulate, data: Sequence[Series], laws: Sequence[Candidate]
    ) -> None:
        self._simulate, self._data = simulate, data
        self._terms = {c.name: c.law.of_data for c in laws if c.law and c.law.of_data}
        # Asked by several threads at once.
        cache: LRUCache[Hashable, Sequence[Floats]] = LRUCache(_CACHE_BYTES, _bytes)
        self._of_the_model = cached(cache, key=key_of, lock=Lock())(self._predict)

    def __call__(self, settings: Settings) -> Sequence[Floats]:
        plain = {name: values for name, values in settings.items() if name not in self._terms}
        predicted = self._of_the_model(plain)
        # In one order, as sums depend on it.
        for name, term in self._terms.items():
            if name not in settings:
                continue
            predicted = [
                own + term(series, own, settings[name])
                for own, series in zip(predicted, self._data, strict=True)
            ]
        return predicted

    def _predict(self, settings: Settings) -> Sequence[Floats]:
        return [np.asarray(p, dtype=float) for p in self._simulate(settings)]


def _bytes(predicted: Sequence[Floats]) -> int:
    return sum(own.nbytes for own in predicted)
