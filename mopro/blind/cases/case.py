"""Random draw of one case: programs, sensors, hidden effects and their sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from mopro.blind.cases import hidden_sizes
from mopro.blind.cases.equivalent import equivalents
from mopro.blind.cases.foreign_kinds import FOREIGN_KINDS
from mopro.blind.cases.grids import DEVIATION
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS, HiddenEffect, Parameters
from mopro.blind.cases.hidden_sizes import SIZE_CLASSES, NoiselessRuns, Plant, class_of
from mopro.blind.cases.random_programs import random_runs
from mopro.blind.cases.spec import ENCODER, LASER, LVDT, THERMOCOUPLE, CaseSpec, case_instruments
from mopro.blind.cases.stated_effects import StatedEffects
from mopro.blind.reference.motor import INCH_M, THESIS, Generator, Nominal
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Disturbance, Foreign

_NEXT_COARSER = {LASER: ENCODER, ENCODER: LVDT}
_ATTEMPTS = 5
_FOREIGN_SIGMA = (40.0, 400.0)  # total size of something foreign
_DISTURBANCE_RMS = (0.3, 1.0, 2.0, 3.0)  # in σ of the sensor

# Groups of cases with one effect, of a size that the sensor is chosen for.
_SINGLE = ("single", "deleted")


@dataclass
class Case:
    """One case: programs and sensors, which are told, and effects, which are hidden.

    `effects` maps each hidden effect to its parameters (SI), `sizes` to its total size (σ),
    `alone` to the size (σ) of the part that the other effects cannot mimic. `offsets` are the
    sensors' zeros in their units, `files` the SHA-256 of the experiment's files by name.
    `equivalent` are the effects that can stand in for deleted ones. `stated` are candidates of
    a user's file, and hidden if the specification says so.
    """

    number: str
    spec: CaseSpec
    runs: list[ProgramRun]
    instruments: list[Instrument]
    nominal: Nominal
    effects: dict[str, Parameters] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)
    alone: dict[str, float] = field(default_factory=dict)
    disturbance: Disturbance | None = None
    foreign: Foreign | None = None
    offsets: list[float] = field(default_factory=list)
    total_sigma: float = 0.0
    files: dict[str, str] = field(default_factory=dict)
    equivalent: list[str] = field(default_factory=list)
    foreign_sigma: float = 0.0
    stated: StatedEffects | None = None

    @property
    def cut_off(self) -> bool:
        """The recordings end before their programs, which do not loop."""
        return self.spec.cut and self.spec.style != "cycles"

    @property
    def as_wanted(self) -> bool:
        """Each effect is at least as large as its class demands, and no axis stalls."""
        least = [
            SIZE_CLASSES[size][0] if size in SIZE_CLASSES else 0.0 for _, size in self.spec.effects
        ]
        seen = zip(self.sizes.values(), least, strict=True)
        return all(total >= low for total, low in seen) and math.isfinite(self.total_sigma)

    def answer(self) -> dict[str, Any]:
        """The case's entry in answers.json."""
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
            "strange": asdict(self.disturbance) if self.disturbance else None,
            "offsets": self.offsets,
            "instruments": [asdict(i) for i in self.instruments],
            "files": self.files,
            **self._of_deleted(),
            **self._of_foreign(),
            **self._of_runs(),
            **({"stated": asdict(self.stated)} if self.stated and self.spec.stated else {}),
            **({} if self.spec.noise_factor == 1 else {"noise_factor": self.spec.noise_factor}),
        }

    def _of_foreign(self) -> dict[str, Any]:
        """Further entries of the answer of a case with something foreign."""
        if self.foreign is None:
            return {}
        kind = FOREIGN_KINDS[self.foreign.name]
        return {
            "foreign": asdict(self.foreign),
            "foreign_sigma": self.foreign_sigma,
            "coloured": kind.coloured,
            "same": list(kind.same),
            "akin": list(kind.akin),
            "variables": list(kind.variables),
        }

    def _of_deleted(self) -> dict[str, Any]:
        """Further entries of the answer of a case with deleted effects."""
        if not self.spec.deleted:
            return {}
        change = self.noiseless().change(self.effects)
        return {
            "without": list(self.effects),
            "equivalent": self.equivalent,
            "variables": sorted(
                {v for name in self.effects for v in HIDDEN_EFFECTS[name].variables}
            ),
            "visible_sigma": math.inf if change is None else float(np.linalg.norm(change)),
        }

    def _of_runs(self) -> dict[str, Any]:
        """The runs, where what a verdict names may be tried on them."""
        if not self.spec.deleted and self.foreign is None:
            return {}
        runs = [
            {"program": program_name(i), "payload_kg": r.payload_kg, "until_s": r.until_s}
            for i, r in enumerate(self.runs, 1)
        ]
        return {"runs": runs}

    def noiseless(self) -> NoiselessRuns:
        """The runs without noise."""
        own = self.stated.plant if self.stated and self.spec.stated else None
        return NoiselessRuns(self.runs, self.instruments, self.nominal, own)

    def hidden_effect(self, name: str) -> HiddenEffect:
        """The effect of that name, of the user's file or of the benchmark."""
        own = self.stated if self.spec.stated else None
        return own.hidden(name) if own else HIDDEN_EFFECTS[name]

    def plant(self) -> Plant:
        """The plant with all that is hidden in the case."""
        if self.stated and self.spec.stated:
            return self.stated.plant(self.effects)
        return ReferencePlant(self.effects, self.disturbance, self.nominal, self.foreign)


