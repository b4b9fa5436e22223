"""Imports logs: reads them, aligns their clocks, writes a folder with data and experiment."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mopro.errors import DataError
from mopro.files import make_folder, output, write
from mopro.importing.imported_runs import file_of, ledger_of, recordings_of, rows_decision, run_of
from mopro.importing.propose import Proposal, Wishes, propose
from mopro.importing.ranges import stuck_in, unwrapped
from mopro.importing.roles import Chosen, Signal, signals_of, stated_unit
from mopro.importing.texts import experiment_text, machine_text, sawyer_labels
from mopro.instruments.agreement import Floats, agreement
from mopro.logs import Asked, Column, Decision, Log, Rows, read_log
from mopro.logs.timed import spacing_of

# Seconds since 1970: an earlier first stamp is a time of the log's own.
_FIRST_DATE_S = 1e8
_LATEST_START_S = 1.0
# Steps of different size of even stamps that were rounded, see _one_clock.
_STEPS_OF_EVEN = 3


@dataclass(frozen=True)
class Imported:
    """The files written, the decisions behind them, and the ledger of the log's rows."""

    files: tuple[Path, ...]
    proposal: Proposal
    decisions: tuple[Decision, ...]
    rows: Rows


def import_logs(
    paths: Sequence[Path], folder: Path, wishes: Wishes, asked: Asked | None = None
) -> Imported:
    """Write `folder` with an experiment of the logs in `paths`; no file there is overwritten.

    Raises DataError where a log cannot be read or does not say what it is about, and where
    a file would be overwritten: before anything is written.
    """
    logs = _distinguished([read_log(path, asked) for path in paths], paths)
    logs = [_with_units(log, wishes.units) for log in logs]
    decisions: list[Decision] = [d for log in logs for d in log.decisions]
    recordings = recordings_of(logs)
    # The longest recording tells most about the columns.
    longest = max(range(len(recordings)), key=lambda nth: len(_first_clock(recordings[nth][0])))
    signals = _signals(recordings[longest], wishes, decisions)
    _check_names(paths, signals, wishes)
    signals = _aligned(_unwrapped(signals, decisions), decisions)
    proposal = propose(str(paths[0]), signals, wishes)
    decisions += proposal.decisions
    others = [_aligned(_unwrapped(_signals(own, wishes, []), []), []) for own in recordings]
    runs = [run_of(proposal, own) for own in others]
    runs[longest] = proposal
    for nth, run in enumerate(runs):
        where = f" of recording {nth + 1}" if len(runs) > 1 else ""
        decisions += stuck_in(run, where, own_noise=nth == longest)
    rows = ledger_of(logs, runs)
    decisions.append(rows_decision(rows))
    files = tuple(folder / name for name in _names(proposal, len(runs)))
    _keep(files)
    _write(folder, [str(path.name) for path in paths], runs, longest, decisions, rows)
    return Imported(files, proposal, tuple(decisions), rows)


def _first_clock(log: Log) -> Floats:
    return next(iter(log.clocks.values()))


def _names(proposal: Proposal, runs: int) -> list[str]:
    """The files that are written, experiment.toml first."""
    data = [file_of("data.csv", nth) for nth in range(runs)]
    if proposal.kind != "sawyer":
        return ["experiment.toml", *data, "machine.toml"]
    commands = [] if proposal.command is None else ["command.csv"]
    return ["experiment.toml", *data, *(file_of(c, n) for c in commands for n in range(runs))]


def _keep(files: Sequence[Path]) -> None:
    there = [str(file) for file in files if file.exists() or file.is_symlink()]
    if there:
        message = f"{', '.join(there)} exists, and nothing is overwritten: choose another folder"
        raise DataError(message, "exists")


# -- signals ------------------------------------------------------------------------------


def _distinguished(logs: Sequence[Log], paths: Sequence[Path]) -> list[Log]:
    """The logs; a column whose heading others have as well is named with its file before it."""
    stems = [path.stem for path in paths]
    stems = [f"log{n}" for n, _ in enumerate(stems, 1)] if len(set(stems)) < len(stems) else stems
    often = Counter(column.raw for log in logs for column in log.columns)

    def named(column: Column, stem: str) -> Column:
        return replace(column, raw=f"{stem}:{column.raw}") if often[column.raw] > 1 else column

    return [
        replace(log, columns=tuple(named(column, stem) for column in log.columns))
        for log, stem in zip(logs, stems, strict=True)
    ]


