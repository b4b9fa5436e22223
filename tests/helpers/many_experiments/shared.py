"""Places, effects of the user and runs, as machines of all kinds beside the motor have them."""

import numpy as np

from helpers.many_experiments.draws import ANGLES, LENGTHS
from helpers.many_experiments.effects import effect

RUNS = (1, 1, 1, 1, 1, 2, 2, 3, 4)
SUBSTEPS = 10


def place_of(draw):
    """Units of a place as it is read and as it is told, and how far it goes (SI)."""
    units = draw.pick(LENGTHS, LENGTHS, ANGLES, ("count", "step"))
    travel = 10 ** (draw.rng.uniform(0, 5) if "count" in units else draw.rng.uniform(-5, 1))
    return draw.pick(*units), draw.pick(*units), travel


def missing_in_motion(draw, t, x, travel):
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


def own_effects(sheet, local):
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


def without(draw, *effects):
    return {"without": [draw.pick(*effects)]} if draw.chance(0.08) else {}
