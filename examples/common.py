"""Reading, fitting and tables of an example in Python."""

import csv
from dataclasses import replace

import numpy as np

from mopro.engine import Candidate, Parameter, reconcile


def columns(path, *names):
    """The named columns of a CSV file as arrays, without rows in which one of them is empty."""
    with path.open(encoding="utf-8", newline="") as lines:
        rows = [[row[name] for name in names] for row in csv.DictReader(lines)]
    return np.array([row for row in rows if all(row)], dtype=float).T


def moves(time_s, count=8):
    """Numbers of `count` parts of a run, alike in length, that can be held out."""
    share = (time_s - time_s[0]) / np.ptp(time_s)
    return np.minimum(count * share, count - 1).astype(int)


def effect(name, parameter, unit, low, high, *starts, **more):
    """A candidate with a single amplitude."""
    return Candidate(name, (Parameter(parameter, unit, low, high, starts, **more),))


def getter(settings):
    """The value of an effect's parameter, 0 where the effect is off."""
    return lambda effect, name: float(settings.get(effect, {}).get(name, 0.0))


def diagnose(title, experiment, effects, base=(), documented=None):
    """The verdict on a model and its data, printed: effects, `documented` values, gaps."""
    verdict = reconcile(experiment[0], effects, experiment[1], base=base)
    print(f"{title}: {verdict.verdict}")
    for named in verdict.fitted:
        for parameter, e in named.parameters.items():
            name = f"{named.name} {parameter}"
            known = f"  (documented {documented[name]})" if name in (documented or {}) else ""
            print(f"  {name:24s} {_estimate(e)}{known}")
        if named.rivals:
            print(f"  {'':24s} or instead of {named.name}: {', '.join(named.rivals)}")
    for name, e in verdict.base.items():
        print(f"  {'model ' + name:24s} {_estimate(e)}")
    for draft in verdict.drafts:
        print(f"  {'draft':24s} {draft.law} {draft.unit}")
    for run in verdict.gap.runs:
        held = "" if run.held_out_rms is None else f" -> {run.held_out_rms:.3g} held out"
        gap = f"{run.before_rms:.3g} -> {run.after_rms:.3g}{held} {run.unit}"
        print(f"  {'gap ' + run.sensor:24s} {gap}")
    if verdict.remainder.description:
        print(f"  {'remainder':24s} {verdict.remainder.description}")
    return verdict


def _estimate(e):
    """Text of a value with its 95 % interval."""
    return f"{e.value:.4g} [{e.ci95[0]:.4g}, {e.ci95[1]:.4g}] {e.unit}"


def cross_test(verdict, experiment):
    """Print how well a verdict, and each alternative to it, predicts data that was not fitted."""
    others = {name: s for effect in verdict.effects for name, s in effect.alternatives.items()}
    for name, settings in {"": verdict.settings, **others}.items():
        title = f"with {name}" if name else "cross-test"
        for gap in replace(verdict, settings=settings).predict(*experiment):
            change = f"{gap.before_rms:.3g} -> {gap.after_rms:.3g} {gap.unit}"
            print(f"  {title:24s} {change}, {gap.run} {gap.sensor}")
