"""An experiment as it is put together: its machine, signals, sensors and runs, and their files."""

import numpy as np

from helpers.many_experiments.draws import TIMES, column_of, in_unit, section
from mopro.formula import factor_of


class Sheet:
    """The parts of an experiment on a machine beside the motor; `write` makes its files.

    `names`: what formulas of effects may name, with units. `places`: where effects enter, with the
    unit of what they are added to.
    """

    def __init__(self, draw, kind):
        self.draw, self.kind, self.machine = draw, kind, f'machine = "{kind}"'
        self.names, self.places, self.switched = {"t": "s"}, {}, []
        self.base, self.laws, self.inputs, self.sensors, self.effects = {}, {}, {}, [], []
        self.runs, self.columns, self.files = [], [], {}
        self.time = draw.pick(*["s"] * 6, *TIMES)
        # A date has no more digits than a microsecond.
        self.begins_s = draw.pick(*[0.0] * 6, 5.0, -3.0, 1.7e9 if draw.step_s > 1e-3 else 0.0)

    def input(self, name, unit, **more):
        """A signal of the machine, as a column or as a formula of one."""
        column, d = column_of(name, unit), self.draw
        keys = {"column": column} if column else {"column": f"{name}_in", "unit": unit}
        if column and column.isidentifier() and d.chance(0.15):
            keys = {"formula": f"{column} * 1 + 0", "unit": unit}
        if d.chance(0.3):
            keys["hold"] = True
        if d.chance(0.03):
            keys["feedback"] = True
        self.inputs[name], self.names[name] = keys | more, unit
        return keys.get("column", column)

    def sensor(self, name, quantity, unit, **more):
        """A sensor, and what its readings have beside what it reads."""
        draw, column = self.draw, column_of(name, unit)
        keys = {"name": name, "quantity": quantity, "column": column or f"{name}_col"}
        keys |= more if column and draw.chance(0.8) else {"unit": unit, **more}
        one = Sensing(draw, keys, unit)
        self.sensors.append(one)
        return one

    def effect(self, keys):
        self.effects.append(keys)

    def run(self, t, inputs, states, **more):
        """A run: its times, the columns of inputs in their units, what each sensor reads in SI."""
        draw, nth = self.draw, len(self.runs)
        data = f"run{nth}.csv"
        keys = {"data": data, **more}
        begin, unit = self.begins_s, factor_of(self.time)
        clock = {"s": "time_s"}.get(self.time, f"stamp_{self.time}")
        columns = {clock: [repr(float(f"{v:.15g}")) for v in (begin + t) / unit]}
        columns |= {name: _cells(own) for name, own in inputs.items()}
        for sensing in self.sensors:
            if len(self.sensors) > 1 and nth and sensing is self.sensors[-1] and draw.chance(0.1):
                continue
            columns[sensing.keys["column"]] = _cells(sensing.read(states[sensing.keys["name"]]))
        if draw.chance(0.12) and len(t) > 40:
            keys["part"] = draw.pick([0, 0.6], [0.3, 1], [0.2, 0.9])
        if draw.chance(0.08) and len(t) > 40 and self.time == "s":
            keys["use"] = f"{clock} > {float(begin + t[len(t) // 4])!r}"
        if draw.chance(0.1):
            keys["name"] = f"run {nth}"
        self.runs.append(keys)
        self.files[data] = "\n".join(
            [",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]
        ) + "\n"  # fmt: skip

    def write(self, folder):
        """Write the files; the experiment's."""
        lines = [self.machine]
        if self.time != "s":
            stated = f"stamp_{self.time}"
            stated = f'{{ column = "{stated}", unit = "{self.time}" }}'
            short = self.time in ("ms", "us", "min") and self.draw.chance(0.5)
            lines.append(f'time = "stamp_{self.time}"' if short else f"time = {stated}")
        lines += ["", *(section("[inputs]", self.inputs) if self.inputs else [])]
        for sensing in self.sensors:
            lines += section("[[sensor]]", sensing.keys)
        for keys in self.effects:
            lines += section("[[effect]]", keys)
        for keys in self.runs:
            lines += section("[[run]]", keys)
        for name, text in {**self.files, "experiment.toml": "\n".join(lines)}.items():
            (folder / name).write_text(text, "utf-8")
        return folder / "experiment.toml"

    def of_file(self, top, laws=None):
        """Put the machine into a file of its own, with some of the effects in it."""
        lines = [f'kind = "{self.kind}"', 'name = "drawn"', *top, ""]
        lines += section("[nodes]", laws) if laws else []
        lines += section("[base]", self.base) if self.base else []
        there = [keys for keys in self.effects if self.draw.chance(0.5)]
        self.effects = [keys for keys in self.effects if keys not in there]
        for keys in there:
            lines += section("[[effect]]", keys)
        for name, values in self.switched:
            head = name if name.isidentifier() else f'"{name}"'
            lines += section(f"[effects.{head}]", values)
        self.machine = 'machine = "machine.toml"'
        self.files["machine.toml"] = "\n".join(lines)


class Sensing:
    """A sensor as it is stated, and how it turns what it reads into readings in its unit."""

    def __init__(self, draw, keys, unit):
        self.draw, self.keys, self.unit = draw, keys, unit
        self.gain, self.offset, self.sigma, self.step = 1.0, 0.0, None, 0.0
        self.noise = 10 ** draw.rng.uniform(-4, -1.5)
        self.oddity = draw.pick(*["none"] * 12, "rests", "saturated", "wild", "blank", "nan")
        self._state_scale()
        self._state_zero()
        if draw.chance(0.08):
            keys["drift"] = draw.pick("free", {"every_s": draw.size(-1, 2)})
        for key in ("gain_tolerance", "clock_tolerance"):
            if draw.chance(0.06):
                keys[key] = draw.size(-6, -1)

    def _state_scale(self):
        draw, keys = self.draw, self.keys
        if draw.chance(0.15):
            keys["scale"] = draw.pick("free", draw.size(-4, 4), 4096)
            self.gain = keys["scale"] if keys["scale"] != "free" else draw.near(1.0)
        if draw.chance(0.12):
            keys["sign"] = draw.pick(-1, 1, "free")
            self.gain *= keys["sign"] if keys["sign"] != "free" else draw.pick(1, -1)

    def _state_zero(self):
        draw, keys = self.draw, self.keys
        if draw.chance(0.3):
            keys["zero"] = draw.pick("free", 0, 0, draw.size(-3, 3))
        stated = keys.get("zero", "free")
        far = draw.pick(0.0, 0.0, 1.0, -1e3, 1e6)
        self.offset = (far if self.keys["quantity"] != "temperature" else 0.0) if (
            stated == "free"
        ) else float(stated)  # fmt: skip

    def read(self, values):
        """The readings of SI `values`; the first call states the noise and what depends on it."""
        rng = self.draw.rng
        true = self.gain * in_unit(values, self.unit) + self.offset
        reach = float(np.ptp(true)) or abs(self.gain) or 1.0
        if self.sigma is None:
            self._state_noise(reach, float(np.abs(true).max()))
        if self.oddity == "rests":
            true = np.full(len(true), true[0])
        seen = true + self.sigma * rng.standard_normal(len(true))
        if self.oddity == "saturated":
            seen = np.minimum(seen, true.min() + 0.6 * reach)
        odd = rng.choice(len(seen), max(len(seen) // 25, 1), replace=False)
        if self.oddity == "wild":
            seen[odd[:2]] += reach * rng.choice([-20, 5, 1e4])
        if self.oddity in ("blank", "nan") and len(seen) > 12:
            seen[odd] = np.nan
        return np.round(seen / self.step) * self.step if self.step else seen

    def _state_noise(self, reach, level):
        draw, keys = self.draw, self.keys
        self.sigma = max(self.noise * reach, 1e-12 * level)
        if draw.chance(0.08):
            self.step = float(f"{reach * 10 ** draw.rng.uniform(-3, -1):.2g}")
            keys["adc_step"] = self.step
        stated = float(f"{self.sigma * draw.pick(1, 1, 1, 0.5, 2):.3g}")
        keys["noise_rms"] = "unknown" if draw.chance(0.25) else stated
        if draw.chance(0.06):
            keys["linearity"] = self.sigma * draw.size(-1, 1)
            if draw.chance(0.5):
                keys["range"] = 2 * reach


def _cells(values):
    return ["" if np.isnan(v) else f"{v:.12g}" for v in values]
