"""Files of a machine beside the motor: its machine, its experiment, its logs."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from mopro.benchmark.making.machine_drawn import Machine
from mopro.benchmark.reference.machines import Columns, Floats

# Columns of a log from those of a plant, with their factors.
_INPUTS = {
    "axis": {"force_N": ("force_N", 1.0)},
    "kinematic": {"target_mm": ("command_m", 1e3)},
    "thermal": {"duty1": ("duty1", 1.0), "duty2": ("duty2", 1.0)},
    "effort": {"angle_rad": ("angle_rad", 1.0)},
}
_HEADING = 'kind = "{kind}"\nname = "drawn"\n'
_SENSORS = {
    "axis": ("position_mm", "position", 1e3),
    "kinematic": ("position_mm", "position", 1e3),
    "thermal": ("t{i}_C", "temperature", 1.0),
    "effort": ("current_A", "current", 1.0),
}


def per_si(kind: str) -> float:
    """Readings of a log for one of the plant's unit."""
    return _SENSORS[kind][2]


def machine_text(machine: Machine, starts: dict[str, float]) -> str:
    """machine.toml: true numbers, but for those that are free or off."""
    lines = [f'kind = "{machine.kind if machine.kind != "effort" else "kinematic"}"']
    lines += ['name = "drawn"']
    if machine.kind != "thermal":
        lines.append('unit = "rad"' if machine.kind == "effort" else 'unit = "mm"')
    units = {
        "mass": "kg", "viscous": "N s/m", "spring": "N/m", "inertia": "A s2", "damping": "A s",
        "a1": "K/s", "a2": "K/s", "U1": "1/s", "U2": "1/s",
    }  # fmt: skip
    nodes = int(machine.numbers.get("nodes", 0))
    if nodes:
        lines.append("[nodes]")
        lines += [f't{i} = "a{i} * duty{i} - U{i} * (T - ambient)"' for i in range(1, nodes + 1)]
    own = [name for name in machine.numbers if name in units and machine.numbers[name]]
    if own:
        lines.append("[base]")
    for name in own:
        value, unit = machine.numbers[name], units[name]
        if name in machine.free:
            ends = f"[{value / 30:.6g}, {value * 30:.6g}]"
            told = f'value = {starts[name]:.6g}, unit = "{unit}", free = true, range = {ends}'
        elif name in (machine.off or {}):
            stated = value * (1 + (machine.off or {})[name])
            told = f'value = {stated:.6g}, unit = "{unit}", tolerance = {0.1 * stated:.6g}'
        else:
            told = f'value = {value:.9g}, unit = "{unit}"'
        lines.append(f"{name} = {{ {told} }}")
    return "\n".join(lines) + "\n"


def experiment_text(machine: Machine, noise: str, runs: Sequence[str]) -> str:
    """An experiment on `runs`, files of logs; `noise` as it is stated."""
    parts = ['machine = "machine.toml"\n[inputs]']
    nodes = int(machine.numbers.get("nodes", 1))
    for column in list(_INPUTS[machine.kind])[: nodes if machine.kind == "thermal" else None]:
        name = column if machine.kind == "thermal" else column.rpartition("_")[0]
        name = "force" if machine.kind == "axis" else name
        name = "command" if machine.kind in ("kinematic", "effort") else name
        held = {"axis": ", hold = true", "thermal": ', unit = "1", hold = true'}.get(
            machine.kind, ""
        )
        parts.append(f'{name} = {{ column = "{column}"{held} }}')
    column, quantity, _ = _SENSORS[machine.kind]
    for i in range(1, nodes + 1):
        parts.append(
            f'[[sensor]]\nname = "{"t" + str(i) if quantity == "temperature" else quantity}"'
        )
        parts.append(f'quantity = "{quantity}"\ncolumn = "{column.format(i=i)}"')
        parts.append(f"noise_rms = {noise}")
        if machine.zero:
            parts.append("zero = 0")
        if machine.kind == "effort":
            parts.append('reads = "inertia * a + damping * v"')
    for run in runs:
        parts.append(f'[[run]]\ndata = "{run}"')
        if machine.kind == "axis" and machine.start:
            parts.append("start = { x = 0, v = 0 }")
    return "\n".join(parts) + "\n"


def log(machine: Machine, run: Columns, readings: Floats) -> bytes:
    """A log as CSV; a reading that is NaN is an empty cell."""
    given = {
        column: factor * run[own]
        for column, (own, factor) in _INPUTS[machine.kind].items()
        if own in run
    }
    column, _, factor = _SENSORS[machine.kind]
    seen = {column.format(i=i + 1): factor * own for i, own in enumerate(readings)}
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
    given = {
        own: seen[name] / factor for name, (own, factor) in _INPUTS[kind].items() if name in seen
    }
    found: Columns = {"time_s": seen["time_s"], **given}
    if kind == "effort":
        found["speed"] = np.gradient(found["angle_rad"], found["time_s"], edge_order=2)
        found["acceleration"] = np.gradient(found["speed"], found["time_s"], edge_order=2)
    return found
