"""One case: programs, sensors and what is hidden, drawn from the seed and its number."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from mopro.benchmark.grid import ENCODER, LASER, LVDT, THERMOCOUPLE, Spec
from mopro.benchmark.hidden import ENTRIES, Parameters
from mopro.benchmark.programs import Author, Range
from mopro.benchmark.reference.experiment import Plant, Strange, Trial
from mopro.benchmark.reference.nominal import INCH_M, THESIS, Nominal
from mopro.benchmark.reference.sensors import Instrument
from mopro.benchmark.sizes import CLASSES, Bench, class_of, strength_for

_PAYLOADS_KG = (0.0, 0.0, 1.0, 2.268)
_ROOMS = {LVDT: Range(-9.0, 9.0)}
_COARSER = {LASER: ENCODER, ENCODER: LVDT}
_ATTEMPTS = 5
_OFF_RMS = (0.3, 1.0, 2.0, 3.0)

Generator = np.random.Generator


@dataclass
class Case:
    """One case drawn: what is known, and what is hidden."""

    number: str
    spec: Spec
    trials: list[Trial]
    instruments: list[Instrument]
    nominal: Nominal
    effects: dict[str, Parameters] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)
    alone: dict[str, float] = field(default_factory=dict)
    strange: Strange | None = None
    offsets: list[float] = field(default_factory=list)
    total_sigma: float = 0.0
    files: dict[str, str] = field(default_factory=dict)

    @property
    def shows(self) -> bool:
        """Whether each effect shows at least as large as was wanted, and no axis stalls."""
        least = [CLASSES[size][0] if size in CLASSES else 0.0 for _, size in self.spec.effects]
        seen = zip(self.sizes.values(), least, strict=True)
        return all(total >= low for total, low in seen) and math.isfinite(self.total_sigma)

    def answer(self) -> dict[str, Any]:
        """What the sealed file says of it."""
        effects = [
            {"name": name, "parameters": values, "total_sigma": self.sizes[name],
                "alone_sigma": self.alone[name],
             "class": class_of(self.sizes[name])}
            for name, values in self.effects.items()
        ]  # fmt: skip
        return {
            "group": self.spec.group,
            "sensor": self.spec.sensor,
            "style": self.spec.style,
            "machine": asdict(self.nominal),
            "effects": effects,
            "total_sigma": self.total_sigma,
            "strange": asdict(self.strange) if self.strange else None,
            "offsets": self.offsets,
            "instruments": [asdict(i) for i in self.instruments],
            "files": self.files,
        }


def drawn(seed: int, number: str, spec: Spec, nominal: Nominal = THESIS) -> Case:
    """The case in all its numbers, from the seed, its own number and the machine alone."""
    g = np.random.default_rng([seed, 2, int(number)])
    for _ in range(_ATTEMPTS):
        case = _attempt(g, number, spec, nominal)
        if fitter := _fitter(case):
            spec = fitter
        elif case.shows:
            break
    if spec.strange:
        _disturb(g, case)
    case.offsets = _offsets(g, case)
    return case


def _attempt(g: Generator, number: str, spec: Spec, nominal: Nominal) -> Case:
    """One draw of programs and effects, each as large as wanted if that can be."""
    trials = _trials(g, spec, nominal)
    case = Case(number, spec, trials, instruments(spec.sensor, spec.style), nominal)
    bench = Bench(case.trials, case.instruments, nominal)
    for name, size in spec.effects:
        drawn_effect = ENTRIES[name].draw(g, nominal)
        target = _target(g, size)
        strength, total = strength_for(bench, name, drawn_effect, target, ENTRIES[name].least)
        case.effects[name] = drawn_effect(strength)
        case.sizes[name] = total
    if spec.effects:
        case.total_sigma = bench.total_sigma(case.effects)
        case.alone = bench.alone_sigma(case.effects)
    return case


def _fitter(case: Case) -> Spec | None:
    """The same with a coarser sensor, where a single small effect shows too large."""
    spec = case.spec
    if spec.group != "single" or spec.sensor not in _COARSER:
        return None
    (size,) = (size for _, size in spec.effects)
    (total,) = case.sizes.values()
    above = size in CLASSES and total >= CLASSES[size][1]
    return replace(spec, sensor=_COARSER[spec.sensor]) if above else None


def instruments(sensor: str, style: str) -> list[Instrument]:
    """The sensors of a case: one, or with two axes one on each."""
    if sensor == THERMOCOUPLE:
        return [Instrument(sensor, "temperature", 1, "temperature_C", 1.0, 1.0, 0.1, 0.09765625)]
    rate, noise, step = {
        LASER: (2000.0, 2e-5, 0.0), ENCODER: (1000.0, 2e-4, 1e-4), LVDT: (800.0, 0.025, 0.004883),
    }[sensor]  # fmt: skip
    axes = (1, 2) if style == "two axes" else (1,)
    names = {1: sensor} if len(axes) == 1 else {n: f"{sensor}_{n}" for n in axes}
    return [
        Instrument(names[n], "position", n, f"position_{n}_in", INCH_M, rate, noise, step)
        for n in axes
    ]


def _trials(g: Generator, spec: Spec, nominal: Nominal) -> list[Trial]:
    author = Author.of(nominal, _ROOMS.get(spec.sensor, Range()))
    return [_trial(g, spec, author) for _ in range(spec.runs)]


def _trial(g: Generator, spec: Spec, author: Author) -> Trial:
    if spec.style == "cycles":
        return Trial(author.cycles(g, bool(g.random() < 0.3)), 0.0, spec.run_s)
    if spec.style == "one speed":
        return Trial(author.one_speed(g, spec.run_s))
    payload = float(g.choice(_PAYLOADS_KG))
    two_axes = spec.style == "two axes"
    return Trial(author.strokes(g, spec.run_s, payload > 0, two_axes), payload)


def _target(g: Generator, size: str) -> float:
    """A total size to aim at; either end of the plausible range for `ends`."""
    if size == "ends":
        return float(g.choice([0.0, math.inf]))
    low, high = CLASSES[size]
    return float(np.exp(g.uniform(math.log(low * 1.05), math.log(high * 0.95))))


def _disturb(g: Generator, case: Case) -> None:
    """Draw a disturbance off the catalogue, its rms in the data some share of σ."""
    instrument = case.instruments[0]
    series = Bench(case.trials, case.instruments, case.nominal)
    plain = series.clean(Plant({}, nominal=case.nominal))
    within = g.uniform(plain[0].min(), plain[0].max()) * instrument.unit
    numbers = {
        "local_bump": {"at": within, "width": g.uniform(0.1, 0.8) * INCH_M},
        "time_drift": {"tau": g.uniform(0.5, 5.0)},
        "frame_sway": {"f": g.uniform(2.0, 8.0), "zeta": g.uniform(0.03, 0.2)},
        "random_walk": {},
    }[case.spec.strange]
    numbers = {name: float(value) for name, value in numbers.items()}
    rms_m = float(g.choice(_OFF_RMS)) * instrument.sigma * instrument.unit
    shown = series.clean(Plant({}, Strange(case.spec.strange, numbers, 1.0), case.nominal))
    square = [float(np.var(a - b)) * instrument.unit**2 for a, b in zip(shown, plain, strict=True)]
    sign = float(g.choice([-1.0, 1.0]))
    case.strange = Strange(case.spec.strange, numbers, sign * rms_m / math.sqrt(np.mean(square)))
    samples = sum(len(a) for a in plain)
    case.total_sigma = rms_m / instrument.unit / instrument.sigma * math.sqrt(samples)


def _offsets(g: Generator, case: Case) -> list[float]:
    """Zeros of the sensors that nobody would call an effect; none where nothing is hidden."""
    plain = not case.effects or "sensor_offset" in case.effects
    if plain or case.spec.sensor == THERMOCOUPLE or g.random() < 0.5:
        return [0.0 for _ in case.instruments]
    return [float(g.normal(0.0, 20 * i.sigma)) for i in case.instruments]
