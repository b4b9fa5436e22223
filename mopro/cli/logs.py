"""Commands on logs: `mopro import`, `mopro noise`, and the options that they share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.say import say, say_json

if TYPE_CHECKING:
    from mopro.importing import Imported
    from mopro.logs import Asked, Column, Log
    from mopro.noise import NoiseReport
    from mopro.noise.spectral import Line, Memory


_TIME_UNITS = ("s", "ms", "us", "ns", "min", "h")


def log_options() -> Callable[[Any], Any]:
    """Options for facts that a log may not state: its times, its words for a missing reading."""
    options = [
        click.option("--time", metavar="COLUMN", help="The column of times."),
        click.option("--time-unit", type=click.Choice(_TIME_UNITS), help="Unit of the times."),
        click.option(
            "--rate",
            type=click.FloatRange(0, min_open=True),
            metavar="HZ",
            help="Rows a second, for a log without times.",
        ),
        click.option(
            "--missing",
            multiple=True,
            metavar="VALUE",
            help="A word or number for a missing reading.",
        ),
    ]

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def asked_of(
    time: str | None, time_unit: str | None, rate: float | None, missing: tuple[str, ...]
) -> Asked:
    """The options as the reader of logs takes them."""
    from mopro.logs import Asked

    if time is not None and rate is not None:
        raise click.UsageError("--time and --rate exclude each other: state one of them")
    return Asked(time, time_unit, rate, missing)


# -- mopro import -----------------------------------------------------------------------------

_KINDS = ("kinematic", "axis", "thermal", "sawyer")


@click.command()
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--as", "folder", type=click.Path(path_type=Path), required=True, help="A folder to write."
)
@click.option("--kind", type=click.Choice(_KINDS), help="Kind of machine, if the log does not say.")
@click.option("--command", "commands", multiple=True, metavar="COLUMN", help="What it was told.")
@click.option("--measured", multiple=True, metavar="COLUMN", help="Use only these as sensors.")
@click.option("--unit", "units", multiple=True, metavar="COLUMN=UNIT", help="A column's unit.")
@log_options()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def import_logs(
    logs: tuple[Path, ...],
    folder: Path,
    kind: str | None,
    commands: tuple[str, ...],
    measured: tuple[str, ...],
    units: tuple[str, ...],
    as_json: bool,
    **stated: Any,
) -> None:
    """Make an experiment of a log: its data, a machine file and an experiment file.

    Several logs have several clocks; their offset is estimated where a command in one and a
    measurement in the other can be compared. Every decision is a line of the experiment file
    with its reason; lines with CHECK are to be read first. No file is overwritten.

    Example: mopro import servo.csv --as servo/ && mopro compare servo/experiment.toml
    """
    from mopro.importing import Wishes, import_logs

    wishes = Wishes(kind, commands, measured, dict(map(_column_and_unit, units)))
    done = import_logs(logs, folder, wishes, asked_of(**stated))
    if as_json:
        say_json(_as_json(done))
    else:
        _print_import(done)


def _as_json(done: Imported) -> dict[str, Any]:
    return {
        "kind": done.proposal.kind,
        "files": [str(file) for file in done.files],
        "command": done.proposal.command and done.proposal.command.raw,
        "inputs": [s.raw for s in done.proposal.inputs],
        "sensors": [s.raw for s in done.proposal.sensors],
        "unused": {s.raw: s.reason for s in done.proposal.unused},
        "decisions": [
            {"subject": d.subject, "taken_as": d.taken_as, "reason": d.reason, "check": d.check}
            for d in done.decisions
        ],
        "check": _checks(done.files[0]),
        "rows": done.rows.as_json(),
    }


def _print_import(done: Imported) -> None:
    for decision in done.decisions:
        say(str(decision))
    for signal in done.proposal.signals:
        role = "not used" if signal.role == "unused" else signal.role
        say(f"column {signal.raw}: {role} ({signal.reason})")
    for words in _checks(done.files[0]):
        say(f"CHECK: {words}")
    say(f"written: {', '.join(map(str, done.files))}")
    say(f"next: mopro compare {done.files[0]}")


def _column_and_unit(text: str) -> tuple[str, str]:
    """The column and the unit of `pos=mm`; a column's name may have a sign of equality."""
    column, _, unit = text.rpartition("=")
    if not column:
        raise click.BadParameter(f"expected COLUMN=UNIT, such as pos=mm, found {text}", None, None,
                                 "--unit")  # fmt: skip
    return column, unit


def _checks(experiment: Path) -> list[str]:
    """The lines of the files that ask for a check, in their order."""
    found = []
    for file in (experiment, experiment.with_name("machine.toml")):
        if file.exists():
            lines = file.read_text("utf-8").splitlines()
            found += [line.removeprefix("# CHECK: ") for line in lines if "# CHECK: " in line[:9]]
    return found


# -- mopro noise ------------------------------------------------------------------------------

_MOST_SHOWN = 5


