"""`mopro machine`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.terminal.complete import machine_names
from mopro.cli.terminal.options import OutputFile
from mopro.cli.terminal.say import say
from mopro.errors import ModelError

if TYPE_CHECKING:
    from mopro.machine import Machine
    from mopro.stated.model import StatedMachine

_MOST_ROWS = 200
_EXTENDING = """# A machine that differs from BASE; all that is not stated here is that of BASE.
# `mopro machine show BASE` prints what there is.

name = "NAME"
extends = "BASE"

# What differs, each with unit and origin (thesis, derived, assumed or measured):
#
# [axis]
# moving_mass = { value = 2.8, unit = "kg", origin = "measured", place = "scales" }
#
# Effects beyond the model (docs/effects.md):
#
# [effects.viscous_drag]
# b = { value = 5.0, unit = "N s/m", origin = "measured", place = "mopro reconcile" }
"""
_UNREADABLE = ("unknown-machine", "too-large")


@click.group()
def command() -> None:
    """Show and check machine files.

    Example: mopro machine show chow1992
    """


@command.command()
@click.argument("machine", default="chow1992", shell_complete=machine_names)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(machine: str, as_json: bool) -> None:
    """Print every number of a machine, in SI, and where it comes from.

    Example: mopro machine show chow1992
    """
    from mopro.cli.terminal.table import print_table
    from mopro.machine import load_machine
    from mopro.stated.file import kind_of, load_stated

    if kind_of(machine) is not None:
        stated = load_stated(machine)
        name, rows = stated.name, list(_of_stated(stated))
    else:
        loaded = load_machine(machine)
        name, rows = loaded.name, [*loaded.quantities(), *_effects(loaded)]
    if as_json:
        say(json.dumps({"name": name, "quantities": rows}, indent=1))
        return
    keys = ("key", "value", "unit", "origin", "place")
    cells = [[str(row[key]) for key in keys] for row in rows]
    for row, cell in zip(rows, cells, strict=True):
        if row.get("tolerance"):
            cell[1] += f" ± {row['tolerance']:.3g} of it"
    print_table(("quantity", "value", "unit", "origin", "place"), cells, _MOST_ROWS)


@command.command()
@click.argument("machines", nargs=-1, required=True, shell_complete=machine_names)
def check(machines: tuple[str, ...]) -> int:
    """Check machine files: keys, units, bounds, effects, a trial move; exits with 1 for findings.

    Example: mopro machine check mine.toml
    """
    code = 0
    for machine in machines:
        try:
            name = _checked(machine)
        except ModelError as error:
            say(error.render(), err=True)
            unreadable = any(d.rule in _UNREADABLE for d in error.diagnostics)
            code = max(code, EXIT_BAD_INPUT if unreadable else EXIT_FAILED)
        else:
            say(f"{machine}: {name}: no findings")
    return code


@command.command()
@click.argument("file", type=OutputFile(".toml"))
@click.option(
    "--from",
    "base",
    metavar="NAME",
    default="chow1992",
    show_default=True,
    help="A built-in machine, or a kind: chow1992, kinematic, axis or thermal.",
)
@click.option("--extends", is_flag=True, help="State only what differs from the built-in machine.")
def new(file: Path, base: str, extends: bool) -> None:
    """Write a commented machine file to begin with; no file is overwritten.

    Example: mopro machine new mine.toml --from chow1992
    """
    from mopro.files import write
    from mopro.machine.file import builtin_machines, template, templates

    if base not in templates():
        raise click.UsageError(f"--from: no machine is called {base}: {', '.join(templates())}")
    if extends and base not in builtin_machines():
        raise click.UsageError("--extends needs a built-in machine: a kind has no numbers")
    if file.exists():
        raise click.UsageError(f"{file} exists, and is not overwritten: choose another name")
    text = _EXTENDING.replace("BASE", base) if extends else template(base)
    write(file, text.replace("NAME", toml_text(file.stem)).encode())
    say(f"written: {file}; check it with: mopro machine check {file}")


def toml_text(name: str) -> str:
    """A file's name as it may stand between quotes of TOML."""
    return "".join(c if c.isprintable() and c not in '\\"' else "_" for c in name)


@command.command()
def effects() -> None:
    """Print all effects that a machine file may switch on, as Markdown.

    Example: mopro machine effects > effects.md
    """
    from mopro.effects.document import markdown

    say(markdown(), nl=False)


def _checked(machine: str) -> str:
    from mopro.effects import catalogue_of
    from mopro.effects.resolve import active_effects
    from mopro.machine import load_machine
    from mopro.plant import try_out
    from mopro.stated.file import kind_of, load_stated

    if kind_of(machine) is not None:
        return load_stated(machine).name
    loaded = load_machine(machine)
    active_effects(loaded, catalogue_of(loaded))
    try_out(loaded)
    return loaded.name


def _of_stated(machine: StatedMachine) -> Iterator[dict[str, Any]]:
    """A row for each number and law of a machine of another kind, and for each effect in it."""
    for number in machine.numbers.values():
        origin = "free" if number.free else "stated"
        row = {"key": f"base.{number.name}", "value": number.value, "unit": number.unit}
        yield {**row, "origin": origin, "place": "", "tolerance": number.tolerance}
    for name, law in machine.laws.items():
        yield {"key": name, "value": law.formula.text, "unit": "", "origin": "law", "place": ""}
    for effect, values in machine.active.items():
        for name, value in values.items():
            row = {"key": f"effects.{effect}.{name}", "value": value, "unit": ""}
            yield {**row, "origin": "stated", "place": ""}


def _effects(machine: Machine) -> list[dict[str, Any]]:
    from mopro.effects import catalogue_of
    from mopro.effects.resolve import stated_effects

    rows: list[dict[str, Any]] = []
    for active in stated_effects(machine, catalogue_of(machine)):
        for parameter, value in zip(active.effect.parameters, active.values, strict=True):
            key = f"effects.{active.name}.{parameter.name}"
            source = machine.provenance.get(key)
            rows.append(
                {
                    "key": key,
                    "value": value,
                    "unit": parameter.unit,
                    "origin": source.origin if source else "stated",
                    "place": source.place if source else parameter.meaning,
                }
            )
        if runs := machine.runs.get(active.name):
            row = {"key": f"effects.{active.name}.runs", "value": ", ".join(runs), "unit": ""}
            rows.append({**row, "origin": "stated", "place": "off in all other runs"})
    return rows