def program_name(number: int) -> str:
    """File of the program of run `number`, from 1."""
    return f"run{number}.CMD"


def draw_case(
    seed: int,
    number: str,
    spec: CaseSpec,
    nominal: Nominal = THESIS,
    tolerated: Sequence[str] = (),
    stated: StatedEffects | None = None,
) -> Case:
    """The case `number` of a grid; depends on no other case.

    An effect too large for its class moves the case to a coarser sensor; one too small, or one
    that makes an axis lose steps, is drawn again a few times. In a case on the `base` of a
    machine the numbers of `nominal` with the names `tolerated` are off.
    """
    if spec.base:
        generator = np.random.default_rng([seed, 6, int(number)])
        nominal = _with_wrong_numbers(generator, nominal, tolerated)
    g = np.random.default_rng([seed, 2, int(number)])
    for _ in range(_ATTEMPTS):
        case = _attempt(g, number, spec, nominal, stated)
        if coarser := _with_coarser_sensor(case):
            spec = coarser
        elif case.as_wanted:
            break
    if spec.disturbance:
        _disturb(g, case)
    if spec.foreign:
        _estrange(g, case)
    if spec.deleted:
        rivals = np.random.default_rng([seed, 5, int(number)])
        case.equivalent = equivalents(case.noiseless(), case.effects, rivals)
    case.offsets = _offsets(g, case)
    return case


def _with_wrong_numbers(g: Generator, nominal: Nominal, names: Sequence[str]) -> Nominal:
    """The machine with each number of `names` larger or smaller than stated."""
    factors = {name: 1 + DEVIATION * float(g.choice([-1.0, 1.0])) for name in names}
    return replace(nominal, **{n: getattr(nominal, n) * f for n, f in factors.items()})


def _attempt(
    g: Generator, number: str, spec: CaseSpec, nominal: Nominal, stated: StatedEffects | None
) -> Case:
    """One draw of programs and effects, each as close to its wanted size as possible."""
    runs = random_runs(g, spec, nominal)
    instruments = case_instruments(spec.sensor, spec.style)
    case = Case(number, spec, runs, instruments, nominal, stated=stated)
    noiseless = case.noiseless()
    for name, size in spec.effects:
        hidden = case.hidden_effect(name)
        drawn_effect = hidden.draw(g, nominal)
        if spec.constants:
            drawn_effect = hidden.with_constants(g, drawn_effect)
        target = _target(g, size)
        strength, total = hidden_sizes.strength_for(
            noiseless, name, drawn_effect, target, hidden.least
        )
        case.effects[name] = drawn_effect(strength)
        case.sizes[name] = total
    if spec.effects:
        case.total_sigma = noiseless.total_sigma(case.effects)
        case.alone = noiseless.alone_sigma(case.effects)
    return case


