"""Single hidden effects that a fit of their own explains: is each of them in the verdict?

    python bench/full_fits.py [--cases 60] [--seed 1] [--only 3,17] [--keep FOLDER]

Draws effects of the catalogue, one a case: in the motor (by the reference plant), in axes under a
force, nodes, slides and drives whose effort is measured. A case has 1 to 6 runs, 1,000 to some
8,000 rows (those of the motor up to 50,000), and white or coloured noise of the stated size. Beside
the verdict the effect is fitted alone, with the free numbers, in all its forms, from the true
values, those of the verdict and their own starts. Prints a line for each case: what is hidden, the
share of the chi-squared that such a fit or the answer explains which the fit explains, and the
verdict. Where the share is 90 % or more, the effect must be in the answer or an alternative, or
what was told must leave no more. Cases that fail are marked `MISSED`, with what both leave; the
last line is a count.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np

import mopro.engine
from mopro.blind.cases.case import draw_case
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS, POSITION
from mopro.blind.cases.machine_case import machine_case
from mopro.blind.cases.machine_kinds import LISTED, MachineSpec
from mopro.blind.cases.make import experiment
from mopro.blind.cases.spec import ENCODER, LASER, THERMOCOUPLE, CaseSpec
from mopro.engine.assumed import SAME
from mopro.engine.candidate import RUN, Candidate, Role
from mopro.engine.diagnosis import BASE
from mopro.engine.fits import NO_LIMIT, growing_fit, least_squares_fit
from mopro.engine.residuals import Residuals
from mopro.engine.verdict import Verdict
from mopro.experiment import conclusion
from mopro.experiment.opened import open_experiment
from mopro.formula.dimension import factor_of

EXPLAINED = 0.9
# Chi-squared that counts as something to explain: 10 σ.
LEAST = 100.0
# Of ten cases so many are of each kind.
KINDS = (
    "motor", "axis", "thermal", "motor", "kinematic", "axis", "motor", "effort", "motor", "axis",
)  # fmt: skip
# Rows of a case of the motor: most have few.
ROWS = (1000, 2000, 4000, 8000, 10000, 50000)
# Starts that are fitted of each form, beside the true values and the verdict's.
STARTS = 4
RATES_HZ = {LASER: 2000.0, ENCODER: 1000.0}


@dataclass(frozen=True)
class Case:
    """Files of an experiment, and what is hidden in it: numbers in SI."""

    kind: str
    noise: str
    effect: str
    hidden: Mapping[str, float]
    numbers: Mapping[str, float]
    files: Mapping[str, bytes]


@dataclass(frozen=True)
class Asked:
    """One call of the diagnosis, with its answer."""

    simulate: Any
    effects: Sequence[Candidate]
    data: Sequence[Any]
    how: Mapping[str, Any]
    verdict: Verdict


def drawn(seed: int, nth: int) -> Case:
    """The case of that number, which depends on no other."""
    g = np.random.default_rng([seed, nth])
    kind, noise = KINDS[nth % len(KINDS)], ("white", "coloured")[int(g.integers(2))]
    if kind == "motor":
        return _motor(g, seed, nth, noise)
    listed = str(g.choice(list(LISTED[kind])))
    stated = "stated" if noise == "white" else noise
    spec = MachineSpec(kind, (listed,), "", int(g.integers(1, 7)), stated, ())
    answer, files = machine_case(g, spec)
    (effect,) = answer["effects"]
    numbers = answer["machine"]["numbers"]
    # Numbers that are off within their tolerance would be an effect of their own.
    text = files["machine.toml"].decode()
    for name in answer["machine"]["off"]:
        text = re.sub(rf"(?m)^({name} = {{ value = )[^,]*", rf"\g<1>{numbers[name]}", text)
    files["machine.toml"] = text.encode()
    return Case(kind, noise, effect["name"], effect["parameters"], numbers, files)


def _motor(g: np.random.Generator, seed: int, nth: int, noise: str) -> Case:
    name = str(g.choice([n for n, e in HIDDEN_EFFECTS.items() if e.standard]))
    runs, rows = int(g.integers(1, 7)), int(g.choice(ROWS))
    sensor = str(g.choice([LASER, ENCODER])) if name in POSITION else THERMOCOUPLE
    style = "cycles" if sensor == THERMOCOUPLE else "strokes"
    style = "two axes" if name == "cross_axis_coupling" else style
    run_s = max(rows / runs / RATES_HZ[sensor], 1.0) if sensor in RATES_HZ else 1200.0
    foreign = "ar1_noise" if noise == "coloured" else ""
    # Noise with a memory hides slow changes: what is clear in white noise is faint in it.
    size = str(g.choice(["clear", "strong"])) if noise == "white" else "strong"
    spec = CaseSpec(
        "full fits", sensor, ((name, size),), style=style, runs=runs, run_s=run_s, foreign=foreign
    )
    case = draw_case(seed, f"{nth:03d}", spec)
    files = experiment(case, g)
    return Case("motor", noise, name, case.effects[name], {}, files)


def concluded(path: Path) -> list[Asked]:
    """The calls of the diagnosis about an experiment: the last one is answered by the verdict."""
    calls: list[Asked] = []

    def asked(*, simulate: Any, effects: Any, data: Any, **how: Any) -> Verdict:
        verdict = mopro.engine.reconcile(simulate, effects, data, **how)
        calls.append(Asked(simulate, tuple(effects), tuple(data), how, verdict))
        return verdict

    conclusion.reconcile = asked  # type: ignore[assignment]
    open_experiment(path).conclude()
    return calls


def fits_alone(case: Case, asked: Asked, residuals: Residuals) -> Iterator[float]:
    """Chi-squared that the hidden effect leaves by itself, in each of its forms from each start."""
    parameters = asked.how.get("base", ())
    own = (Candidate(BASE, tuple(parameters)),) if parameters else ()
    before = {p.name: p.starts[0] for p in parameters}
    true = {**before, **{n: v for n, v in case.numbers.items() if n in before}}
    for form in asked.effects:
        if not is_hidden(case, form.name):
            continue
        for values, base in product(_starts(form, case, asked.verdict), (true, before)):
            start = {BASE: base, form.name: {**form.fixed, **values}}
            yield least_squares_fit(residuals, (form,), [start], base=own).rss
            if case.kind == "axis":
                yield growing_fit(residuals, (form,), start, NO_LIMIT, own).rss


def is_hidden(case: Case, name: str) -> bool:
    """True for the name of the hidden effect, also where that says in which sensor it is."""
    return name == case.effect or name.startswith(f"{case.effect} of ")


def _starts(form: Candidate, case: Case, verdict: Verdict) -> Iterator[dict[str, float]]:
    """The true values, those of the verdict, and some of the form's own."""
    own = {p.name: p.starts or (p.value(0.3), p.value(0.7)) for p in form.parameters}
    first = {name: values[0] for name, values in own.items()} | {RUN: -1.0}
    runs = {p.name: p.name.rpartition("_")[0] for p in form.parameters if p.role is Role.PHASE}
    true = {
        p.name: case.hidden[key] / (factor_of(p.unit) if case.kind != "motor" else 1.0)
        for p in form.parameters
        if (key := p.name if p.name in case.hidden else runs.get(p.name, "")) in case.hidden
    }
    yield {**first, **true}
    if form.name in verdict.settings:
        yield {**first, **{n: v for n, v in verdict.settings[form.name].items() if n in own}}
    if any(p.role is Role.SEARCHED for p in form.parameters):
        return
    for values in islice(product(*own.values()), STARTS):
        yield dict(zip(own, values, strict=True))


