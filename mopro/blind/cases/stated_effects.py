"""Effects of a user's file, hidden beside those of the catalogue.

The reference plant knows no formulas, so their cases are made by the emulator's own plant, at
finer steps than a diagnosis takes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mopro import Machine, load_machine
from mopro import compile as compile_program
from mopro.blind.cases.hidden_effects import Drawn, HiddenEffect, Parameters
from mopro.blind.cases.spec import ENCODER, LASER, CaseSpec
from mopro.blind.reference.motor import Floats, Generator, Nominal
from mopro.blind.reference.plant import ProgramRun
from mopro.blind.reference.sensors import Instrument
from mopro.effects import Active, catalogue_of
from mopro.effects.resolve import with_values
from mopro.errors import RunError
from mopro.formula.written import AMPLITUDE, WrittenEffect, toml_lines
from mopro.instruments.quantity import QUANTITIES
from mopro.instruments.sensor import Sensor
from mopro.machine import builtin_machines
from mopro.machine.file import formulas_in, read_machine
from mopro.plant import Stepping, measured_at, plan_with_effects, simulate
from mopro.source import Source
from mopro.tomlfile import Document, read_source

# Sizes and sensors with which each effect is hidden.
_DRAWN = (("faint", LASER), ("clear", LASER), ("strong", LASER), ("strong", ENCODER))
_STEPPING, _DENSE_HZ = Stepping(2.5e-5), 4000.0


@dataclass(frozen=True)
class StatedEffects:
    """The `[[effect]]` sections of a file, `text`, on a machine: a built-in name or a file's text.

    Both are plain texts, so that answers can keep them.
    """

    text: str
    machine_text: str

    @classmethod
    def read(cls, path: str, machine_text: str) -> StatedEffects:
        """Those of file `path`; ModelError for faults, and for a parameter without a range."""
        document = Document(read_source(path))
        effects = document.read(formulas_in)
        for effect in effects:
            for p in effect.parameters:
                if not isinstance(p.low, float) or not isinstance(p.high, float):
                    assert effect.value is not None, "it was read from a file"
                    message = f"expected a range of {p.name}: what is hidden is drawn from it"
                    raise effect.value[p.name].error(message, "missing-key")
        if not effects:
            raise document.root.error("expected at least one [[effect]]", "missing-key")
        return cls("\n\n".join("\n".join(toml_lines(e)) for e in effects) + "\n", machine_text)

    @cached_property
    def effects(self) -> dict[str, WrittenEffect]:
        """The effects by name."""
        found = Document(Source("effects", self.text)).read(formulas_in)
        return {effect.name: effect for effect in found}

    @cached_property
    def machine(self) -> Machine:
        """The machine, with the effects beside its own."""
        if self.machine_text in builtin_machines():
            base = load_machine(self.machine_text)
        else:
            base = read_machine(Source("machine.toml", self.machine_text))
        return base.beside(self.effects.values())

    def specs(self, runs: int = 3, run_s: float = 4.0) -> Iterator[CaseSpec]:
        """The cases in which one of them is hidden."""
        for name in self.effects:
            for size, sensor in _DRAWN:
                hidden = ((name, size),)
                yield CaseSpec("single", sensor, hidden, runs=runs, run_s=run_s, stated=True)

    def hidden(self, name: str) -> HiddenEffect:
        """The effect as one that can be hidden: amplitudes up to an end of their range."""
        effect = self.effects[name]

        def draw(g: Generator, nominal: Nominal) -> Drawn:
            ends: Parameters = {}
            shapes: Parameters = {}
            for p in effect.parameters:
                assert isinstance(p.low, float), "it has a range"
                assert isinstance(p.high, float), "it has a range"
                if p.role == AMPLITUDE:
                    ends[p.name] = float(g.choice([e for e in (p.low, p.high) if e]))
                else:
                    shapes[p.name] = float(g.uniform(p.low, p.high))
            return lambda s: {**{n: s * end for n, end in ends.items()}, **shapes}

        return HiddenEffect(name, draw)

    def plant(self, effects: Mapping[str, Parameters]) -> EmulatedPlant:
        """The machine with these effects in it."""
        return EmulatedPlant(self.machine, effects)


@dataclass
class EmulatedPlant:
    """The emulator's plant as one that hides effects; `stalled` once an axis stalls."""

    machine: Machine
    hidden: Mapping[str, Parameters]
    stalled: bool = field(default=False, init=False)
    foreign: None = field(default=None, init=False)

    def readings(
        self, run: ProgramRun, instruments: Sequence[Instrument], generator: Generator
    ) -> tuple[Floats, list[Floats]]:
        """Time stamps (s) and each instrument's readings (its unit), without noise."""
        known = catalogue_of(self.machine)
        # A hidden size may be nearer to zero than its range, where a machine file may not state it.
        active = tuple(with_values(known[name], own) for name, own in self.hidden.items())
        columns, end_s = self._columns(run, active)
        stamps = np.arange(int(end_s * instruments[0].rate_hz) + 1) / instruments[0].rate_hz
        sensors = [
            Sensor(i.name, QUANTITIES[i.quantity], i.column, i.rate_hz, i.axis) for i in instruments
        ]
        return stamps, [measured_at(columns, s, self.machine, active, stamps) for s in sensors]

    def _columns(
        self, run: ProgramRun, active: tuple[Active, ...]
    ) -> tuple[dict[str, Floats], float]:
        program = compile_program(run.text, "run.CMD")
        plain = plan_with_effects(program, self.machine, (), run.until_s)
        schedule = plan_with_effects(program, self.machine, active, run.until_s)
        end_s = run.until_s or plain.duration_s
        simulation = simulate(
            schedule, self.machine, active, _STEPPING, payload_kg=run.payload_kg, resolved=False,
            compiled=True,
        )  # fmt: skip
        times = np.arange(int(end_s * _DENSE_HZ) + 2) / _DENSE_HZ
        columns = {"time_s": times, "temperature_C": simulation.temperature_C(times)}
        try:
            found = simulation.advance(times, float(times[-1]))
            outcomes = map(simulation.outcome, schedule.moves)
            margins = [o.stall_margin for o in outcomes if o.stall_margin is not None]
            self.stalled |= min(margins, default=1.0) <= 0.0
        except RunError:
            self.stalled = True
            found = {f"position_{axis}_m": np.zeros_like(times) for axis in (1, 2)}
        return columns | {n: v for n, v in found.items() if n.startswith("position_")}, end_s
