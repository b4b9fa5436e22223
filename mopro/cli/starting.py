"""Commands to begin with: `mopro init`, `mopro completion`.

`mopro init` makes a folder to start in: a program, a machine, an experiment, and a page whose
commands run.
"""

from __future__ import annotations

import os
from pathlib import Path

import click

from mopro.cli.say import say
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
    make_folder(folder)
    for file, text in files.items():
        write(file, text.encode())
    return list(files)


# -- mopro init -------------------------------------------------------------------------------


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
def init(folder: Path) -> None:
    """Make a folder to start in: a program, a machine, an experiment and a README.

    The commands of its README run as they stand, in the folder. No file is overwritten.

    Example: mopro init first && cd first
    """
    for file in start(folder):
        say(str(file))
    say(f"next: cd {folder}, and the commands of README.md")


# -- mopro completion -------------------------------------------------------------------------

_SHELLS = ("bash", "zsh", "fish")
_VARIABLE = "_MOPRO_COMPLETE"
# shell -> the folder under the user's data or configuration, and the file that it looks for
_PLACES = {
    "bash": ("XDG_DATA_HOME", ".local/share", "bash-completion/completions/mopro"),
    "zsh": ("XDG_DATA_HOME", ".local/share", "zsh/site-functions/_mopro"),
    "fish": ("XDG_CONFIG_HOME", ".config", "fish/completions/mopro.fish"),
}


@click.command()
@click.argument("shell", type=click.Choice(_SHELLS))
@click.option("--install", is_flag=True, help="Write it where the shell looks for it.")
@click.option("--force", is_flag=True, help="Let --install replace a file of another origin.")
def completion(shell: str, install: bool, force: bool) -> None:
    """Print what makes a shell complete commands, options, machines, rules and effects.

    Bash 4.4 or newer with the package bash-completion, zsh or fish.

    Example: mopro completion bash --install
    """
    from click.shell_completion import get_completion_class

    from mopro.cli.main import group

    kind = get_completion_class(shell)
    assert kind is not None, "the choices are those of click"
    script = kind(group, {}, "mopro", _VARIABLE).source()
    if not install:
        say(script)
        return
    place = _place(shell)
    _keep_others(place, force)

    make_folder(place.parent)
    write(place, f"{script}\n".encode())
    say(f"Completion: {place}")
    if shell == "zsh":
        say(f"Put `fpath=({place.parent} $fpath)` before `compinit` in ~/.zshrc.")
    say("New shells complete `mopro`.")


def _place(shell: str) -> Path:
    variable, folder, name = _PLACES[shell]
    stated = os.environ.get(variable, "")
    base = Path(stated) if os.path.isabs(stated) else Path.home() / folder
    return base / name


def _keep_others(place: Path, force: bool) -> None:
    """UsageError for a file that `mopro completion` did not write, unless `force` is given."""
    if force or not place.is_file():
        return
    if _VARIABLE.encode() not in place.read_bytes():
        message = f"{place} is there and was not written by mopro completion"
        raise click.UsageError(f"{message}: move it away, or add --force")
