"""The command of a program, for a machine that goes where it is told."""

from __future__ import annotations

from pathlib import Path

from mopro.experiment.compare.labels import labels
from mopro.experiment.model import Floats, Trial
from mopro.experiment.predict.nominal import planned
from mopro.machine import load_machine
from mopro.program.compile import compile_file

_CONTROLLER = "chow1992"


def command_of(path: Path, time_s: Floats, axis: int = 1) -> Floats:
    """Commanded position (m) of an axis at `time_s`, as the controller of 1992 plans a program.

    Raises SourceError and MotionError for the program.
    """
    machine = load_machine(_CONTROLLER)
    trial = Trial(path.name, compile_file(path, "attested"), None, 0.0, (), partial=False)
    return labels(planned(trial, machine), axis, time_s, machine.microstep_m).command_m
