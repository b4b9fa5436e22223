"""Commands on machines: `mopro machine`, `mopro limits`, `mopro thesis`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.options import (
    OutputFile,
    machine_names,
    machine_option,
    payload_option,
    tell_of_runs,
)
from mopro.cli.outputs import claimed, drawn, keep_inputs, machine_file
from mopro.cli.say import print_table, say, say_json
from mopro.errors import ModelError

if TYPE_CHECKING:
    from mopro.emulator.limits import Limit
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
def machine() -> None:
    """Show and check machine files.

    Example: mopro machine show chow1992
    """


@machine.command()
@click.argument("machine", default="chow1992", shell_complete=machine_names)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(machine: str, as_json: bool) -> None:
    """Print every number of a machine, in SI, and where it comes from.

    Example: mopro machine show chow1992
    """
    from mopro.machine import load_machine
    from mopro.stated.file import kind_of, load_stated

    if kind_of(machine) is not None:
        stated = load_stated(machine)
        name, rows = stated.name, list(_of_stated(stated))
    else:
        loaded = load_machine(machine)
        name, rows = loaded.name, [*loaded.quantities(), *_effects(loaded)]
    if as_json:
        say_json({"name": name, "quantities": rows})
        return
    keys = ("key", "value", "unit", "origin", "place")
    cells = [[str(row[key]) for key in keys] for row in rows]
    for row, cell in zip(rows, cells, strict=True):
        if row.get("tolerance"):
            cell[1] += f" ± {row['tolerance']:.3g} of it"
    print_table(("quantity", "value", "unit", "origin", "place"), cells, _MOST_ROWS)


@machine.command()
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


@machine.command()
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


@machine.command()
def effects() -> None:
    """Print all effects that a machine file may switch on, as Markdown.

    Example: mopro machine effects > effects.md
    """
    from mopro.effects.catalogue_page import markdown

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
    """A row for each number and law of a stated machine, and for each effect in it."""
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


# -- mopro limits -----------------------------------------------------------------------------

_OF_LIMITS = ("peak velocity (in/s)", "profile", "acceleration (in/s²)", "force (N)", "move (s)")


class Velocities(click.ParamType[list[float]]):
    """Numbers with commas between."""

    name = "numbers"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> list[float]:
        try:
            numbers = [float(word) for word in value.split(",")]
        except ValueError:
            self.fail(f"'{value}' is no list of numbers such as 10,20,40", param, ctx)
        if not all(0 < number <= 200 for number in numbers):
            self.fail("velocities must be above 0 and at most 200 in/s", param, ctx)
        return numbers


@click.command()
@machine_option()
@payload_option()
@click.option(
    "--velocities",
    type=Velocities(),
    default="10,20,30,40,50,60",
    show_default=True,
    help="Peak velocities in in/s.",
)
@click.option(
    "--distance",
    type=click.FloatRange(0.01, 50),
    default=15.0,
    show_default=True,
    help="The move that is timed, in inches.",
)
@click.option(
    "--drive",
    type=click.Choice(["full", "machine"]),
    default="full",
    show_default=True,
    help="`full`: with the limited supply; `machine`: as the machine file says.",
)
@click.option("--plot", type=OutputFile(".png", ".svg", ".pdf"), help="A picture of the table.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def limits(
    machine: str,
    payload: float,
    velocities: list[float],
    distance: float,
    drive: str,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Find the largest acceleration that the motor follows, against peak velocity.

    Searched by emulating moves, for the trapezoid and for parabolic ramps. Parabolic
    ramps start with more acceleration; where the supply limits the force at speed they
    also finish the same move sooner.

    Example: mopro limits --payload 5lb --plot limits.png
    """
    from mopro.emulator.limits import find_limits, with_full_drive
    from mopro.machine import load_machine

    keep_inputs([("--plot", plot)], [("--machine", machine_file(machine))])
    loaded = load_machine(machine)
    tell_of_runs(loaded)
    if drive == "full":
        loaded = with_full_drive(loaded)
    with claimed(plot):
        limits = find_limits(loaded, payload, velocities, distance)
    figure = _figure(limits, f"{loaded.name}, payload {payload:g} kg")
    code = 0 if drawn(plot, figure) else EXIT_FAILED
    if as_json:
        say_json([asdict(limit) for limit in limits])
        return code

    print_table(_OF_LIMITS, map(_of_limit, limits), 1000)
    say(f"{loaded.name}, payload {payload:g} kg; the timed move is {distance:g} in.")
    _print_soonest(limits)
    return code


def _print_soonest(limits: list[Limit]) -> None:
    """For each profile the duration of its fastest move."""
    from mopro.emulator.limits import PROFILES

    for profile in PROFILES:
        moves = [
            (e.duration_s, e.velocity) for e in limits if e.profile == profile and e.duration_s
        ]
        if moves:
            say(f"Soonest with {profile}: {min(moves)[0]:.4f} s at {min(moves)[1]:g} in/s.")


def _of_limit(limit: Limit) -> list[str]:
    numbers = [(limit.acceleration, ".0f"), (limit.peak_force_N, ".1f"), (limit.duration_s, ".4f")]
    cells = ["stalls" if n is None else format(n, form) for n, form in numbers]
    return [f"{limit.velocity:g}", limit.profile, *cells]


def _figure(limits: list[Limit], title: str) -> Callable[[str], bytes]:
    def figure(form: str) -> bytes:
        from mopro.plot import figure_bytes
        from mopro.plot.limits import plot_limits

        return figure_bytes(plot_limits(limits, title), form)

    return figure


# -- mopro thesis -----------------------------------------------------------------------------

_NAMES = ["3.2", "3.3", "4.1", "4.2", "4.3", "4.4", "4.5"]
_OF_TABLES = ("row", "quantity", "printed", "computed", "deviation", "note")


@click.command()
@click.argument("name", metavar="[TABLE]", type=click.Choice(_NAMES), required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def thesis(name: str | None, as_json: bool) -> None:
    """Print the source's tables beside what mopro computes.

    Tables 3.2, 3.3, 4.1 to 4.5; all of them without a name. Misprinted formulas are
    evaluated as printed, and marked.

    Example: mopro thesis 3.2
    """
    from mopro.thesis import table

    tables = {key: table(key) for key in ([name] if name else _NAMES)}
    if as_json:
        say_json([asdict(row) for rows in tables.values() for row in rows])
        return
    for key, rows in tables.items():
        say(f"Table {key}")
        cells = [
            [r.row, r.quantity, _cell(r.printed), _cell(r.computed), _share(r.deviation), r.note]
            for r in rows
        ]
        print_table(_OF_TABLES, cells, _MOST_ROWS)


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _share(deviation: float | None) -> str:
    return "" if deviation is None else f"{deviation:+.3%}"
