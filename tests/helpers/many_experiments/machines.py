"""Machines beside the motor but axes: each draws its numbers, moves or warms, and is on a sheet."""

from itertools import pairwise

import numpy as np

from helpers.many_experiments.draws import ANGLES, LENGTHS, in_unit
from helpers.many_experiments.shared import (
    RUNS,
    SUBSTEPS,
    missing_in_motion,
    own_effects,
    place_of,
    without,
)
from helpers.many_experiments.sheet import Sheet
from mopro.formula import factor_of


def kinematic(draw):
    """An axis that goes where it is told."""
    sheet = Sheet(draw, "kinematic")
    unit, told, travel = place_of(draw)
    command = sheet.input("command", told)
    extra = {"load": "N", "temperature": "C", "other": draw.pick("mm", "V", "A", "count")}
    extra = {name: own for name, own in extra.items() if draw.chance(0.25)}
    columns = {name: sheet.input(name, own) for name, own in extra.items()}
    sheet.sensor("place", draw.pick("position", "angle") if unit in ANGLES else "position", unit)
    if draw.chance(0.15):
        sheet.sensor("speed", "speed", f"{told}/s")
    sheet.names |= {"x": told, "v": f"{told}/s", "a": f"{told}/s2"}
    one = len(sheet.sensors) == 1
    sheet.places = {"command": told} | (
        {"measurement": unit} if one else {"measurement place": unit}
    )
    if one:
        own_effects(sheet, {"measurement": {"y": unit}, "measurement place": {"y": unit}})
    if draw.chance(0.5):
        _kinematic_file(sheet, told, travel)
    ratio = sheet.ratio if hasattr(sheet, "ratio") else 1.0
    far = draw.pick(0.0, 0.0, 0.5, 20.0) * travel
    for _ in range(draw.pick(*RUNS)):
        t = draw.times()
        x = travel * draw.signal(t) + far
        seen = missing_in_motion(draw, t, ratio * x, travel)
        signals = {name: draw.size(-2, 3) * draw.signal(t) for name in columns}
        inputs = {command: in_unit(x, told)} | {columns[n]: own for n, own in signals.items()}
        states = {"place": seen, "speed": np.gradient(seen, t)}
        sheet.run(t, inputs, states, **without(draw, "backlash", "lag"))
    return sheet


def _kinematic_file(sheet, told, travel):
    draw, top = sheet.draw, []
    if draw.chance(0.4):
        sheet.ratio = draw.size(-1, 1)
        sheet.base = {"ratio": draw.number(sheet.ratio, "1")}
        top = [f'unit = "{told}"', 'position = "ratio * command"']
    size = travel / factor_of(told)
    active = {
        "backlash": {"w": {"value": size * draw.size(-5, -2), "unit": told}},
        "scale": {"k": draw.size(-5, -2)},
        "drift": {"r": {"value": size * draw.size(-6, -2), "unit": f"{told}/s"}},
        "delay": {"d": {"value": draw.size(-4, -1), "unit": "s"}},
    }
    sheet.switched += [item for item in active.items() if draw.chance(0.12)]
    sheet.of_file(top)


def effort(draw):
    """A known motion, and the effort that it takes."""
    sheet = Sheet(draw, "kinematic")
    turns = draw.chance(0.4)
    told, size = draw.pick(*(ANGLES if turns else LENGTHS)), draw.size(-2, 1)
    quantity, unit = (
        ("torque", draw.pick("N m", "mN m")) if turns else ("force", draw.pick("N", "lbf", "mN"))
    )
    heavy, drag = ("kg m2", "N m s") if turns else (draw.pick("kg", "g"), "N s/m")
    command, force = sheet.input("command", told), 10 ** draw.rng.uniform(-3, 3)
    sheet.names |= {"x": told, "v": f"{told}/s", "a": f"{told}/s2"}
    runs = [draw.times() for _ in range(draw.pick(*RUNS))]
    length = float(runs[0][-1])
    mass, viscous = force * length**2 / size / 40, force * length / size / 10
    sheet.base = {
        "m": draw.number(mass / factor_of(heavy), heavy, free=0.7),
        "b": draw.number(viscous / factor_of(drag), drag, free=0.7),
    }
    hold = draw.pick("", " + F0 * sign(v)", " + F0")
    if hold:
        sheet.base["F0"] = draw.number(force / 5 / factor_of(unit), unit)
    sheet.sensor("effort", quantity, unit, reads=f"m * a + b * v{hold}")
    sheet.places = {"measurement": unit}
    own_effects(sheet, {"measurement": {"y": unit}})
    sheet.of_file([])
    for t in runs:
        x = size * draw.signal(t, smooth=True)
        v = np.gradient(x, t)
        read = mass * np.gradient(v, t) + viscous * v + force / 5 * np.sign(v) * bool(hold)
        sheet.run(t, {command: in_unit(x, told)}, {"effort": read})
    return sheet


