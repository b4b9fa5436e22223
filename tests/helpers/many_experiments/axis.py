"""A mass or an inertia that is driven, or under a law of its own."""

import numpy as np

from helpers.many_experiments.draws import ANGLES, in_unit
from helpers.many_experiments.shared import RUNS, SUBSTEPS, own_effects, place_of, without
from helpers.many_experiments.sheet import Sheet
from mopro.formula import factor_of


def axis(draw):
    """A mass or an inertia under given forces, or under a law of the file."""
    sheet = Sheet(draw, "axis")
    unit, _, travel = place_of(draw)
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
        own_effects(sheet, {"measurement": {"y": own}, "input": {"u": input_unit}})
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
        sheet.run(t, inputs, {"place": x, "speed": v}, **more, **without(draw, "dry_friction"))
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
