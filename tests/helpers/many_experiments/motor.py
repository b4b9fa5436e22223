"""The motor: programs, instruments and what the emulator measured of them."""

import numpy as np

import mopro
from helpers.many_experiments.draws import section, toml
from helpers.many_experiments.effects import effect
from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.instruments.quantity import FORCE, POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine.file import read_machine
from mopro.plant import measure
from mopro.source import Source

NAMES = {
    "force": {"x": "m", "v": "m/s", "motor": "N"}, "friction": {"x": "m", "v": "m/s", "motor": "N"},
    "command": {"x": "m", "v": "m/s", "a": "m/s2", "t": "s"},
    "measurement": {"x": "m", "v": "m/s", "a": "m/s2", "t": "s", "y": "m", "T": "C"},
}  # fmt: skip
UNITS = {"force": "N", "friction": "N", "command": "mm", "measurement": "um"}
HIDDEN = (
    ("viscous_drag", {"b": 9.0}), ("coulomb_friction", {"Fc": 5.0}), ("pitch_scale", {"e": 2e-4}),
    ("backlash", {"B": 2e-5}), ("constant_force", {"F_b": 3.0}), ("start_delay", {"d": 5e-3}),
)  # fmt: skip
QUANTITIES = {"position": POSITION, "force": FORCE, "temperature": TEMPERATURE}


class Motor:
    """An experiment on the motor; `write` emulates its runs and makes its files."""

    kind = "motor"

    def __init__(self, draw):
        self.draw, self.rate_hz = draw, draw.pick(20.0, 50.0, 100.0)

    def write(self, folder):
        draw = self.draw
        sensors = [self._sensor(1)] + [self._sensor(2) for _ in range(draw.pick(0, 0, 0, 1))]
        effects = [self._effect(nth) for nth in range(draw.pick(0, 0, 1, 2))]
        lines = ['machine = "chow1992"', ""]
        if draw.chance(0.4):
            lines[0] = 'machine = "machine.toml"'
            (folder / "machine.toml").write_text(self._machine(), "utf-8")
        for keys in effects:
            lines += section("[[effect]]", keys)
        for _, keys in sensors:
            lines += section("[[sensor]]", keys)
        for nth in range(draw.pick(1, 1, 1, 2)):
            lines += section("[[run]]", self._run(folder, nth, [own for own, _ in sensors]))
        (folder / "experiment.toml").write_text("\n".join(lines), "utf-8")
        return folder / "experiment.toml"

    def _machine(self):
        draw, lines = self.draw, ['name = "mine"', 'extends = "chow1992"', ""]
        if draw.chance(0.5):
            force = {"value": 111.0, "unit": "N", "origin": "assumed", "place": "a guess"}
            force["tolerance"] = draw.pick(0.01, 0.1, 0.3)
            lines += ["[axis]", f"pull_out_force = {toml(force)}", ""]
        for name, values in HIDDEN:
            if draw.chance(0.15):
                lines += section(f"[effects.{name}]", values)
        return "\n".join(lines) + "\n"

    def _sensor(self, axis):
        draw, quantity = self.draw, self.draw.pick(*["position"] * 5, "force", "temperature")
        unit = {"position": draw.pick("in", "mm", "um", "m"), "force": "N", "temperature": "C"}[
            quantity
        ]
        column = "temperature_C" if quantity == "temperature" else f"{quantity}_{axis}_{unit}"
        per = {"in": 1 / 0.0254, "mm": 1e3, "um": 1e6}.get(unit, 1.0)
        size = {"position": draw.size(-6.5, -4), "force": draw.size(-0.5, 1), "temperature": 0.1}
        keys = {
            "name": f"sensor {axis}", "quantity": quantity, "axis": axis, "column": column,
            "rate_hz": self.rate_hz,
            "noise_rms": float(f"{size[quantity] * per:.3g}"),
        }  # fmt: skip
        if draw.chance(0.2):
            keys["adc_step"] = keys["noise_rms"] * draw.pick(0.5, 1, 3)
        for key in ("gain_tolerance", "clock_tolerance"):
            if draw.chance(0.1):
                keys[key] = draw.size(-6, -3)
        sensor = Sensor(**{**keys, "quantity": QUANTITIES[quantity]})
        return sensor, keys

    def _effect(self, nth):
        place = self.draw.pick(*NAMES)
        return effect(self.draw, f"own {nth}", place, UNITS[place], NAMES[place], wild=0.05)

    def _program(self):
        draw, lines, place = self.draw, ["UU012500/1"], 0.0
        axis = draw.pick(1, 1, 1, 2)
        lines += [f"VEL{axis} {draw.pick(2.0, 5.0, 15.0)}", f"ACC{axis} {draw.pick(0.1, 0.2, 0.4)}"]
        for _ in range(draw.pick(1, 2, 3)):
            step = -place if place else draw.pick(0.2, 1.0, 3.0)
            lines += [f"MRI{axis} {step}", f"WX{axis}", f"WT{draw.pick(50, 200, 400)}"]
            place += step
        return "\n".join(lines) + "\n"

    def _run(self, folder, nth, sensors):
        draw, hidden = self.draw, self.draw.pick(*HIDDEN, None, None)
        text, names = self._program(), (f"run{nth}.CMD", f"run{nth}.csv")
        (folder / names[0]).write_text(text, "utf-8")
        truth = 'name = "truth"\nextends = "chow1992"\n'
        truth += "\n".join(section(f"[effects.{hidden[0]}]", hidden[1])) if hidden else ""
        machine = read_machine(Source("truth.toml", truth))
        recording = mopro.emulate(mopro.compile(text, names[0]), machine=machine, rate_hz=1000.0)
        active, columns = active_effects(machine, catalogue_of(machine)), {}
        for sensor in sensors:
            time_s, values = measure(recording, sensor, machine, active, draw.rng)
            columns |= {"time_s": time_s, sensor.column: values}
        np.savetxt(folder / names[1], np.column_stack(list(columns.values())), "%.12g", ",",
                   header=",".join(columns), comments="")  # fmt: skip
        return {"program": names[0], "data": names[1], "payload_kg": draw.pick(0.0, 0.0, 0.5)}
