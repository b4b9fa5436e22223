"""`mopro machine`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.say import say
from mopro.errors import ModelError

if TYPE_CHECKING:
    from mopro.machine import Machine
    from mopro.rig.model import Rig

_SECTIONS = ("axis", "drive", "platen", "heat", "forcers", "limits")
_MOST_ROWS = 200
_UNREADABLE = ("unknown-machine", "too-large")


@click.group()
def command() -> None:
    """Show and check machine files.

    Example: mopro machine show chow1992
    """


@command.command()
@click.argument("machine", default="chow1992")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(machine: str, as_json: bool) -> None:
    """Print every number of a machine, in SI, and where it comes from.

    Example: mopro machine show chow1992
    """
    from mopro.cli.table import print_table
    from mopro.machine import load_machine
    from mopro.rig.file import kind_of, load_rig

    if kind_of(machine) is not None:
        rig = load_rig(machine)
        name, rows = rig.name, list(_of_rig(rig))
    else:
        loaded = load_machine(machine)
        name, rows = loaded.name, [*_quantities(loaded), *_effects(loaded)]
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
@click.argument("machines", nargs=-1, required=True)
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
def effects() -> None:
    """Print all effects that a machine file may switch on, as Markdown.

    Example: mopro machine effects > docs/effects.md
    """
    from mopro.effects.document import markdown

    say(markdown(), nl=False)


def _checked(machine: str) -> str:
    from mopro.effects import catalogue
    from mopro.effects.resolve import active_effects
    from mopro.machine import load_machine
    from mopro.plant import try_out
    from mopro.rig.file import kind_of, load_rig

    if kind_of(machine) is not None:
        return load_rig(machine).name
    loaded = load_machine(machine)
    active_effects(loaded, catalogue())
    try_out(loaded)
    return loaded.name


def _of_rig(rig: Rig) -> Iterator[dict[str, Any]]:
    """A row for each number and law of a machine of another kind, and for each effect in it."""
    for number in rig.numbers.values():
        origin = "free" if number.free else "stated"
        row = {"key": f"base.{number.name}", "value": number.value, "unit": number.unit}
        yield {**row, "origin": origin, "place": "", "tolerance": number.tolerance}
    for name, law in rig.laws.items():
        yield {"key": name, "value": law.formula.text, "unit": "", "origin": "law", "place": ""}
    for effect, values in rig.active.items():
        for name, value in values.items():
            row = {"key": f"effects.{effect}.{name}", "value": value, "unit": ""}
            yield {**row, "origin": "stated", "place": ""}


def _quantities(machine: Machine) -> list[dict[str, Any]]:
    from mopro.units import units_of

    rows = []
    for section in _SECTIONS:
        part = getattr(machine, section)
        for field in fields(part) if part is not None else ():
            key = f"{section}.{field.metadata['key']}"
            dimension = field.metadata.get("dimension")
            source = machine.provenance.get(key)
            rows.append(
                {
                    "key": key,
                    "value": getattr(part, field.name),
                    "unit": units_of(dimension)[0] if dimension else "",
                    "origin": source.origin if source else "assumed",
                    "place": source.place if source else "default",
                    "tolerance": source.tolerance if source else 0.0,
                }
            )
    return rows


def _effects(machine: Machine) -> list[dict[str, Any]]:
    from mopro.effects import catalogue
    from mopro.effects.resolve import active_effects

    rows = []
    for active in active_effects(machine, catalogue()):
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
    return rows