def _with_units(log: Log, units: Mapping[str, str]) -> Log:
    """The log, with the units that the user states for its columns."""
    stated = {raw: stated_unit(raw, word) for raw, word in units.items()}
    columns = tuple(replace(c, unit=stated.get(c.raw, c.unit)) for c in log.columns)
    return replace(log, columns=columns)


def _signals(logs: Sequence[Log], wishes: Wishes, decisions: list[Decision]) -> list[Signal]:
    """The signals of all logs; clocks of several logs have the log's number before their names."""
    chosen = Chosen(wishes.commands, wishes.sensors)
    first_date = min(
        (o for log in logs for o in log.origins.values() if o >= _FIRST_DATE_S), default=0.0
    )
    signals: list[Signal] = []
    labels: set[str] = set()
    for number, log in enumerate(logs, start=1):
        shifts = {
            name: _shift(name, log, origin, first_date, decisions)
            for name, origin in log.origins.items()
        }
        for signal in signals_of(log, chosen, shifts):
            label = signal.label if signal.label not in labels else f"log{number}_{signal.label}"
            labels.add(label)
            signals.append(replace(signal, label=label, clock=f"{number}:{signal.clock}"))
    return signals


def _shift(
    name: str, log: Log, origin: float, first_date: float, decisions: list[Decision]
) -> float:
    """Time in the data of a clock's first stamp."""
    subject = f"column {name}"
    if origin >= _FIRST_DATE_S:
        if origin == first_date:
            decisions.append(Decision(subject, "t = 0 at the first stamp", "it is a date"))
        return origin - first_date
    length = float(log.clocks[name][-1])
    if origin > max(length, _LATEST_START_S):
        reason = f"it begins at {origin:.6g} s"
        decisions.append(Decision(subject, "t = 0 at the first stamp", reason, check=True))
        return 0.0
    return origin


def _check_names(paths: Sequence[Path], signals: Sequence[Signal], wishes: Wishes) -> None:
    known = {signal.raw for signal in signals}
    for name in (*wishes.commands, *wishes.sensors, *wishes.units):
        if name not in known:
            message = f"{paths[0]}: there is no column {name} of numbers; there are"
            raise DataError(f"{message} {', '.join(sorted(known))}", "missing-column")


def _unwrapped(signals: list[Signal], decisions: list[Decision]) -> list[Signal]:
    done = [unwrapped(signal) for signal in signals]
    decisions += [decision for _, decision in done if decision is not None]
    return [signal for signal, _ in done]


def _aligned(signals: list[Signal], decisions: list[Decision]) -> list[Signal]:
    """Signals on one time: clocks of commands are shifted to those of their measurements."""
    _tell_sampling(signals, decisions)
    sensors = [s for s in signals if s.role == "sensor"]
    if not sensors:
        return signals
    measured = sensors[0]
    moved: dict[str, float] = {}
    for other in signals:
        foreign = other.clock != measured.clock and other.clock not in moved
        if foreign and other.role in ("command", "sensor") and other.quantity == measured.quantity:
            moved[other.clock] = _offset(other, measured, decisions)
    for clock in {s.clock for s in signals} - {measured.clock, *moved}:
        taken = f"as that of {measured.raw}"
        reason = "no column of both clocks can be compared"
        decisions.append(Decision(f"clock {_own(clock)}", taken, reason, check=True))
    return [replace(s, time_s=s.time_s + moved.get(s.clock, 0.0)) for s in signals]


def _own(clock: str) -> str:
    return clock.split(":", 1)[1]


def _offset(other: Signal, measured: Signal, decisions: list[Decision]) -> float:
    """Seconds to add to the times of `other`; 0 where the two do not follow each other."""
    subject = f"clock {_own(other.clock)} of {other.raw}"
    if _one_clock(other.time_s, measured.time_s):
        reason = f"its stamps are those of {measured.raw}, and no two clocks have the same jitter"
        decisions.append(Decision(subject, "not shifted", reason))
        return 0.0
    found = agreement(*other.present, *measured.present, other.held)
    if found is None or not found.related:
        reason = f"{measured.raw} does not follow it"
        decisions.append(Decision(subject, "not shifted", reason, check=True))
        return 0.0
    interval = f"{found.delay_s:.5g} ± {found.delay_ci_s:.2g} s (95 %)"
    if not found.delayed:
        decisions.append(Decision(subject, "not shifted", f"offset {interval}: none to be seen"))
        return 0.0
    reason = f"offset to the clock of {measured.raw} by cross-correlation: {interval}"
    decisions.append(Decision(subject, f"shifted by {found.delay_s:.6g} s", reason, check=True))
    return found.delay_s


