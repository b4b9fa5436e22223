"""The runs of an imported experiment, one for each recording, and the ledger of their rows."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mopro.errors import DataError
from mopro.importing.propose import Proposal
from mopro.importing.roles import Signal
from mopro.logs import Decision, Log, Rows
from mopro.text import visible

NO_READING = "no reading"


def recordings_of(logs: Sequence[Log]) -> list[list[Log]]:
    """The logs of each recording; DataError if they have different numbers of recordings."""
    counts = [log.recordings for log in logs]
    if len(set(counts)) > 1:
        each = ", ".join(f"{log.source.name} has {log.recordings}" for log in logs)
        message = f"the logs have different numbers of recordings: {each}"
        raise DataError(f"{message}; import those that belong together", "which-recordings")
    return [[log.recording(nth) for log in logs] for nth in range(counts[0])]


def run_of(proposal: Proposal, signals: Sequence[Signal]) -> Proposal:
    """The proposal with another recording's signals, in the same roles."""
    own = {s.label: s for s in signals}

    def found(role: Signal) -> Signal | None:
        other = own.get(role.label)
        return None if other is None else replace(other, role=role.role, held=role.held)

    def all_of(roles: Sequence[Signal]) -> tuple[Signal, ...]:
        return tuple(s for role in roles if (s := found(role)) is not None)

    command = None if proposal.command is None else found(proposal.command)
    return replace(
        proposal,
        command=command,
        inputs=all_of(proposal.inputs),
        sensors=all_of(proposal.sensors),
        unused=all_of(proposal.unused),
    )


def ledger_of(logs: Sequence[Log], runs: Sequence[Proposal]) -> Rows:
    """The rows of all logs; those in which no sensor has a reading are left out, too."""
    rows = Rows(0)
    for log in logs:
        rows = rows + log.rows
    for nth in range(len(logs)):
        count = sum(_unread(run, f"{nth + 1}:") for run in runs)
        rows = rows.without(NO_READING, min(count, rows.used))
    return rows


def _unread(run: Proposal, log: str) -> int:
    """Rows of a log without a reading of its sensors; of what drives the machine if it has none."""
    own = [s for s in run.sensors if s.clock.startswith(log)]
    driving = (*run.inputs, *([run.command] if run.command else []))
    own = own or [s for s in driving if s.clock.startswith(log)]
    if not own or len({len(s.values) for s in own}) > 1:
        return 0
    return int(np.count_nonzero(np.all([np.isnan(s.values) for s in own], axis=0)))


def rows_decision(rows: Rows) -> Decision:
    """The ledger as a decision; more than a few rows left out are to be checked."""
    reason = "every row of the log is in one of these"
    return Decision("rows", str(rows), reason, rows.to_check)


def rows_text(rows: Rows, decisions: Sequence[Decision]) -> Iterator[str]:
    """The table `[rows]` of experiment.toml, which later commands repeat."""
    left_out = ", ".join(
        f"{{ why = {json.dumps(why)}, count = {count} }}" for why, count in rows.left_out.items()
    )
    yield "[rows]"
    yield f"read = {rows.read}"
    yield f"used = {rows.used}"
    if left_out:
        yield f"left_out = [{left_out}]"
    lasting = dict.fromkeys(" ".join(visible(str(d)).split()) for d in decisions if d.lasting)
    if lasting:
        words = ", ".join(json.dumps(w.replace("\x7f", " "), ensure_ascii=False) for w in lasting)
        yield f"check = [{words}]"
    yield ""


def file_of(name: str, nth: int) -> str:
    """The name of a file of the run `nth`, from 0: `data.csv`, `data_2.csv`."""
    stem, _, suffix = name.partition(".")
    return name if nth == 0 else f"{stem}_{nth + 1}.{suffix}"
