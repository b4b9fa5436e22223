"""Draws of which experiments are made: sizes, times, signals, numbers of a file."""

import json
import math

import numpy as np

from mopro.formula import factor_of

LENGTHS = ("um", "mm", "m", "in", "mil", "cm", "nm")
ANGLES = ("rad", "deg", "mrad", "arcsec", "turn", "rev")
TIMES = ("s", "ms", "us", "min")


class Draw:
    """A generator of random numbers, and what is drawn with it."""

    def __init__(self, *seed):
        self.rng = np.random.default_rng(seed)
        self.step_s = self.pick(1e-5, 1e-3, 0.01, 0.02, 0.02, 0.1, 1.0, 10.0)

    def chance(self, share):
        """True in so many of all cases."""
        return bool(self.rng.random() < share)

    def pick(self, *among):
        """One of them."""
        return among[int(self.rng.integers(len(among)))]

    def size(self, low, high):
        """A size between 10**low and 10**high, with up to six digits."""
        return float(f"{10 ** self.rng.uniform(low, high):.{self.rng.integers(1, 7)}g}")

    def near(self, value, off=0.3):
        """A value that is off by a share of itself."""
        return float(f"{value * (1 + self.rng.uniform(-off, off)):.6g}")

    def times(self):
        """Times (s) from 0 on of a record: even, uneven, or with a gap."""
        rows, step = round(math.exp(self.rng.uniform(math.log(8), math.log(60)))), self.step_s
        rows *= 1 if self.chance(0.9) else 3
        steps = np.full(rows - 1, step)
        if self.chance(0.25):
            steps = step * self.rng.uniform(0.3, 2.0, rows - 1)
        if self.chance(0.1):
            steps[self.rng.integers(rows - 1)] = 40 * step
        return np.r_[0.0, np.cumsum(steps)]

    def signal(self, t, smooth=False):
        """A signal of at most 1 in size: waves, moves, steps, pulses, a ramp, or nothing."""
        share = t / t[-1]
        form = self.pick("waves", "waves", "moves", "moves", "steps", "pulse", "ramp", "zero")
        if smooth or form == "waves":
            rates, phases = self.rng.uniform(0.5, 4.0, 3), self.rng.uniform(0, 6, 3)
            sizes = self.rng.uniform(0.2, 1.0, 3)
            waves = sizes[:, None] * np.sin(2 * np.pi * rates[:, None] * share + phases[:, None])
            return waves.sum(axis=0) / np.abs(waves.sum(axis=0)).max()
        corners = np.linspace(0, 1, 8)
        if form == "moves":
            return np.interp(share, corners, np.repeat(self.rng.uniform(-1, 1, 4), 2))
        if form == "steps":
            return self.rng.uniform(-1, 1, 8)[np.searchsorted(corners, share)]
        return {"pulse": (share > 0.2) & (share < 0.4), "ramp": share}.get(form, 0.0) * np.ones(
            len(t)
        )

    def number(self, value, unit, free=0.4, tolerance=0.25):
        """A number of `[base]`, in `unit`, as a file states it: fixed, free or with a tolerance."""
        known = not self.chance(free)
        stated = self.near(value, 0.02 if known else 0.3)
        keys = {"value": stated, "unit": unit}
        if not known:
            keys["free"] = True
            low, high = sorted((stated * self.size(-3, -0.5), stated * self.size(0.5, 3)))
            if low == high or self.chance(0.6):
                low, high = self.pick((low, high), (min(-abs(high), low - 1), abs(high) + 1))
                keys["range"] = [low, high]
        elif self.chance(tolerance / (1 - free)):
            keys["tolerance"] = self.pick(0.01, 0.05, 0.2, 0.9)
            if stated and self.chance(0.3):
                keys["tolerance"] = {"value": abs(stated) * self.size(-2, 0), "unit": unit}
        return keys


def toml(data):
    """A value as TOML in one line."""
    if isinstance(data, dict):
        return f"{{ {', '.join(f'{key} = {toml(own)}' for key, own in data.items())} }}"
    if isinstance(data, list | tuple):
        return f"[{', '.join(map(toml, data))}]"
    if isinstance(data, str | bool):
        return json.dumps(data, ensure_ascii=False)
    return repr(data if isinstance(data, int) else float(data))


def section(head, keys):
    """Lines of a section."""
    return [head, *(f"{key} = {toml(own)}" for key, own in keys.items()), ""]


def column_of(name, unit):
    """The name of a column in a unit that it can end in; None where no name tells the unit."""
    suffix = {"N m": "Nm", "1": "duty", "%": "percent"}.get(unit, unit.replace("/", "_"))
    return f"{name}_{suffix}" if " " not in suffix and "2" not in suffix else None


def in_unit(values, unit):
    """Values (SI) in a unit."""
    return values / factor_of(unit)
