"""Cases of the grid `machines`: machines, motions, hidden effects and noise, and their files."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.signal import lfilter

from mopro.blind.cases import machine_texts as texts
from mopro.blind.cases.drawn_machine import Machine, columns, drawn, seen, span, visible
from mopro.blind.cases.machine_kinds import (
    LISTED,
    OF_A_RUN,
    UNLISTED,
    MachineSpec,
    Parameters,
    Span,
)
from mopro.blind.cases.manifest import EXPERIMENT, MODEL
from mopro.blind.reference.motor import Floats, Generator
from mopro.blind.reference.stepped_machines import Columns

Hidden = dict[str, Parameters]
UNSEEN = "unseen.toml"
# Whitened size of the smallest hidden effect.
_LEAST, _MOST = 20.0, 1000.0
# Memory of coloured noise from row to row; a slow change in it shows a third as well.
_MEMORY, _COLOURED = 0.8, 3.0
# Noise as a share of the readings' range.
_QUIET, _LOUD = 1e-6, 2e-2
_TRIES = 200
# Stated noise for the one that is.
_STATED = {"half": 0.5, "double": 2.0}
_WILD, _WILD_SIGMAS = 0.003, (20.0, 200.0)
_GAP = (0.05, 0.1)


def machine_case(g: Generator, spec: MachineSpec) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The answer of a case, and its files by name.

    Drawn again until each hidden effect has its size under a noise that is not absurd.
    """
    for _ in range(_TRIES):
        machine = drawn(g, spec.kind)
        irregular = "irregular" in spec.troubles
        runs = [columns(g, machine, spec.runs, irregular) for _ in range(spec.runs + 1)]
        sizes_of_run = span(machine, runs[0])
        if not sizes_of_run.x:
            continue  # A run at rest has no sizes.
        effects = _effects(g, spec, sizes_of_run)
        every = [seen(spec.kind, run, machine.numbers, effects) for run in runs]
        if not _possible(machine, effects) or not all(np.isfinite(r).all() for r in every):
            continue
        sizes = visible(machine, runs[:-1], effects)
        sigma = _sigma(g, spec, float(np.ptp(every[0])), sizes)
        if sigma is not None:
            return _written(g, spec, machine, runs, effects, sizes, sigma)
    raise RuntimeError(f"nothing of {spec} shows in {_TRIES} machines")


def _possible(machine: Machine, effects: Hidden) -> bool:
    between = {"coupling", "crosstalk"} & effects.keys()
    return not between or machine.numbers["nodes"] > 1


def _effects(g: Generator, spec: MachineSpec, sizes: Span) -> Hidden:
    found = {}
    for key in spec.listed:
        name, draw = LISTED[spec.kind][key]
        found[name] = draw(g, sizes)
    if spec.unlisted:
        found[spec.unlisted] = UNLISTED[spec.kind][spec.unlisted][0](g, sizes)
    return found


def _sigma(
    g: Generator, spec: MachineSpec, reach: float, sizes: Mapping[str, float]
) -> float | None:
    """The noise of a reading (SI) that goes over `reach`; None if none shows the least effect."""
    if not sizes:
        return reach * 10 ** g.uniform(-4.0, math.log10(_LOUD))
    harder = _COLOURED if spec.noise == "coloured" else 1.0
    aim = math.exp(g.uniform(math.log(_LEAST), math.log(_MOST)))
    sigma = min(sizes.values()) / (aim * harder)
    sigma = min(sigma, _LOUD * reach)
    return sigma if sigma > _QUIET * reach else None


def _written(
    g: Generator, spec: MachineSpec, machine: Machine, runs: Sequence[Columns], effects: Hidden,
    sizes: Mapping[str, float], sigma: float,
) -> tuple[dict[str, Any], dict[str, bytes]]:  # fmt: skip
    names = [f"run{i}.csv" for i in range(1, len(runs))]
    files = {}
    for name, run in zip([*names, "unseen.csv"], runs, strict=True):
        of_run = effects if name != "unseen.csv" else _elsewhere(effects)
        readings = _noisy(g, spec, seen(spec.kind, run, machine.numbers, of_run), sigma)
        if not machine.zero:
            readings += sigma * g.uniform(-30.0, 30.0, (len(readings), 1))
        files[name] = texts.log(machine, run, readings)
    stated = texts.per_si(spec.kind) * sigma * _STATED.get(spec.noise, 1.0)
    noise = '"unknown"' if spec.noise == "unknown" else f"{stated:.6g}"
    begun = {n: machine.numbers[n] * g.uniform(0.7, 1.4) for n in machine.free}
    files["machine.toml"] = texts.machine_text(machine, begun).encode()
    if machine.kind == "python":
        files[MODEL] = texts.PROGRAM.encode()
    files[EXPERIMENT] = texts.experiment_text(machine, noise, names).encode()
    files[UNSEEN] = texts.experiment_text(machine, noise, ["unseen.csv"]).encode()
    harder = _COLOURED if spec.noise == "coloured" else 1.0
    answer = {
        "group": spec.group,
        "sensor": spec.kind,
        "effects": [
            {"name": n, "parameters": own, "total_sigma": sizes[n] / sigma / harder}
            for n, own in effects.items()
            if n != spec.unlisted
        ],
        "unlisted": {n: own for n, own in effects.items() if n == spec.unlisted},
        "variables": list(UNLISTED[spec.kind][spec.unlisted][1]) if spec.unlisted else [],
        "machine": {
            "kind": machine.kind, "numbers": machine.numbers, "free": list(machine.free),
            "off": machine.errors, "start": machine.start, "zero": machine.zero,
        },
        "sigma": sigma,
        "noise": spec.noise,
        "troubles": list(spec.troubles),
        "runs": names,
        "offsets": [],
        "instruments": [],
        "strange": None,
        "files": {n: hashlib.sha256(files[n]).hexdigest() for n in sorted(files)},
    }  # fmt: skip
    return answer, files


def _elsewhere(effects: Hidden) -> Hidden:
    """The effects in another run: without those of a run's own time.

    Of another size there, such an effect would make up by chance for what is wrong in a file.
    """
    return {name: own for name, own in effects.items() if name not in OF_A_RUN}


def _noisy(g: Generator, spec: MachineSpec, readings: Floats, sigma: float) -> Floats:
    """Readings (sensors, rows) with noise, wild values and gaps."""
    shape = readings.shape
    white = g.standard_normal((shape[0], shape[1] + 100))
    if spec.noise == "coloured":
        white = lfilter([math.sqrt(1 - _MEMORY**2)], [1, -_MEMORY], white)
    found: Floats = readings + sigma * white[:, 100:]
    if "outliers" in spec.troubles:
        wild = g.random(shape) < _WILD
        found += wild * g.choice([-1.0, 1.0], shape) * sigma * g.uniform(*_WILD_SIGMAS, shape)
    if "gap" in spec.troubles:
        begin, share = g.uniform(0.1, 0.8), g.uniform(*_GAP)
        found[:, int(begin * shape[1]) : int((begin + share) * shape[1])] = np.nan
    return found
