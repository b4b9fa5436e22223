"""Machines beside the motor: each draws its numbers, moves or warms, and is put on a sheet."""

from itertools import pairwise

import numpy as np

from helpers.many_experiments.draws import ANGLES, LENGTHS, in_unit
from helpers.many_experiments.effects import effect
from helpers.many_experiments.sheet import Sheet
from mopro.formula import factor_of

RUNS = (1, 1, 1, 1, 1, 2, 2, 3, 4)
SUBSTEPS = 10


def kinematic(draw):
    """An axis that goes where it is told."""
    sheet = Sheet(draw, "kinematic")
    unit, told, travel = _place(draw)
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
        _own_effects(sheet, {"measurement": {"y": unit}, "measurement place": {"y": unit}})
    if draw.chance(0.5):
        _kinematic_file(sheet, told, travel)
    ratio = sheet.ratio if hasattr(sheet, "ratio") else 1.0
    far = draw.pick(0.0, 0.0, 0.5, 20.0) * travel
    for _ in range(draw.pick(*RUNS)):
        t = draw.times()
        x = travel * draw.signal(t) + far
        seen = _missing_in_motion(draw, t, ratio * x, travel)
        signals = {name: draw.size(-2, 3) * draw.signal(t) for name in columns}
        inputs = {command: in_unit(x, told)} | {columns[n]: own for n, own in signals.items()}
        states = {"place": seen, "speed": np.gradient(seen, t)}
        sheet.run(t, inputs, states, **_without(draw, "backlash", "lag"))
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
    _own_effects(sheet, {"measurement": {"y": unit}})
    sheet.of_file([])
    for t in runs:
        x = size * draw.signal(t, smooth=True)
        v = np.gradient(x, t)
        read = mass * np.gradient(v, t) + viscous * v + force / 5 * np.sign(v) * bool(hold)
        sheet.run(t, {command: in_unit(x, told)}, {"effort": read})
    return sheet


def axis(draw):
    """A mass or an inertia under given forces, or under a law of the file."""
    sheet = Sheet(draw, "axis")
    unit, _, travel = _place(draw)
    turns = unit in ANGLES
    pushes = [draw.times() for _ in range(draw.pick(*RUNS))]
    length = min(float(pushes[0][-1]), 1e4)
    slow, rate = draw.rng.uniform(0.5, 5) / length, 2 * np.pi * draw.rng.uniform(0.3, 3) / length
    law = (
        draw.pick("bare", "mass", "mass", "mass", "gain", "swing")
        if unit not in ("count", "step")
        else "gain"
    )
    made = {"bare": _bare, "mass": _mass, "gain": _gain, "swing": _swing}[law](
        sheet, unit, turns, travel, slow, rate
    )
    name, gain, spring = made
    input_unit = sheet.names.get(name, "1")
    quantity = "angle" if turns and draw.chance(0.5) else "position"
    if draw.chance(0.85):
        sheet.sensor("place", quantity, unit)
    if not sheet.sensors or draw.chance(0.2):
        sheet.sensor("speed", "speed", f"{unit}/s")
    if len(sheet.sensors) == 1:
        own = sheet.sensors[0].unit
        sheet.places["measurement"] = own
        _own_effects(sheet, {"measurement": {"y": own}, "input": {"u": input_unit}})
    if law != "bare":
        sheet.of_file([f'unit = "{unit}"', *sheet.laws])
    unused = sheet.input("spare", draw.pick("V", "N", "A")) if draw.chance(0.15) else None
    for t in pushes:
        push, begin = draw.signal(t) * bool(name), (0.0, 0.0) if name else (travel, 0.0)
        begin = (travel * draw.rng.uniform(-1, 1), 0.0) if draw.chance(0.3) else begin
        x, v = moved(
            t, gain * push, slow, spring * rate**2, begin, draw.chance(0.2) * travel * rate**2 / 20
        )
        inputs = {sheet.column: in_unit(sheet.amplitude * push, input_unit)} if name else {}
        if unused:
            inputs[unused] = draw.signal(t)
        start = {"x": begin[0] / factor_of(unit), "v": 0.0}
        more = {"start": start | draw.pick({}, {"v": "free"})} if draw.chance(0.4) else {}
        sheet.run(t, inputs, {"place": x, "speed": v}, **more, **_without(draw, "dry_friction"))
    return sheet


