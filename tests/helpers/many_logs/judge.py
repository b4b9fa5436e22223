"""Judgement of an import against what is right: one outcome and the reason."""

import json
import re
import tomllib
from dataclasses import dataclass

import numpy as np

from helpers.commands import run_here
from helpers.many_logs.mixture import drawn
from helpers.many_logs.units import from_si, to_si

RIGHT, REFUSED = "right", "refused rightly"
WRONGLY, TOLD = "refused wrongly", "wrong, told"
SILENT, UNRUN = "silently wrong", "compare refuses"
OUTCOMES = (RIGHT, REFUSED, WRONGLY, TOLD, UNRUN, SILENT)
# Cells of ten digits, and the constants of units of temperature.
_ROUNDING = 2e-8
_RULE = re.compile(r"\[([a-z0-9-]+)\]\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Judged:
    """The outcome of a seed: its machine, its kinds and the reason where it is not right."""

    seed: int
    machine: str
    kinds: tuple[str, ...]
    outcome: str
    why: str = ""


class Wrong(Exception):
    """The data that import wrote are not those of the log."""


def judged(seed, folder):
    """Import the log of a seed in `folder`, compare what was written, and judge both."""
    sheet, kinds, data = drawn(seed)
    names = [f"log{nth}{sheet.style.suffix}" for nth in range(len(data))]
    for name, own in zip(names, data, strict=True):
        (folder / name).write_bytes(own)
    done = run_here(folder, "import", *names, "--as", "out", "--json", *sheet.options)
    outcome, why = _outcome(sheet, folder, done)
    return Judged(seed, sheet.name, tuple(kinds), outcome, why)


def _outcome(sheet, folder, done):
    if done.returncode == 2:
        return _refusal(sheet, done.stderr)
    if done.returncode != 0:
        return SILENT, f"exit {done.returncode}: {done.stderr[-300:]}"
    if sheet.right.refusals:
        return SILENT, f"read, though {sheet.right.refusals}"
    answer = json.loads(done.stdout)
    try:
        _check_data(sheet, folder / "out", answer)
        _check_told(sheet, answer["check"])
    except Wrong as wrong:
        said = [w for w in sheet.right.may if any(re.search(w, c) for c in answer["check"])]
        return (TOLD if said else SILENT), f"{wrong} {said or answer['check']}"
    return _compared(sheet, folder)


def _refusal(sheet, said):
    rules = set(_RULE.findall(said))
    for right, row in sheet.right.refusals:
        line = None if row is None else sheet.line_of[row]
        if rules & right and (line is None or re.search(rf":{line}:\d+: ", said)):
            return REFUSED, ""
    return WRONGLY, f"{said.strip()[:400]} (right: {sheet.right.refusals})"


def _compared(sheet, folder):
    done = run_here(folder, "compare", "out/experiment.toml", "--json")
    if done.returncode in (0, 1):
        missed = [w for w in sheet.right.again if w not in done.stderr]
        return (SILENT, f"compare does not repeat {missed}") if missed else (RIGHT, "")
    if done.returncode == 2 and sheet.right.compare_may & {"*", *_RULE.findall(done.stderr)}:
        return RIGHT, ""
    return UNRUN, done.stderr.strip()[:400]


def _check_told(sheet, checks):
    for words in sheet.right.must:
        if not any(re.search(words, check) for check in checks):
            raise Wrong(f"no CHECK says '{words}':")


# -- data ---------------------------------------------------------------------------------


def _check_data(sheet, folder, answer):
    experiment = tomllib.loads((folder / "experiment.toml").read_text("utf-8"))
    used = _used(sheet, experiment, answer)
    runs = [folder / run["data"] for run in experiment["run"]]
    expected = _expected(sheet)
    if len(runs) != len(expected):
        raise Wrong(f"{len(runs)} runs for {len(expected)} recordings;")
    _check_ledger(sheet, answer["rows"])
    for path, rows in zip(runs, expected, strict=True):
        data = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
        _check_times(sheet, data["time_s"], rows)
        for column, label, unit in used:
            _check_column(sheet, column, np.atleast_1d(data[label]), unit, rows)


def _used(sheet, experiment, answer):
    """Columns of the sheet with their names and units in the data."""
    inputs = list(experiment.get("inputs", {}).values())
    raws = [answer["command"]] if answer["command"] else []
    raws += [*answer["inputs"], *answer["sensors"]]
    ours = {c.heading: c for c in sheet.columns if c.role != "unused"}
    if set(raws) != set(ours) or len(raws) != len(ours):
        raise Wrong(f"{raws} are used, not {list(ours)}, {answer['unused']};")
    for raw in answer["sensors"]:
        if ours[raw].role != "sensor":
            raise Wrong(f"{raw} is taken as a sensor;")
    parts = [*inputs, *experiment["sensor"]]
    return [(ours[r], p["column"], p["unit"]) for r, p in zip(raws, parts, strict=True)]


def _expected(sheet):
    """The rows of the arrays in each recording, in order of time."""
    kept = np.array(sorted(set(map(int, sheet.order)) - sheet.right.lost))
    return [kept[sheet.recording[kept] == n] for n in range(len(sheet.starts_s))]


def _check_ledger(sheet, rows):
    lost = sum(one["count"] for one in rows["left_out"])
    if rows["read"] != rows["used"] + lost:
        raise Wrong(f"the ledger does not add up: {rows};")
    kept = [r for r in sheet.order if r not in sheet.right.lost]
    once = list(dict.fromkeys(map(int, kept)))
    files = [sheet.sensors()]
    if sheet.split:
        files.append([c for c in sheet.columns if c.role not in ("sensor", "unused")])
    blank = [np.all([np.isnan(c.values) for c in own], axis=0) for own in files]
    unread = sum(int(np.count_nonzero(own[once])) for own in blank)
    right = len(sheet.order) - len(kept) + sheet.right.lost_lines + unread
    if lost != right or rows["read"] != len(files) * len(sheet.order) + sheet.right.lost_lines:
        raise Wrong(f"{right} rows of {len(sheet.order)} must be left out, not {rows};")


def _check_times(sheet, times, rows):
    if len(times) != len(rows):
        raise Wrong(f"{len(times)} rows in the data for {len(rows)};")
    own = sheet.time_s[rows]
    off = times - own
    off = off - np.median(off)
    if np.any(np.diff(times) <= 0):
        raise Wrong("times do not ascend;")
    if np.max(np.abs(off)) > sheet.right.time_s:
        worst = int(np.argmax(np.abs(off)))
        raise Wrong(f"time {times[worst]:.6g} for {own[worst]:.6g} s in row {worst};")


def _check_column(sheet, column, seen, unit, rows):
    right = column.values[rows]
    got = to_si(seen, unit.replace(" ", "").removeprefix("deg_"))
    known = ~np.isnan(right)
    if column.role == "sensor" and np.any(np.isnan(got) == known):
        raise Wrong(
            f"{column.heading}: {np.count_nonzero(~np.isnan(got))} readings for {known.sum()};"
        )
    right, got = right[known], got[known]
    if column.span is not None and len(right):
        off = got - right if not sheet.right.turns_known else got[0] - right[0]
        right = right + column.span * np.round(off / column.span)
    size = max(float(np.max(np.abs(right))), 1e-12)
    if not np.all(np.abs(got - right) <= _ROUNDING * size):
        worst = int(np.argmax(np.abs(got - right)))
        told = from_si(right, column.unit)[worst]
        raise Wrong(f"{column.heading}: {got[worst]:.9g} for {right[worst]:.9g} (SI, {told:.9g});")
