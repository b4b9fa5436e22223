"""Synthetic records of machines beside the motor, of the form of the measured sets."""

import csv
import math

import numpy as np


def write(path, columns):
    """A CSV file of columns."""
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines)
        writer.writerow(columns)
        writer.writerows(np.column_stack(list(columns.values())).tolist())


def driven(
    length_s=8.0, *, mass=2.0, viscous=3.0, spring=40.0, dry=0.0, of_place=0.0, seed=1, noise=0.2,
    cogging=0.0, pitch=0.06,
):  # fmt: skip
    """Columns of a mass on a spring, driven by a force; friction `dry` (N), `of_place` (N/m).

    `cogging` (N) has the period `pitch` (m); `noise` in mm.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, length_s, 0.02)
    first, second = rng.uniform(0.3, 0.7), rng.uniform(1.0, 1.6)
    force = 4 * np.sin(2 * math.pi * first * t) + 3 * np.sin(2 * math.pi * second * t + 1)
    x = v = 0.0
    places, h = [], 2e-4
    for push in force.tolist():
        places.append(x)
        for _ in range(100):
            pull = spring * x + cogging * math.sin(2 * math.pi * x / pitch + 0.7)
            w = v + h / mass * (push - viscous * v - pull)
            limit = h / mass * (dry + of_place * abs(x))
            v = math.copysign(max(abs(w) - limit, 0.0), w)
            x += h * v
    measured = 1e3 * np.array(places) + noise * rng.standard_normal(len(t))
    return {"time_s": t, "force_N": force, "position_mm": measured}


DRIVE = """\
kind = "axis"
name = "drive"
unit = "mm"

[base]
mass = { value = 2.0, unit = "kg", tolerance = 0.05 }
viscous = { value = 2.0, unit = "N s/m", free = true, range = [0, 30] }
spring = { value = 50, unit = "N/m", free = true, range = [0, 200] }
"""
FRICTION_OF_PLACE = """
[[effect]]
name = "friction of place"
enters = "friction"
formula = "F1 * abs(x)"
F1 = { unit = "N/m" }
"""
# A slide that goes where it is told, without its runs; `follows` states those.
_FOLLOWS = """\
machine = "kinematic"
[inputs]
command = { column = "target_mm" }
[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = NOISE_RMS
"""
DRIVEN = """\
machine = "machine.toml"

[inputs]
force = { column = "force_N", hold = true }

[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = 0.2

[[run]]
data = "run.csv"
start = { x = 0, v = 0 }
"""


def drive_folder(folder, machine=DRIVE, experiment=DRIVEN, **hidden):
    """A folder with a drive, its experiment and a record of it; the experiment's file."""
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    (folder / "experiment.toml").write_text(experiment, encoding="utf-8")
    write(folder / "run.csv", driven(**hidden))
    return folder / "experiment.toml"


def screw_log(places_mm, speed_mm_s, rest_s, *, play=0.06, ripple=0.02, scale=1.0004, seed=1):
    """Text of a controller's log of a lead screw of 5 mm: moves to places, with rests between.

    Semicolons, decimal commas, a line of notes, headings in German, a row of units; the set-point
    is blank where it has not changed, the clock begins at 1000 s.
    """
    step, told = 0.02, [0.0]
    for place in places_mm:
        while abs(place - told[-1]) > 1e-9:
            most = speed_mm_s * step
            told.append(told[-1] + min(max(place - told[-1], -most), most))
        told += [told[-1]] * round(rest_s / step)
    command, at, followed = np.array(told), 0.0, []
    for own in told:
        at = min(max(at, own - play / 2), own + play / 2)
        followed.append(at)
    true = np.array(followed)
    noise = 0.004 * np.random.default_rng(seed).standard_normal(len(true))
    seen = scale * true + ripple * np.sin(2 * math.pi * true / 5 + 0.7) + noise
    lines = ["Pruefstand;Achse X", "Zeit;Sollwert;Istwert", "[s];[mm];[mm]"]
    for n, (own, read) in enumerate(zip(command, seen, strict=True)):
        changed = n == 0 or own != command[n - 1]
        cells = f"{1000 + step * n:.3f}", f"{own:.3f}" if changed else "", f"{read:.3f}"
        lines.append(";".join(cells).replace(".", ","))
    return "\n".join(lines) + "\n"


def follows(noise_rms, *files):
    """An experiment on a slide (mm) that goes where it is told, with a run in each of the files."""
    runs = "".join(f'[[run]]\ndata = "{file}"\n' for file in files)
    return _FOLLOWS.replace("NOISE_RMS", str(noise_rms)) + runs