def moved(t, push, slow, spring, begin, dry):
    """Place and speed of x'' = push - slow v - spring x - dry sgn v, by small steps."""
    x, v = begin
    places, speeds = np.zeros(len(t)), np.zeros(len(t))
    for nth in range(len(t)):
        places[nth], speeds[nth] = x, v
        h = (t[nth + 1] - t[nth]) / SUBSTEPS if nth + 1 < len(t) else 0.0
        for _ in range(SUBSTEPS if h else 0):
            free = (v + h * (push[nth] - spring * x)) / (1 + h * slow + h * h * spring)
            v = float(np.sign(free)) * max(abs(free) - h * dry, 0.0)
            x += h * v
    return places, speeds


def _driven(sheet, name, unit, amplitude):
    sheet.column, sheet.amplitude = sheet.input(name, unit), amplitude


def _numbers(sheet, turns, travel, slow, rate):
    mass = 10 ** sheet.draw.rng.uniform(-4, 3)
    return (
        mass,
        mass * travel * (rate**2 + slow * rate) * 2,
        ("torque", "inertia") if turns else ("force", "mass"),
    )


def _bare(sheet, unit, turns, travel, slow, rate):
    mass, amplitude, (name, _) = _numbers(sheet, turns, travel, slow, rate)
    _driven(sheet, name, "N m" if turns else sheet.draw.pick("N", "mN", "lbf"), amplitude)
    sheet.names |= {"x": unit, "v": f"{unit}/s"}
    return name, amplitude / mass, float(sheet.draw.chance(0.5))


def _mass(sheet, unit, turns, travel, slow, rate):
    draw, (mass, amplitude, (name, heavy)) = sheet.draw, _numbers(sheet, turns, travel, slow, rate)
    spring = float(draw.chance(0.6))
    force, per = (
        ("N m", ("kg m2", "N m s", "N m"))
        if turns
        else ("N", (draw.pick("kg", "g", "lb"), "N s/m", "N/m"))
    )
    sheet.base = {heavy: draw.number(mass / factor_of(per[0]), per[0], free=0.2)}
    sheet.base["viscous"] = draw.number(mass * slow, per[1])
    if spring:
        sheet.base["spring"] = draw.number(mass * rate**2, per[2])
    if draw.chance(0.2):
        sheet.base["dry"] = draw.number(amplitude / 20, force)
    if turns and draw.chance(0.3):
        sheet.base["gravity"] = draw.number(amplitude / 10, force)
    _driven(sheet, name, force, amplitude)
    sheet.names |= {"x": unit, "v": f"{unit}/s"}
    sheet.places = {"force": force, "friction": force, f"input {name}": force}
    active = {
        "viscous_drag": {"b": {"value": mass * slow * draw.size(-4, -1), "unit": per[1]}},
        "bias_force": {"g": {"value": amplitude * draw.size(-5, -1), "unit": force}},
        "input_gain": {"k": draw.size(-5, -1)},
        "dry_friction": {"Fc": {"value": amplitude * draw.size(-5, -1), "unit": force}},
    }
    sheet.switched += [item for item in active.items() if draw.chance(0.12)]
    return name, amplitude / mass, spring


def _gain(sheet, unit, turns, travel, slow, rate):
    draw, spring = sheet.draw, float(sheet.draw.chance(0.5))
    name, own = draw.pick(("duty", "%"), ("duty", "1"), ("voltage", "V"), ("current", "mA"))
    rates, amplitude = f"{unit}/s2", travel * (rate**2 + slow * rate) * 2
    size = 10 ** draw.rng.uniform(-2, 1)
    per = f"{unit}/(s2 {own})" if own != "1" else rates
    sheet.base = {
        "k": draw.number(amplitude / size / factor_of(per), per, free=0.6),
        "d": draw.number(slow, "1/s", free=0.6),
    }
    pulls = ""
    if spring:
        sheet.base["w2"], pulls = draw.number(rate**2, "1/s2", free=0.6), " - w2 * x"
    sheet.laws = [f'acceleration = "k * {name} - d * v{pulls}"']
    _driven(sheet, name, own, size)
    sheet.names |= {"x": unit, "v": f"{unit}/s"}
    sheet.places = {"force": rates, "friction": rates, f"input {name}": own}
    return name, amplitude, spring


