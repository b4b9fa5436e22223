"""A folder to start in: a program, a machine, an experiment, and a page whose commands run."""

from __future__ import annotations

from pathlib import Path

from mopro.errors import DataError
from mopro.files import make_folder, write

_PROGRAM = """\
UU012500/1
VEL1 15.0
ACC1 0.2
MRI1 2.0
WX1
WT400
VEL1 4.0
MRI1 -2.0
WX1
WT400
"""

_MACHINE = """\
# The machine that stands in for yours: chow1992, and a drag that its model does not have.
# `mopro machine show chow1992` prints all numbers that may be stated here.

name = "mine"
extends = "chow1992"

[effects.viscous_drag]
b = { value = 9.0, unit = "N s/m", origin = "assumed", place = "to be found again" }
"""

_EXPERIMENT = """\
# What was measured, and the machine that it is compared with.
# docs/experiments.md of mopro explains each key.

machine = "chow1992"

[[sensor]]
kind = "encoder"

[[run]]
program = "move.CMD"
data = "pass.csv"
"""

_README = """\
# A first experiment

| file | |
|---|---|
| `move.CMD` | a program: out and back, at two speeds |
| `machine.toml` | a machine that stands in for yours: `chow1992` with a drag |
| `experiment.toml` | which data belong to which program, and which sensor wrote them |

Run the program on the nominal machine:

```sh
mopro run move.CMD --emulate
```

Measure it on the other machine, as an encoder would. With a machine of your own, put its log in the
place of `pass.csv`; `mopro import LOG --as FOLDER` makes an experiment of a log as it is.

```sh
mopro measure move.CMD --machine machine.toml --instrument encoder --out pass.csv
```

Where do data and simulation disagree? (Exit code 1: they do.)

```sh
mopro compare experiment.toml
```

What does the simulation lack?

```sh
mopro reconcile experiment.toml --out repaired.toml --report why.html
```

The data against the repaired machine:

```sh
mopro compare experiment.toml --apply repaired.toml
```
"""

FILES = {
    "move.CMD": _PROGRAM,
    "machine.toml": _MACHINE,
    "experiment.toml": _EXPERIMENT,
    "README.md": _README,
}


def start(folder: Path) -> list[Path]:
    """Write the files of a first experiment to `folder`, which is made; the files.

    Raises DataError where one of them exists already, before anything is written.
    """
    files = {folder / name: text for name, text in FILES.items()}
    there = [str(file) for file in files if file.exists() or file.is_symlink()]
    if there:
        message = f"{', '.join(there)} exists, and nothing is overwritten: choose another folder"
        raise DataError(message, "exists")
    try:
        make_folder(folder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{folder}: cannot be made: {reason}", "unwritable-output") from error
    for file, text in files.items():
        write(file, text.encode())
    return list(files)