@click.command()
@click.argument("data", type=click.Path(path_type=Path))
@click.option("--column", "wanted", multiple=True, metavar="C", help="Only this column.")
@click.option("--from", "start_s", type=float, metavar="S", help="Standstill from this time ...")
@click.option("--to", "end_s", type=float, metavar="S", help="... to this one, in s.")
@log_options()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def noise(
    data: Path,
    wanted: tuple[str, ...],
    start_s: float | None,
    end_s: float | None,
    as_json: bool,
    **stated: Any,
) -> int:
    """Tell the noise of a log's columns at standstill, and what to state of it.

    Finds where a column stands still, and measures there: the level with its 95 % interval,
    memory, hum, the converter's step, outliers and stuck stretches. Exits with 1 if no column
    stands still.

    Example: mopro noise standstill.csv --column position_1_in
    """
    from mopro.logs import read_log

    log = read_log(data, asked_of(**stated))
    entries = [
        _entry(log, column, start_s, end_s, named=bool(wanted)) for column in _chosen(log, wanted)
    ]
    if as_json:
        answer = {
            "file": str(data),
            "columns": entries,
            "decisions": list(map(str, log.decisions)),
            "rows": log.rows.as_json(),
        }
        say_json(answer)
    else:
        _print(log, entries)
    return 0 if any("reason" not in entry for entry in entries) else EXIT_FAILED


def _entry(
    log: Log, column: Column, start_s: float | None, end_s: float | None, named: bool
) -> dict[str, Any]:
    """The noise of a column, or the reason why none is told: that of a command, if not `named`."""
    from mopro.logs.column_names import is_command
    from mopro.noise import TooShort

    if is_command(column.name) and not named:
        return {"column": column.raw, "reason": "it is a command by its name"}
    try:
        rows, noise = _noise_of(log, column, start_s, end_s)
    except TooShort as error:
        entry: dict[str, Any] = {"column": column.raw, "reason": str(error)}
    else:
        entry = as_data(column, log, rows, noise)
    return entry | {"ends": _ends(column, log)}


def _chosen(log: Log, wanted: tuple[str, ...]) -> list[Column]:
    by_name = {column.raw: column for column in log.columns}
    for name in wanted:
        if name not in by_name:
            known = ", ".join(by_name) or "none"
            raise click.UsageError(f"there is no column {name} of numbers; there are {known}")
    return [by_name[name] for name in wanted] or list(log.columns)


def _noise_of(
    log: Log, column: Column, start_s: float | None, end_s: float | None
) -> tuple[Any, NoiseReport]:
    """The rows of the column's readings, and the report on them."""
    from mopro.noise import report

    times = log.time_of(column)
    rows = column.present
    stated = start_s is not None or end_s is not None
    if stated:
        absolute = times[rows] + log.origins[column.clock]
        low = -float("inf") if start_s is None else start_s
        high = float("inf") if end_s is None else end_s
        rows = rows[(absolute >= low) & (absolute <= high)]
    return rows, report(times[rows], column.values[rows], whole=stated)


def _ends(column: Column, log: Log) -> list[dict[str, Any]]:
    """Ends of its range at which the column may have stayed."""
    from mopro.noise import ends_of

    rows = column.present
    return [
        {
            "value": end.value,
            "count": end.count,
            "line": log.line_of(int(rows[end.first])),
            "words": end.words(column.unit or ""),
        }
        for end in ends_of(column.values[rows])
        if end.certain or end.sharp
    ]


def as_data(column: Column, log: Log, rows: Any, noise: NoiseReport) -> dict[str, Any]:
    """The report as JSON has it: times from the beginning of the log's clock, lines of the file."""
    times = log.time_of(column)[rows] + log.origins[column.clock]

    def stretch(limits: tuple[int, int]) -> dict[str, float]:
        first, last = limits[0], limits[1] - 1
        return {
            "from_s": float(times[first]),
            "to_s": float(times[last]),
            "line": log.line_of(int(rows[first])),
        }

    return {
        "column": column.raw,
        "unit": column.unit,
        "readings": noise.readings,
        "rate_hz": noise.rate_hz,
        "regular": noise.regular,
        "standstill": [stretch(limits) for limits in noise.stretches],
        "noise_rms": {
            "value": noise.rms.value,
            "ci95": [noise.rms.low, noise.rms.high],
            "hidden_by_step": noise.hidden,
        },
        "adc_step": noise.step,
        "memory": noise.memory and _memory_as_data(noise.memory),
        "hum": [_line_as_data(line) for line in noise.lines],
        "outliers": [
            {"time_s": float(times[i]), "line": log.line_of(int(rows[i]))} for i in noise.outliers
        ],
        "stuck": [stretch(limits) for limits in noise.stuck],
        "held_for": noise.held,
        "wanders": noise.wanders,
        "state": _state(noise),
    }


def _memory_as_data(memory: Memory) -> dict[str, Any]:
    return {
        "kind": memory.kind,
        "white_rms": memory.white_rms,
        "correlation": memory.correlation,
        "correlation_ci": memory.correlation_ci,
        "time_constant_s": memory.time_constant_s,
        "corner_hz": memory.corner_hz,
        "corner_ci_hz": list(memory.corner_ci_hz),
        "slope": memory.slope,
        "slope_ci": memory.slope_ci,
    }