def judged(case: Case, folder: Path) -> tuple[float, bool, str]:
    """Share of the excess that a fit explains, whether the effect was missed, and the verdict."""
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    asked = concluded(folder / "experiment.toml")[-1]
    verdict = asked.verdict
    residuals = Residuals(asked.simulate, asked.data, scaled_at=verdict.base_before)
    residuals = residuals.calibrated_at(verdict.base_before)
    before = float(np.sum(residuals.at(verdict.base_before) ** 2))
    after = float(np.sum((np.concatenate(verdict.after) * residuals.weights) ** 2))
    told = {n for e in verdict.fitted for n in (e.name, *e.indistinguishable_from)}
    told |= {name for names in verdict.alternatives for name in names}
    found = any(is_hidden(case, name) for name in told)
    alone, share = before, 0.0
    for left in fits_alone(case, asked, residuals):
        alone = min(alone, left)
        share = (before - alone) / max(before - min(after, alone), LEAST)
        if found and share >= EXPLAINED:
            break
    missed = share >= EXPLAINED and not found and after > alone + SAME
    names = ["/".join([e.name, *e.indistinguishable_from]) for e in verdict.fitted]
    words = f"{verdict.verdict}: {', '.join([*names, *(d.law for d in verdict.drafts)])}"
    left_by = f", leaves {after:.6g}, alone {alone:.6g} of {before:.6g} in {residuals.count}"
    return share, missed, words + ("" if found else left_by)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="numbers of cases, such as 3,17")
    parser.add_argument("--keep", type=Path, help="folder for the cases")
    chosen = parser.parse_args()
    only = {int(number) for number in chosen.only.split(",") if number}
    explained = missed = 0
    with tempfile.TemporaryDirectory() as temporary:
        for nth in sorted(only) or range(chosen.cases):
            case, begun = drawn(chosen.seed, nth), time.monotonic()
            folder = (chosen.keep or Path(temporary)) / f"{nth:03d}"
            folder.mkdir(parents=True, exist_ok=True)
            share, miss, words = judged(case, folder)
            explained, missed = explained + (share >= EXPLAINED), missed + miss
            logs = [f for n, f in case.files.items() if n.startswith("run") and n[-4:] != ".CMD"]
            rows = sum(log.count(b"\n") for log in logs)
            what = f"{nth:03d} {case.kind:9} {case.noise:8} {rows:6} {case.effect:26} {share:6.1%}"
            took = f"{time.monotonic() - begun:.0f} s"
            print(what, "MISSED" if miss else "", "|", words, "|", took, flush=True)
    print(f"explained alone {explained}, in the answer or replaced {explained - missed}")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