def _one_clock(one: Floats, other: Floats) -> bool:
    """True if the stamps of one are among those of the other, and are no even ones.

    Even ones have two steps that differ, however they are rounded, and three with a missing row.
    """
    shorter, longer = sorted((one, other), key=len)
    shorter, longer = np.round(shorter, 9), np.round(longer, 9)
    uneven = len(np.unique(np.round(np.diff(shorter), 9))) > _STEPS_OF_EVEN
    return uneven and bool(np.isin(shorter, longer).all())


def _tell_sampling(signals: Sequence[Signal], decisions: list[Decision]) -> None:
    for clock in dict.fromkeys(s.clock for s in signals):
        times = next(s.time_s for s in signals if s.clock == clock)
        if len(times) < 3:
            continue
        spacing = spacing_of(times)
        if not spacing.regular:
            taken = f"irregular, {spacing.interval_s:.4g} s in the median"
            decisions.append(Decision(f"sampling of {_own(clock)}", taken, "kept as it is"))
        elif spacing.gaps:
            first = spacing.gaps[0]
            where = f"{len(spacing.gaps)}, the first after {times[first]:.6g} s"
            decisions.append(Decision(f"gaps of {_own(clock)}", where, "kept as they are"))
        else:
            rate = f"{spacing.rate_hz:.6g} Hz"
            decisions.append(Decision(f"rate of {_own(clock)}", rate, "the median interval"))


# -- files --------------------------------------------------------------------------------


def _write(
    folder: Path,
    sources: Sequence[str],
    runs: Sequence[Proposal],
    longest: int,
    decisions: Sequence[Decision],
    rows: Rows,
) -> None:
    source, proposal = ", ".join(sources), runs[longest]
    make_folder(folder)
    for nth, run in enumerate(runs):
        times, columns = _table(run)
        if run.kind == "sawyer":
            _write_sawyer(folder, times, columns, run, nth)
        else:
            _write_csv(folder / file_of("data.csv", nth), times, columns)
    if proposal.kind != "sawyer":
        name = Path(sources[0]).stem
        write(folder / "machine.toml", machine_text(source, name, proposal).encode())
    text = experiment_text(source, proposal, decisions, rows, len(runs))
    write(folder / "experiment.toml", text.encode())


def _table(proposal: Proposal) -> tuple[Floats, dict[str, Floats]]:
    """One time for all signals, and their values at it; what drives the machine has no gaps."""
    signals = proposal.signals
    clocks = {s.clock: s.time_s for s in signals}
    if len(clocks) == 1:
        times = next(iter(clocks.values()))
    else:
        times = np.unique(np.concatenate(list(clocks.values())))
    columns = {}
    for signal in signals:
        if signal.role in ("command", "input"):
            columns[signal.label] = signal.at(times)
        else:
            columns[signal.label] = _placed(times, signal)
    return times, columns


def _placed(times: Floats, signal: Signal) -> Floats:
    if len(times) == len(signal.values):
        return signal.values
    placed = np.full(len(times), np.nan)
    placed[np.searchsorted(times, signal.time_s)] = signal.values
    return placed


def _write_sawyer(
    folder: Path, times: Floats, columns: dict[str, Floats], proposal: Proposal, nth: int
) -> None:
    labels = sawyer_labels(proposal)
    measured = {name: columns[label] for label, name in labels.items()}
    _write_csv(folder / file_of("data.csv", nth), times, measured)
    if proposal.command is not None:
        name = f"position_1_{proposal.command.unit}"
        commanded = {name: columns[proposal.command.label]}
        _write_csv(folder / file_of("command.csv", nth), times, commanded)


def _write_csv(path: Path, times: Floats, columns: dict[str, Floats]) -> None:
    import pyarrow as pa
    from pyarrow import csv

    arrays = {"time_s": pa.array(np.round(times, 9))}
    arrays |= {name: pa.array(values, from_pandas=True) for name, values in columns.items()}
    with output(path) as draft, open(draft, "wb") as file:
        file.write((",".join(arrays) + "\n").encode())
        csv.write_csv(pa.table(arrays), file, csv.WriteOptions(include_header=False))