def _swing(sheet, unit, turns, travel, slow, rate):
    draw = sheet.draw
    sheet.base = {"w2": draw.number(rate**2, "1/s2"), "b": draw.number(slow / 5, "1/s")}
    if not turns:
        sheet.base["L"] = draw.number(travel * 3 / factor_of(unit), unit, free=0.1)
    pull = "w2 * sin(x)" if turns else "w2 * L * sin(x / L)"
    drag = draw.pick(
        "b * v", "b * v", "b * abs(v) * v / (abs(v) + 1e-9 * w2 * L / b)" if not turns else "b * v"
    )
    sheet.laws = [f'acceleration = "-{pull} - {drag}"']
    sheet.names |= {"x": unit, "v": f"{unit}/s"}
    sheet.places = {"force": f"{unit}/s2", "friction": f"{unit}/s2"}
    return "", 0.0, 1.0


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
    _own_effects(
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
        sheet.run(t, inputs, states, **more, **_without(draw, "sensor_lag", "radiation"))
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


# -- shared -----------------------------------------------------------------------------------


def _place(draw):
    """Units of a place as it is read and as it is told, and how far it goes (SI)."""
    units = draw.pick(LENGTHS, LENGTHS, ANGLES, ("count", "step"))
    travel = 10 ** (draw.rng.uniform(0, 5) if "count" in units else draw.rng.uniform(-5, 1))
    return draw.pick(*units), draw.pick(*units), travel


def _missing_in_motion(draw, t, x, travel):
    """The place with what a model may lack."""
    size = travel * 10 ** draw.rng.uniform(-4, -1)
    way = draw.pick("none", "none", "none", "late", "wave", "drift", "scale", "play")
    if way == "late":
        return np.interp(t - t[-1] * draw.rng.uniform(0, 0.03), t, x)
    if way == "play":
        return x - size * np.sign(np.gradient(x, t))
    added = {
        "wave": np.sin(2 * np.pi * x / travel * draw.rng.uniform(1, 8)), "drift": t / t[-1],
        "scale": x / travel, "none": 0.0 * t,
    }  # fmt: skip
    return x + size * added[way]


def _own_effects(sheet, local):
    """Up to three effects of the user at the places of a sheet; `local` names by the place."""
    draw, places = sheet.draw, list(sheet.places)
    for nth in range(draw.pick(0, 0, 1, 1, 2, 3) if places else 0):
        place = draw.pick(*places)
        names = {"t": "s"} if place == "power" and draw.chance(0.1) else sheet.names
        if place.startswith("input"):
            names = {"t": "s"}
        names = dict(names) | local.get(place, local.get(place.split()[0], {}))
        if sheet.kind == "thermal":
            names.pop("ambient", None)
        keys = effect(draw, f"own {nth + 1}", place, sheet.places[place], names)
        sheet.effect(keys)
        fixed = {k: v for k, v in keys.items() if isinstance(v, dict)}
        if draw.chance(0.1) and not any("step" in str(v) for v in fixed.values()):
            on = {k: {"value": _inside(draw, v), "unit": v["unit"]} for k, v in fixed.items()}
            sheet.switched.append((keys["name"], on))


def _inside(draw, keys):
    stated = [own for own in keys.get("range", [1e-6, 1.0]) if isinstance(own, float)]
    return min(stated, key=abs) + (max(stated) - min(stated)) * 0.1 if stated else draw.size(-3, 0)


def _without(draw, *effects):
    return {"without": [draw.pick(*effects)]} if draw.chance(0.08) else {}
