"""Coverage of 95 % intervals in white and in coloured noise.

    python bench/intervals.py [--seeds 200]

A force is measured over a known motion, with a viscous drag and a dry friction in it that the model
lacks. The noise is white, of the first order, or 1/f; its stated size is right, or none is stated.
Prints for each the verdicts with both names, the share of their intervals that contain the truth,
and two standard errors of that share.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mopro.engine import Candidate, Parameter, Series, Verdict, reconcile

Floats = NDArray[np.float64]
Rng = np.random.Generator

SAMPLES, RUNS, RATE_HZ = 1000, 4, 500.0
NOISE_N = 0.5
TRUTH = {"viscous": ("b", 8.0), "coulomb": ("Fc", 2.0)}
EFFECTS = [
    Candidate("viscous", (Parameter("b", "N s/m", 0, 20, starts=(1.0,)),)),
    Candidate("coulomb", (Parameter("Fc", "N", 0, 10, starts=(1.0,)),)),
    Candidate("quadratic", (Parameter("c", "N s2/m2", 0, 20, starts=(1.0,)),)),
    Candidate("inertia", (Parameter("dM", "kg", -1, 1, starts=(0.1,)),)),
]


def white(rng: Rng) -> Floats:
    return rng.standard_normal(SAMPLES)


def of_first_order(memory: float) -> Callable[[Rng], Floats]:
    """Noise of variance 1 whose correlation falls by `memory` a sample."""

    def drawn(rng: Rng) -> Floats:
        begun = [memory * rng.standard_normal()]
        steps = math.sqrt(1 - memory**2) * rng.standard_normal(SAMPLES)
        return np.asarray(signal.lfilter([1.0], [1.0, -memory], steps, zi=begun)[0])

    return drawn


def flicker(rng: Rng) -> Floats:
    """Noise of variance 1 whose power falls as 1/f."""
    lines = np.fft.rfft(rng.standard_normal(2 * SAMPLES))
    lines[1:] /= np.sqrt(np.arange(1, len(lines)))
    values = np.fft.irfft(lines)[:SAMPLES]
    return np.asarray((values - values.mean()) / values.std())


NOISES = {
    "white": white, "first order, 0.5": of_first_order(0.5),
    "first order, 0.9": of_first_order(0.9), "first order, 0.97": of_first_order(0.97),
    "1/f": flicker,
}  # fmt: skip


def motions() -> Iterator[tuple[Floats, Floats]]:
    """Speed (m/s) and acceleration (m/s²) of each run."""
    t = np.arange(SAMPLES) / RATE_HZ
    for run in range(RUNS):
        slow, quick = 5.0 + run, 16.0 + 2 * run
        speed = 0.6 * np.cos(slow * t) + 0.5 * np.cos(quick * t)
        yield speed, -0.6 * slow * np.sin(slow * t) - 0.5 * quick * np.sin(quick * t)


MOTIONS = list(motions())


def simulate(settings: dict[str, dict[str, float]]) -> list[Floats]:
    def size(effect: str, parameter: str) -> float:
        return settings.get(effect, {}).get(parameter, 0.0)

    return [
        (2.0 + size("inertia", "dM")) * acceleration
        + size("viscous", "b") * speed
        + size("coulomb", "Fc") * np.sign(speed)
        + size("quadratic", "c") * speed * np.abs(speed)
        for speed, acceleration in MOTIONS
    ]


def asked(noise: Callable[[Rng], Floats], stated: bool, seed: int) -> Verdict:
    rng = np.random.default_rng(seed)
    t = np.arange(SAMPLES) / RATE_HZ
    forces = simulate({name: {p: value} for name, (p, value) in TRUTH.items()})
    data = [
        Series(f"run {i}", "force", "N", force + NOISE_N * noise(rng), NOISE_N if stated else None,
               t, np.arange(SAMPLES) // (SAMPLES // 4))
        for i, force in enumerate(forces)
    ]  # fmt: skip
    return reconcile(simulate, EFFECTS, data)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=200)
    seeds = parser.parse_args().seeds
    print(f"{'noise':18} {'its size':8} {'both named':>11} {'covered':>9}")
    for name, noise in NOISES.items():
        for stated in (True, False):
            both, hits = 0, []
            for seed in range(seeds):
                verdict = asked(noise, stated, seed)
                found = {e.name: e.parameters for e in verdict.effects}
                both += found.keys() == TRUTH.keys()
                for effect, (parameter, value) in TRUTH.items():
                    if effect in found:
                        low, high = found[effect][parameter].ci95
                        hits.append(low <= value <= high)
            share = float(np.mean(hits))
            error = 2 * math.sqrt(share * (1 - share) / len(hits))
            told = "stated" if stated else "unknown"
            row = f"{name:18} {told:8} {both:6} of {seeds} {share:7.1%} ± {error:.1%}"
            print(row, flush=True)


if __name__ == "__main__":
    main()
