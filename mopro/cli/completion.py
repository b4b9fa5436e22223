"""`mopro completion`."""

from __future__ import annotations

import os
from pathlib import Path

import click

from mopro.cli.terminal.say import say

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
def command(shell: str, install: bool, force: bool) -> None:
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
    from mopro.files import make_folder, write

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
