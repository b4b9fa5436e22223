"""Files of a machine beside the motor: its machine, its experiment, its logs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mopro.blind.cases.drawn_machine import TOLERANCE, Machine
from mopro.blind.cases.manifest import MODEL
from mopro.blind.reference.motor import Floats
from mopro.blind.reference.stepped_machines import Columns

_UNITS = {
    "mass": "kg", "viscous": "N s/m", "spring": "N/m", "inertia": "A s2", "damping": "A s",
    "a1": "K/s", "a2": "K/s", "U1": "1/s", "U2": "1/s",
}  # fmt: skip


@dataclass(frozen=True)
class _Form:
    """The files of a kind of machine.

    `head`: first lines of machine.toml. `inputs`: name, column of the log, column of the plant,
    and the factor between them; `held` is stated of each. `columns`: of the log's sensors, which
    read `quantity`, `per_si` of their units to one of the plant's, by the formula `reads`.
    """

    head: str
    inputs: tuple[tuple[str, str, str, float], ...]
    columns: tuple[str, ...]
    quantity: str
    per_si: float = 1.0
    held: str = ""
    reads: str = ""


_MM, _RAD = 'kind = "{}"\nunit = "mm"\n', 'kind = "kinematic"\nunit = "rad"\n'
_FORMS = {
    "axis": _Form(
        _MM.format("axis"), (("force", "force_N", "force_N", 1.0),), ("position_mm",), "position",
        1e3, ", hold = true",
    ),
    "kinematic": _Form(
        _MM.format("kinematic"), (("command", "target_mm", "command_m", 1e3),), ("position_mm",),
        "position", 1e3,
    ),
    "thermal": _Form(
        'kind = "thermal"\n', tuple((f"duty{i}", f"duty{i}", f"duty{i}", 1.0) for i in (1, 2)),
        ("t1_C", "t2_C"), "temperature", held=', unit = "1", hold = true',
    ),
    "effort": _Form(
        _RAD, (("command", "angle_rad", "angle_rad", 1.0),), ("current_A",), "current",
        reads="inertia * a + damping * v",
    ),
    "python": _Form(
        f'kind = "python"\npython = "{MODEL}:simulate"\n',
        (("command", "target_mm", "command_m", 1e3),), ("position_mm",), "position", 1e3,
    ),
}  # fmt: skip
# A program of a slide as its owner may have it, and what of its numbers may be off.
PROGRAM = '''\
"""A slide that follows its command, with what may be wrong with it."""

import numpy as np


def simulate(n, columns):
    t, told = columns["time_s"], columns["target_mm"]
    x = (1 + n["k"]) * np.interp(t - n["d"], t, told)
    if n["tau"] > 0:
        x = lagging(t, x, n["tau"])
    phase = 2 * np.pi * x / (n["P"] or 1.0)
    return {"position": x + n["s"] * np.sin(phase) + n["c"] * np.cos(phase) + n["r"] * t}


def lagging(t, x, tau):
    y, at = np.empty(len(x)), x[0]
    steps = np.diff(t).tolist()
    for i, (step, begin, end) in enumerate(zip(steps, x[:-1].tolist(), x[1:].tolist())):
        y[i] = at
        rise = (end - begin) * tau / step
        at = end - rise + (at - begin + rise) * np.exp(-step / tau)
    y[-1] = at
    return y
'''
_OF_PROGRAM = """\
[[effect]]
name = "scale"
k = { unit = "1", range = [-0.02, 0.02] }
[[effect]]
name = "lag"
tau = { unit = "s", range = [0, 0.5] }
[[effect]]
name = "delay"
d = { unit = "s", range = [-0.3, 0.3] }
[[effect]]
name = "periodic_error"
P = { unit = "mm", range = [1, 150], role = "period" }
s = { unit = "mm", range = [-2, 2] }
c = { unit = "mm", range = [-2, 2] }
[[effect]]
name = "drift"
r = { unit = "mm/s", range = [-1, 1] }
"""


def per_si(kind: str) -> float:
    """Readings of a log for one of the plant's unit."""
    return _FORMS[kind].per_si