def thermal(draw):
    """One to three nodes that warm."""
    sheet = Sheet(draw, "thermal")
    nodes = [f"n{nth + 1}" for nth in range(draw.pick(1, 1, 2, 2, 3))]
    runs = [draw.times() * draw.pick(1.0, 10.0) for _ in range(draw.pick(*RUNS))]
    loss = draw.rng.uniform(0.5, 5) / float(runs[0][-1])
    name, unit = draw.pick(("duty", "%"), ("power", "W"), ("power", "mW"), ("voltage", "V"))
    column, size = sheet.input(name, unit), 10 ** draw.rng.uniform(-1, 2)
    rise = 10 ** draw.rng.uniform(-1, 2.5)
    held = draw.pick(None, 10 ** draw.rng.uniform(-1, 4)) if "W" in unit else None
    outside = sheet.input("ambient", "C") if draw.chance(0.25) else None
    for node in nodes:
        sheet.sensor(node, "temperature", draw.pick("C", "C", "K"))
    sheet.names |= {"t": "s"}
    bare = draw.chance(0.3)
    power = "W" if held else "K/s"
    sheet.places = {"power": power, "measurement": sheet.sensors[0].unit, f"input {name}": unit}
    if len({s.unit for s in sheet.sensors}) > 1:
        del sheet.places["measurement"]
    if bare:
        sheet.places.pop("power")
    else:
        _laws(sheet, nodes, name, unit, held, loss, rise / size)
    own_effects(
        sheet, {"power": {"T": "K"}, "measurement": {"y": "C"}, f"input {name}": {"u": unit}}
    )
    if not bare:
        sheet.of_file([], sheet.laws)
    for t in runs:
        push, room = np.abs(draw.signal(t)), draw.rng.uniform(-10, 40)
        begins = room + draw.pick(0.0, 0.0, rise / 2)
        inputs = {column: in_unit(size * push, unit)}
        if outside:
            inputs[outside] = room + 0.3 * draw.signal(t)
        warm = warmed(t, len(nodes), loss, loss * rise * push, begins, room)
        more = {"start": {nodes[0]: begins}} if draw.chance(0.15) else {}
        states = {node: warm[nth] for nth, node in enumerate(nodes)}
        sheet.run(t, inputs, states, **more, **without(draw, "sensor_lag", "radiation"))
    return sheet


def warmed(t, nodes, loss, push, begins, room):
    """Temperatures of nodes, the first of which is heated and warms the next."""
    warm, now = np.zeros((nodes, len(t))), np.full(nodes, begins)
    for nth in range(len(t)):
        warm[:, nth] = now
        h = (t[nth + 1] - t[nth]) / SUBSTEPS if nth + 1 < len(t) else 0.0
        for _ in range(SUBSTEPS if h else 0):
            gained = np.r_[push[nth] + loss * room, loss * (now[:-1] + room)]
            now = (now + h * gained) / (1 + h * loss * (1 + (np.arange(nodes) > 0)))
    return warm


def _laws(sheet, nodes, name, unit, held, loss, gain):
    """Formulas of the nodes, as rates or as powers."""
    draw, scale = sheet.draw, held or 1.0
    per = "W/K" if held else "1/s"
    heats = f"W/{unit}" if held else f"K/(s {unit})"
    if held:
        sheet.base["capacity"] = draw.number(held, "W s/K", free=0.2)
    sheet.base |= {
        "h": draw.number(loss * gain * scale / factor_of(heats), heats, free=0.6),
        "U": draw.number(loss * scale, per, free=0.6),
    }
    sheet.laws = {nodes[0]: f"h * {name} - U * (T - ambient)"}
    for before, node in pairwise(nodes):
        sheet.base["k"] = draw.number(loss * scale, per)
        sheet.laws[node] = f"k * ({before} - T) - U * (T - ambient)"


def python(draw):
    """A function of the person's own."""
    sheet = Sheet(draw, "python")
    column, unit = sheet.input("drive", draw.pick("V", "mm", "A")), draw.pick("mm", "C", "N", "deg")
    quantity = {"mm": "position", "C": "temperature", "N": "force", "deg": "angle"}[unit]
    sheet.sensor("answer", quantity, unit)
    gain, bend = draw.size(-3, 3), draw.size(-3, 3)
    sheet.base = {"gain": draw.number(gain, "1", free=0.7), "offset": draw.number(1.0, "1")}
    body = draw.pick(
        "gain * u + offset", "gain * np.tanh(u) + offset", "gain * u / (1 + abs(u)) + offset"
    )
    sheet.files["model.py"] = (
        "import numpy as np\n\n\ndef simulate(numbers, columns):\n"
        f'    u, gain, offset = columns["{column}"], numbers["gain"], numbers["offset"]\n'
        '    bend, turned = (numbers.get(name, 0.0) for name in ("bend", "turned"))\n'
        "    bent = bend * u**2 + turned * np.sqrt(abs(u))\n"
        f'    return {{"answer": {body} + bent}}\n'
    )
    for name in ("bend", "turned"):
        if draw.chance(0.6):
            span = draw.size(-6, 6)
            sheet.effect({"name": f"{name} of it", name: {"unit": "1", "range": [-span, span]}})
    if not sheet.effects:
        sheet.effect({"name": "bend of it", "bend": {"unit": "1", "range": [-1.0, 1.0]}})
    sheet.of_file(['python = "model.py:simulate"'])
    for _ in range(draw.pick(*RUNS)):
        t = draw.times()
        u = draw.signal(t)
        seen = (gain * u + 1.0 + draw.chance(0.5) * bend * u**2) * factor_of(unit)
        sheet.run(t, {column: u}, {"answer": seen})
    return sheet
