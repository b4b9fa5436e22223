"""Arguments that several commands share, and their completion in a shell."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.say import say
from mopro.language.parse import GRAMMARS
from mopro.units import is_number_without_unit, parse_quantity, units_of

if TYPE_CHECKING:
    from mopro.machine import Machine
    from mopro.sweeps.drawn import Draws


if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    Items = list[CompletionItem]


# -- completion -------------------------------------------------------------------------------
# Completion of arguments in a shell: names that are built in, and files.


def machine_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.machine import builtin_machines

    return _or_file(builtin_machines(), incomplete)


def dialect_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.link import builtin_dialects

    return _or_file(builtin_dialects(), incomplete)


def instrument_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    from mopro.experiment.sawyer.raw import KINDS

    return _or_file(KINDS, incomplete)


def effect_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    """The effects of the catalogue, with what they are."""
    from mopro.effects import catalogue

    return _items({name: effect.equation() for name, effect in catalogue().items()}, "", incomplete)


def varied_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    """Completions of --vary: quantities of the built-in machine and its effects, with `=`."""
    from mopro.effects import catalogue
    from mopro.machine import load_machine
    from mopro.program import AXES
    from mopro.program.settings import SETTINGS

    of_effects = (
        (f"effects.{name}.{p.name}", p.meaning)
        for name, effect in catalogue().items()
        for p in effect.parameters
    )
    words = {f"{setting}{axis}": "of the program" for setting in SETTINGS for axis in AXES}
    words |= {"payload": "mass carried by the motor"}
    words |= {place.name: place.unit for place in load_machine("chow1992").places()}
    words |= dict(of_effects)
    return _items({f"{word}=": text for word, text in words.items()}, "", incomplete)


def rule_names(context: click.Context, param: click.Parameter, incomplete: str) -> Items:
    """The rules of lint, after the last comma."""
    from mopro.lint.rules import RULES

    before, comma, last = incomplete.rpartition(",")
    return _items({name: rule.what for name, rule in RULES.items()}, before + comma, last)


def _items(words: Mapping[str, str], before: str, incomplete: str) -> Items:
    """The words that begin so, with the first line of what they mean."""
    from click.shell_completion import CompletionItem

    return [
        CompletionItem(before + word, help=text.partition("\n")[0])
        for word, text in words.items()
        if word.startswith(incomplete)
    ]


def _or_file(names: Iterable[str], incomplete: str) -> Items:
    """The `names` that begin so, or else files."""
    from click.shell_completion import CompletionItem

    found = [CompletionItem(name) for name in names if name.startswith(incomplete)]
    return [*found, CompletionItem(incomplete, type="file")]


# -- options ----------------------------------------------------------------------------------
# Arguments that several commands share.

_HEAVIEST_KG = 1e6


class Quantity(click.ParamType[float]):
    """A number with a unit of one dimension, such as `5lb`; at least 0, at most `most` (SI).

    The unit that is taken for a bare number is said on standard error, unless `says_unit` is
    false.
    """

    def __init__(
        self,
        dimension: str,
        default_unit: str,
        positive: bool = False,
        most: float = math.inf,
        says_unit: bool = True,
    ) -> None:
        self.name = dimension
        self._dimension = dimension
        self._default_unit = default_unit
        self._positive = positive
        self._most = most
        self._says_unit = says_unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        if isinstance(value, float):
            return value
        unit = self._default_unit
        if self._says_unit and param is not None and is_number_without_unit(value):
            say(f"{param.opts[0]} {value}: taken as {value} {unit}", err=True)
        try:
            quantity = parse_quantity(value, self._dimension, self._default_unit)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        if quantity < 0 or (self._positive and quantity == 0):
            bound = "greater than" if self._positive else "at least"
            self.fail(f"'{value}' must be {bound} 0", param, ctx)
        if quantity > self._most:
            unit = units_of(self._dimension)[0]
            self.fail(f"'{value}' must be at most {self._most:g} {unit}", param, ctx)
        return quantity


def duration_type() -> Quantity:
    """Limit of the time that a run may take."""
    from mopro.motion import LONGEST_RUN_S

    return Quantity("time", "s", positive=True, most=LONGEST_RUN_S)


def payload_type() -> Quantity:
    """A mass that the motor carries."""
    return Quantity("mass", "kg", most=_HEAVIEST_KG)


def share_type(positive: bool = False, most: float = 1.0) -> Quantity:
    """A share, such as 90% or 0.9."""
    return Quantity("ratio", "1", positive, most, says_unit=False)


# Stands for standard input or output.
STANDARD = Path("-")


class OutputFile(click.ParamType[Path]):
    """A path to write to, with one of some suffixes; with `standard` also `-`."""

    name = "file"

    def __init__(self, *suffixes: str, standard: bool = False) -> None:
        self._suffixes = suffixes
        self._standard = standard

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(value)
        if self._standard and path == STANDARD:
            return path
        if path.suffix.lower() not in self._suffixes:
            known = ", ".join(self._suffixes)
            self.fail(f"'{value}' must end in one of {known}", param, ctx)
        return path


def allow_python_option() -> Callable[[Any], Any]:
    return click.option(
        "--allow-python",
        is_flag=True,
        help="Run a machine's model that is a program; look at it first if it is not yours.",
    )


def machine_option() -> Callable[[Any], Any]:
    return click.option(
        "--machine",
        default="chow1992",
        show_default=True,
        help="Built-in name or file.",
        shell_complete=machine_names,
    )


def vary_option() -> Callable[[Any], Any]:
    return click.option(
        "--vary",
        multiple=True,
        required=True,
        metavar="NAME=VALUES",
        shell_complete=varied_names,
        help="What to vary, and over which values; once for each (VEL1=10:60:2, payload=0,5lb).",
    )


def draws_option() -> Callable[[Any], Any]:
    return click.option(
        "--draws",
        type=click.IntRange(1, 100_000),
        metavar="N",
        help="Run each point on N machines as well, drawn from the intervals of the machine file.",
    )


def drawn_machines(draws: int | None, seed: int, band: float = 0.9) -> Draws | None:
    """The machines that `--draws` asks for."""
    from mopro.sweeps.drawn import Draws

    return None if draws is None else Draws(draws, seed, band)


def payload_option() -> Callable[[Any], Any]:
    return click.option(
        "--payload",
        type=payload_type(),
        default=0.0,
        metavar="MASS",
        help="Mass carried by the motor (5lb, 2kg).",
    )


def for_option() -> Callable[[Any], Any]:
    return click.option(
        "--for",
        "for_s",
        type=duration_type(),
        metavar="DURATION",
        help="Stop after this much time (10s, 2min); 60 s for a program that loops for ever.",
    )


def varied_pair(text: str) -> tuple[str, str]:
    """Name and values of one `--vary`."""
    name, equals, values = text.partition("=")
    if not equals:
        raise click.BadParameter(
            f"'{text}': expected NAME=VALUES, such as VEL1=10:60:2", param_hint="--vary"
        )
    return name.strip(), values


def program_argument() -> Callable[[Any], Any]:
    return click.argument("file", type=click.Path())


def grammar_option() -> Callable[[Any], Any]:
    return click.option(
        "--grammar",
        type=click.Choice(list(GRAMMARS)),
        default="attested",
        show_default=True,
        help="Which statements exist; `extended` adds assumed ones (absolute move, seek, ...).",
    )


# -- effects of other runs ---------------------------------------------------------------------
# The note on effects of a machine file that are off in a simulation.


def tell_of_runs(machine: Machine) -> None:
    """Tell on standard error which effects are off in a simulation, which is a run of its own."""
    from mopro.machine.run_effects import absence_notes

    for line in absence_notes(machine.name, machine.runs):
        say(line, err=True)