def machine_text(machine: Machine, starts: dict[str, float]) -> str:
    """machine.toml: true numbers, but for those that are free, which begin at `starts`, or off."""
    nodes = range(1, int(machine.numbers.get("nodes", 0)) + 1)
    lines = [f'{_FORMS[machine.kind].head}name = "drawn"']
    lines += ["[nodes]"] if nodes else []
    lines += [f't{i} = "a{i} * duty{i} - U{i} * (T - ambient)"' for i in nodes]
    own = [name for name in machine.numbers if name in _UNITS and machine.numbers[name]]
    lines += ["[base]"] if own else []
    lines += [f"{name} = {{ {_stated(machine, name, starts)} }}" for name in own]
    lines += [_OF_PROGRAM] if machine.kind == "python" else []
    return "\n".join(lines) + "\n"


def _stated(machine: Machine, name: str, starts: dict[str, float]) -> str:
    value, unit = machine.numbers[name], f'unit = "{_UNITS[name]}"'
    if name in machine.free:
        ends = f"[{value / 30:.6g}, {value * 30:.6g}]"
        return f"value = {starts[name]:.6g}, {unit}, free = true, range = {ends}"
    if name in machine.errors:
        return (
            f"value = {value * (1 + machine.errors[name]):.6g}, {unit}, tolerance = {TOLERANCE:g}"
        )
    return f"value = {value:.9g}, {unit}"


def experiment_text(machine: Machine, noise: str, runs: Sequence[str]) -> str:
    """An experiment on `runs`, files of logs; `noise` as it is stated."""
    form, nodes = _FORMS[machine.kind], int(machine.numbers.get("nodes", 1))
    parts = ['machine = "machine.toml"\n[inputs]']
    parts += [
        f'{name} = {{ column = "{own}"{form.held} }}' for name, own, *_ in form.inputs[:nodes]
    ]
    for column in form.columns[:nodes]:
        parts.append(f'[[sensor]]\nname = "{column.partition("_")[0]}"\ncolumn = "{column}"')
        parts.append(f'quantity = "{form.quantity}"\nnoise_rms = {noise}')
        parts += ["zero = 0"] if machine.zero else []
        parts += [f'reads = "{form.reads}"'] if form.reads else []
    for run in runs:
        parts.append(f'[[run]]\ndata = "{run}"')
        parts += ["start = { x = 0, v = 0 }"] if machine.start else []
    return "\n".join(parts) + "\n"


def log(machine: Machine, run: Columns, readings: Floats) -> bytes:
    """A log as CSV; a reading that is NaN is an empty cell."""
    form = _FORMS[machine.kind]
    given = {column: factor * run[own] for _, column, own, factor in form.inputs if own in run}
    seen = {c: form.per_si * own for c, own in zip(form.columns, readings, strict=False)}
    table = {"time_s": run["time_s"], **given, **seen}
    text = io.StringIO()
    np.savetxt(
        text, np.column_stack(list(table.values())), "%.9g", ",", header=",".join(table),
        comments="",
    )  # fmt: skip
    return text.getvalue().replace("nan", "").encode("ascii")


def columns_of(kind: str, data: bytes) -> Columns:
    """The columns of a plant (SI) from a log as `log` writes it, without readings."""
    head, *rows = data.decode("ascii").splitlines()
    names = head.split(",")
    table = np.array([[float(cell or "nan") for cell in row.split(",")] for row in rows]).T
    seen = dict(zip(names, table, strict=True))
    inputs = _FORMS[kind].inputs
    given = {own: seen[column] / factor for _, column, own, factor in inputs if column in seen}
    found: Columns = {"time_s": seen["time_s"], **given}
    if kind == "effort":
        found["speed"] = np.gradient(found["angle_rad"], found["time_s"], edge_order=2)
        found["acceleration"] = np.gradient(found["speed"], found["time_s"], edge_order=2)
    return found
