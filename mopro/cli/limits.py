"""`mopro limits`."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.terminal.of_runs import tell_of_runs
from mopro.cli.terminal.options import OutputFile, machine_option, payload_type
from mopro.cli.terminal.outputs import claimed, drawn, keep_inputs, machine_file
from mopro.cli.terminal.say import say

if TYPE_CHECKING:
    from mopro.emulator.limits import Limit

_COLUMNS = ("peak velocity (in/s)", "profile", "acceleration (in/s²)", "force (N)", "move (s)")


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
@click.option("--payload", type=payload_type(), default=0.0, metavar="MASS")
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
def command(
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
    from mopro.emulator.limits import PROFILES, find_limits, with_full_drive
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
        say(json.dumps([asdict(limit) for limit in limits], indent=1))
        return code
    from mopro.cli.terminal.table import print_table

    print_table(_COLUMNS, map(_cells, limits), 1000)
    say(f"{loaded.name}, payload {payload:g} kg; the timed move is {distance:g} in.")
    for profile in PROFILES:
        moves = [
            (e.duration_s, e.velocity) for e in limits if e.profile == profile and e.duration_s
        ]
        if moves:
            say(f"Soonest with {profile}: {min(moves)[0]:.4f} s at {min(moves)[1]:g} in/s.")
    return code


def _cells(limit: Limit) -> list[str]:
    numbers = [(limit.acceleration, ".0f"), (limit.peak_force_N, ".1f"), (limit.duration_s, ".4f")]
    cells = ["stalls" if n is None else format(n, form) for n, form in numbers]
    return [f"{limit.velocity:g}", limit.profile, *cells]


def _figure(limits: list[Limit], title: str) -> Callable[[str], bytes]:
    def figure(form: str) -> bytes:
        from mopro.plot import figure_bytes
        from mopro.plot.limits import plot_limits

        return figure_bytes(plot_limits(limits, title), form)

    return figure