def _with_coarser_sensor(case: Case) -> CaseSpec | None:
    """The specification with the next coarser sensor if a single effect is too large; else None."""
    spec = case.spec
    if spec.group not in _SINGLE or spec.sensor not in _NEXT_COARSER:
        return None
    (size,) = (size for _, size in spec.effects)
    (total,) = case.sizes.values()
    above = size in SIZE_CLASSES and total >= SIZE_CLASSES[size][1]
    return replace(spec, sensor=_NEXT_COARSER[spec.sensor]) if above else None


def _target(g: Generator, size: str) -> float:
    """The total size (σ) to aim at; 0 or infinity for either end of the plausible range."""
    if size == "ends":
        return float(g.choice([0.0, math.inf]))
    low, high = SIZE_CLASSES[size]
    return float(np.exp(g.uniform(math.log(low * 1.05), math.log(high * 0.95))))


def _disturb(g: Generator, case: Case) -> None:
    """Put a disturbance into the case that is in no catalogue, scaled to a drawn rms."""
    instrument = case.instruments[0]
    series = case.noiseless()
    plain = series.clean(ReferencePlant({}, nominal=case.nominal))
    within = g.uniform(plain[0].min(), plain[0].max()) * instrument.unit
    numbers = {
        "local_bump": {"at": within, "width": g.uniform(0.1, 0.8) * INCH_M},
        "time_drift": {"tau": g.uniform(0.5, 5.0)},
        "frame_sway": {"f": g.uniform(2.0, 8.0), "zeta": g.uniform(0.03, 0.2)},
        "random_walk": {},
    }[case.spec.disturbance]
    numbers = {name: float(value) for name, value in numbers.items()}
    rms_m = float(g.choice(_DISTURBANCE_RMS)) * instrument.sigma * instrument.unit
    shown = series.clean(
        ReferencePlant({}, Disturbance(case.spec.disturbance, numbers, 1.0), case.nominal)
    )
    square = [float(np.var(a - b)) * instrument.unit**2 for a, b in zip(shown, plain, strict=True)]
    sign = float(g.choice([-1.0, 1.0]))
    case.disturbance = Disturbance(
        case.spec.disturbance, numbers, sign * rms_m / math.sqrt(np.mean(square))
    )
    samples = sum(len(a) for a in plain)
    case.total_sigma = rms_m / instrument.unit / instrument.sigma * math.sqrt(samples)


def _estrange(g: Generator, case: Case) -> None:
    """Put something foreign into the case, of a drawn size where it has one."""
    series = case.noiseless()
    target = float(np.exp(g.uniform(*np.log(_FOREIGN_SIGMA))))

    def size_of(numbers: Parameters) -> float:
        """Its size; infinite if an axis stalls, alone or with the effect beside it."""
        foreign = Foreign(case.spec.foreign, numbers)
        change = series.change_of(ReferencePlant({}, None, case.nominal, foreign))
        both = ReferencePlant(case.effects, None, case.nominal, foreign)
        if change is None or (case.effects and series.change_of(both) is None):
            return math.inf
        return float(np.linalg.norm(change))

    numbers, case.foreign_sigma = hidden_sizes.of_size(
        FOREIGN_KINDS[case.spec.foreign], target, size_of, g
    )
    case.foreign = Foreign(case.spec.foreign, numbers)


def _offsets(g: Generator, case: Case) -> list[float]:
    """Offsets of the sensors, in half of the cases with a hidden effect; else 0."""
    plain = not case.effects or "sensor_offset" in case.effects
    if plain or case.spec.sensor == THERMOCOUPLE or g.random() < 0.5:
        return [0.0 for _ in case.instruments]
    return [float(g.normal(0.0, 20 * i.sigma)) for i in case.instruments]