def _line_as_data(line: Line) -> dict[str, Any]:
    return {
        "frequency_hz": line.frequency_hz,
        "frequency_ci_hz": line.frequency_ci_hz,
        "amplitude": line.amplitude,
        "amplitude_ci": line.amplitude_ci,
        "mains_hz": line.mains_hz,
    }


def _state(noise: NoiseReport) -> dict[str, float]:
    """The keys of a sensor to write, in four digits."""
    stated = {}
    if not noise.hidden:
        stated["noise_rms"] = float(f"{noise.noise_rms:.4g}")
    if noise.adc_step:
        stated["adc_step"] = float(f"{noise.adc_step:.6g}")
    return stated


def _print(log: Log, entries: list[dict[str, Any]]) -> None:
    for decision in log.decisions:
        say(f"{'CHECK: ' if decision.check else ''}{decision}")
    say(f"{'CHECK: ' if log.rows.to_check else ''}rows: {log.rows}")
    for entry in entries:
        say()
        if "reason" in entry:
            say(f"{entry['column']}: no noise told: {entry['reason']}")
        else:
            say("\n".join(_lines(entry)))
        for end in entry.get("ends", ()):
            say(f"  CHECK: {end['words']} (first in line {end['line']})")


def _lines(entry: dict[str, Any]) -> list[str]:
    unit = f" {entry['unit']}" if entry["unit"] else ""
    stretches = entry["standstill"]
    first = stretches[0]
    where = f"{len(stretches)} stretches" if len(stretches) > 1 else "one stretch"
    wanders = "CHECK: it wanders as long as it was watched: does it stand still?"
    return [
        f"{entry['column']}: {entry['readings']} readings at standstill, {where} from "
        f"{first['from_s']:.6g} s (line {first['line']})",
        f"  noise      {_level(entry, unit)}",
        f"  memory     {_memory(entry)}",
        f"  hum        {_hum(entry, unit)}",
        f"  step       {_step(entry, unit)}",
        f"  outliers   {_places(entry['outliers'])}",
        f"  stuck      {_stuck(entry['stuck'])}",
        *([f"  {wanders}"] if entry["wanders"] else []),
        "  write into the experiment:",
        *[f"    {key} = {value!r}" for key, value in entry["state"].items()],
    ]


def _level(entry: dict[str, Any], unit: str) -> str:
    level = entry["noise_rms"]
    if level["hidden_by_step"]:
        return f"less than the step of {entry['adc_step']:.4g}{unit}: no reading left its code"
    low, high = level["ci95"]
    return f"{level['value']:.4g}{unit} rms (95 %: {low:.4g} to {high:.4g})"


def _memory(entry: dict[str, Any]) -> str:
    memory = entry["memory"]
    if memory is None:
        return "not judged: the sampling is irregular or the stretches are short"
    if memory["kind"] == "white":
        return "none: white noise"
    if memory["kind"] == "ar1":
        share, half = memory["correlation"], memory["correlation_ci"]
        decay = memory["time_constant_s"]
        lasting = f", decays in {decay:.3g} s" if decay else ""
        return f"neighbours correlate by {share:.3f} ± {half:.3f}{lasting}"
    low, high = memory["corner_ci_hz"]
    return (
        f"grows below {memory['corner_hz']:.3g} Hz (95 %: {low:.3g} to {high:.3g}) as "
        f"f^{memory['slope']:.2f} ± {memory['slope_ci']:.2f}, over white noise of "
        f"{memory['white_rms']:.4g} rms"
    )


def _hum(entry: dict[str, Any], unit: str) -> str:
    if not entry["hum"]:
        return "none"
    words = []
    for line in entry["hum"]:
        alias = f", {line['mains_hz']:g} Hz sampled too slowly" if line["mains_hz"] else ""
        words.append(
            f"{line['frequency_hz']:.5g} ± {line['frequency_ci_hz']:.1g} Hz, amplitude "
            f"{line['amplitude']:.3g} ± {line['amplitude_ci']:.1g}{unit}{alias}"
        )
    return "; ".join(words)


def _step(entry: dict[str, Any], unit: str) -> str:
    held = entry["held_for"]
    repeats = f"; each value is repeated {held} times" if held > 1 else ""
    return (f"{entry['adc_step']:.6g}{unit}" if entry["adc_step"] else "none seen") + repeats


def _places(entries: list[dict[str, Any]]) -> str:
    shown = ", ".join(f"line {entry['line']}" for entry in entries[:_MOST_SHOWN])
    more = f" and {len(entries) - _MOST_SHOWN} more" if len(entries) > _MOST_SHOWN else ""
    return f"{len(entries)}: {shown}{more}; left out" if entries else "none"


def _stuck(entries: list[dict[str, Any]]) -> str:
    shown = [
        f"{e['from_s']:.6g} to {e['to_s']:.6g} s (line {e['line']})" for e in entries[:_MOST_SHOWN]
    ]
    more = f" and {len(entries) - _MOST_SHOWN} more" if len(entries) > _MOST_SHOWN else ""
    return ", ".join(shown) + more if entries else "none"
