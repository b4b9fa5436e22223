"""Experiments whose data `mopro measure` writes with its own instruments, and their verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from helpers.commands import run_here
from mopro.effects import catalogue_of
from mopro.engine.verdict import Verdict
from mopro.experiment.opened import open_experiment
from mopro.machine import load_machine

PROGRAMS = Path(__file__).parents[2] / "programs"
# Instruments whose data have a raw form of their own.
RAW = ("lvdt", "thermocouple")


@dataclass(frozen=True)
class Measured:
    """A `program` of the repository, seen by an `instrument` with noise of a `seed`.

    `cut_s`: the duration of the run, None to its end. `hidden`: effects of the machine that is
    measured, with their parameters in SI. `keys` of the sensor beside its kind.
    """

    instrument: str
    program: str
    seed: int = 0
    cut_s: float | None = None
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    keys: str = ""

    def write(self, folder: Path) -> Path:
        """Measure the run; the experiment file on the built-in machine."""
        program = PROGRAMS / self.program
        data = folder / ("run.DAT" if self.instrument in RAW else "run.csv")
        machine = folder / "true.toml"
        machine.write_text(f'name = "measured"\nextends = "chow1992"\n{self._hidden()}')
        call = [
            "measure", program, "--instrument", self.instrument, "--out", data, "--seed", self.seed,
            "--machine", machine, *([] if self.cut_s is None else ["--for", f"{self.cut_s}s"]),
        ]  # fmt: skip
        done = run_here(folder, *call)
        assert done.returncode == 0, done.stderr
        path = folder / "experiment.toml"
        path.write_text(
            f'machine = "chow1992"\n[[sensor]]\nkind = "{self.instrument}"\n{self.keys}\n'
            f'[[run]]\nprogram = "{program}"\ndata = "{data.name}"\npartial = true\n'
        )
        return path

    def _hidden(self) -> str:
        catalogue = catalogue_of(load_machine("chow1992"))
        lines = []
        for name, values in self.hidden.items():
            lines.append(f"[effects.{name}]")
            for key, value in values.items():
                unit = catalogue[name].parameter(key).unit
                stated = f'value = {value!r}, unit = "{unit}", origin = "assumed", place = "hidden"'
                lines.append(f"{key} = {{ {stated} }}")
        return "\n".join(lines)

    def verdict(self, folder: Path) -> Verdict:
        """What `mopro reconcile` says of the run."""
        return open_experiment(self.write(folder)).conclude().verdict
