"""The diagnosis: from a model, a catalogue of effects and data to a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from threadpoolctl import threadpool_limits

from mopro.engine.answer import conclude
from mopro.engine.candidate import Candidate, Parameter
from mopro.engine.freeform import WithLaws
from mopro.engine.passes import PASSES, Pass, in_turn
from mopro.engine.search.hypotheses import Progress
from mopro.engine.series import Series, Simulate
from mopro.engine.state import Problem, State
from mopro.engine.verdict import Verdict

# The name of the model's own free numbers in the settings.
BASE = "base"


def reconcile(
    simulate: Simulate,
    effects: Sequence[Candidate],
    data: Sequence[Series],
    *,
    unlisted: Sequence[Candidate] = (),
    base: Sequence[Parameter] = (),
    runs_on: bool = True,
    in_one_run: Mapping[str, Sequence[Candidate]] = MappingProxyType({}),
    finer: Simulate | None = None,
    coarse: Simulate | None = None,
    jobs: int = 1,
    progress: Progress = lambda _: None,
    passes: Sequence[Pass] = PASSES,
) -> Verdict:
    """Find which of `effects` the model lacks, if any, with the evidence for each.

    `simulate(settings)` predicts every series of `data` with the effects in `settings` on; it
    must be deterministic. `unlisted` are free-form terms that it knows as it knows effects, and
    that compete beside those of the measurement. `base` are free numbers of the model itself,
    found in `settings["base"]`: fitted with every set of effects, from their `starts`. `runs_on`:
    the model runs on from a start state, so that it may get out of phase with the data: fits
    with a base that leave much are repeated from the beginning of each series onwards.
    `in_one_run`: the effects as they are on in one run alone, by its name (`Candidate.in_run`),
    which compete as well if that run disagrees and the others do not. `finer`
    is the same model with smaller steps of integration, asked before anything is called
    unexplained, and `coarse` with larger ones, by which changes of the prediction are told.
    `jobs` simulations run at once, in threads, and `progress` is called with a line about each
    fit. `passes` lead from the question to the answer, which keeps their trace. Raises ValueError
    for data or predictions that are not finite numbers and for predictions of another length.
    """
    _check(effects, data)
    own = (Candidate(BASE, tuple(base)),) if base else ()
    simulate, coarse = WithLaws(simulate, data, ()), coarse and WithLaws(coarse, data, ())
    problem = Problem(
        simulate, finer, coarse, tuple(effects), tuple(unlisted), own, tuple(data), jobs, progress,
        in_one_run, runs_on,
    )  # fmt: skip
    # The matrices are tall and narrow: threads of the linear algebra take longer to meet than
    # they save, and the sums would depend on their number.
    with threadpool_limits(1, "blas"):
        return conclude(in_turn(passes, State.of(problem)))


def _check(effects: Sequence[Candidate], data: Sequence[Series]) -> None:
    if not data:
        raise ValueError("there are no data")
    for series in data:
        where = f"{series.run}, {series.sensor}"
        if series.sigma is not None and not series.sigma > 0:
            raise ValueError(f"{where}: expected a sigma above 0, or None")
        if not len(series) or not np.isfinite(series.values).all():
            raise ValueError(f"{where}: expected finite numbers, at least one")
    keys = [effect.key for effect in effects]
    if len(set(keys)) < len(keys):
        raise ValueError("two effects have the same name and form")
    if BASE in {effect.name for effect in effects}:
        raise ValueError(f'"{BASE}" is the name of the free numbers of the model')
