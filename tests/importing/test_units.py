"""What `mopro import` writes, `mopro compare` runs: all kinds, units, and pairs of units."""

import json
import tomllib

import numpy as np
import pytest

from helpers.commands import run_here
from mopro.formula import factor_of
from mopro.instruments.quantity import unit_of_column

# Unit as a log's heading has it -> its size in SI; a count is the unit of its own dimension.
LENGTHS = {"mm": 1e-3, "um": 1e-6, "in": 0.0254, "m": 1.0, "mil": 25.4e-6}
ANGLES = {"deg": np.pi / 180, "rad": 1.0, "arcsec": np.pi / 648_000, "rev": 2 * np.pi}
COUNTS = {"count": 1.0, "step": 1.0}
PLACES = {**LENGTHS, **ANGLES, **COUNTS}
SPEEDS = {
    "rad/s": 1.0, "rpm": np.pi / 30, "deg/s": np.pi / 180, "m/s": 1.0, "mm/s": 1e-3,
    "in/s": 0.0254, "count/s": 1.0,
}  # fmt: skip
EFFORTS = {
    "V": 1.0, "mV": 1e-3, "A": 1.0, "mA": 1e-3, "duty": 1.0, "%": 0.01, "N": 1.0, "lbf": 4.448222,
    "Nm": 1.0, "W": 1.0, "mW": 1e-3,
}  # fmt: skip
WARMTHS = {"C": (1.0, 0.0), "K": (1.0, 273.15), "F": (1.8, 32.0)}
HEATS = {"W": 1.0, "mW": 1e-3, "duty": 1.0, "%": 0.01, "V": 1.0, "A": 1.0}
TIMES = np.arange(0, 8, 0.04)
NAMES = {"duty": "pwm"}


def every(*axes):
    """Combinations in which each unit meets each neighbour; all of them take minutes."""
    longest = max(map(len, axes))
    return [
        tuple(list(axis)[(n * (k + 1) + n // len(axis)) % len(axis)] for k, axis in enumerate(axes))
        for n in range(longest * 2)
    ]


def smooth():
    phase = np.clip((TIMES % 2) - 0.5, 0, 1)
    places = np.array([0.0, 3.0, 1.0, 4.0, 2.0])
    n = (TIMES // 2).astype(int)
    return places[n] + (places[n + 1] - places[n]) * (3 * phase**2 - 2 * phase**3)


def noisy(values, share=1e-3):
    return values + share * np.ptp(values) * np.random.default_rng(3).normal(size=len(values))


def size_of(unit, place=0.01):
    """A number of units that is about `place` in SI, or a thousand counts."""
    return 300.0 if unit in COUNTS else place / PLACES[unit]


def followed(command, measured):
    told = smooth()
    alike = next((g for g in (LENGTHS, ANGLES) if command in g and measured in g), None)
    own = size_of(command)
    factor = own * PLACES[command] / PLACES[measured] if alike else size_of(measured)
    if command == measured:
        factor = own
    return {f"command [{command}]": own * told, f"encoder [{measured}]": noisy(factor * told)}


def driven(effort, measured):
    """A first-order motion under a push of 2, read as a speed or as a place."""
    push = np.sign(np.sin(1.3 * TIMES)) + 0.5
    speed = np.zeros(len(TIMES))
    for n in range(1, len(TIMES)):
        speed[n] = speed[n - 1] + (TIMES[n] - TIMES[n - 1]) * (3.0 * push[n - 1] - speed[n - 1])
    if measured in SPEEDS:
        name, seen = "shaft speed", speed / SPEEDS[measured]
    else:
        place = np.concatenate(([0], np.cumsum(speed[:-1] * np.diff(TIMES))))
        name, seen = "stage position", place * size_of(measured, 0.1)
    pushed = 0.5 * push / EFFORTS[effort]
    return {f"{NAMES.get(effort, 'drive')} [{effort}]": pushed, f"{name} [{measured}]": noisy(seen)}


def heated(heat, warmth):
    scale, offset = WARMTHS[warmth]
    power = 0.6 * (TIMES % 4 < 2) + 0.1
    warm = np.zeros(len(TIMES))
    for n in range(1, len(TIMES)):
        warm[n] = warm[n - 1] + 0.04 * (30 * power[n - 1] - 0.3 * warm[n - 1])
    name = NAMES.get(heat, "heater")
    return {
        f"{name} [{heat}]": power / HEATS[heat],
        f"block [{warmth}]": scale * (20 + noisy(warm)) + offset,
    }


def commanded_speed(command, measured):
    told = np.sign(np.sin(1.3 * TIMES)) + 0.5
    late = np.zeros(len(TIMES))
    for n in range(1, len(TIMES)):
        late[n] = late[n - 1] + 0.1 * (told[n - 1] - late[n - 1])
    told, seen = told / SPEEDS[command], noisy(late) / SPEEDS[measured]
    return {f"speed target [{command}]": told, f"speed actual [{measured}]": seen}


CASES = [
    *((followed, *pair) for pair in every(PLACES, PLACES)),
    *((driven, *pair) for pair in every(EFFORTS, SPEEDS)),
    *((driven, *pair) for pair in every(EFFORTS, PLACES)),
    *((heated, *pair) for pair in every(HEATS, WARMTHS)),
    *((commanded_speed, *pair) for pair in every(SPEEDS, SPEEDS)),
    (followed, "mm", "count"), (followed, "count", "deg"), (followed, "step", "count"),
    (driven, "V", "rad/s"), (driven, "V", "rpm"), (heated, "W", "C"), (heated, "mW", "K"),
]  # fmt: skip


def written(folder, columns):
    data = {"time [s]": TIMES, **columns}
    rows = zip(*data.values(), strict=True)
    lines = [",".join(data), *(",".join(f"{v:.9g}" for v in row) for row in rows)]
    (folder / "log.csv").write_text("\n".join(lines) + "\n", "utf-8")


@pytest.mark.parametrize("case", dict.fromkeys(CASES), ids=lambda c: f"{c[0].__name__} {c[1:]}")
def test_what_import_writes_compare_runs_and_the_numbers_are_those_of_the_log(tmp_path, case):
    make, *units = case
    columns = make(*units)
    written(tmp_path, columns)
    done = run_here(tmp_path, "import", "log.csv", "--as", "out", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["unused"] == {}
    done = run_here(tmp_path, "compare", "out/experiment.toml", "--json")
    assert done.returncode in (0, 1), done.stderr
    back(tmp_path / "out", columns)


def back(folder, columns):
    """Each column of data.csv is, in SI, what the log has in SI."""
    data = np.genfromtxt(folder / "data.csv", delimiter=",", names=True)
    experiment = tomllib.loads((folder / "experiment.toml").read_text("utf-8"))
    used = [*experiment.get("inputs", {}).values(), *experiment["sensor"]]
    assert len(used) == len(columns)
    for (heading, values), one in zip(columns.items(), used, strict=True):
        unit = heading.split("[")[1].rstrip("]")
        seen = data[one["column"]]
        if unit in WARMTHS:
            scale, offset = WARMTHS[unit]
            assert seen == pytest.approx((values - offset) / scale, rel=1e-7)
            continue
        size = {**PLACES, **SPEEDS, **EFFORTS}[unit]
        assert factor_of(one["unit"]) * seen == pytest.approx(size * values, rel=1e-6)
        assert unit_of_column(one["column"]) == one["unit"]
