"""A servo axis, M q̈ = τ - friction: measured force over a motion that is known.

A model that is not this project's motor, for the engine to be tried on.
"""

from __future__ import annotations

import numpy as np

from mopro.engine import Candidate, Parameter, Role, Series

MASS_KG = 2.0
SMOOTHING_M_S = 1e-3

CATALOGUE = (
    Candidate("viscous", (Parameter("b", "N s/m", 0, 20, (1.0,)),)),
    Candidate("coulomb", (Parameter("Fc", "N", 0, 10, (1.0,)),)),
    Candidate(
        "asymmetric_coulomb",
        (Parameter("forth", "N", 0, 10, (1.0, 2.0)), Parameter("back", "N", 0, 10, (1.0, 2.0))),
    ),
    Candidate(
        "stribeck",
        (
            Parameter("Fs", "N", 0, 10, (1.0,)),
            Parameter("v0", "m/s", 0.02, 1.0, (0.05, 0.2, 0.6), Role.SHAPE),
        ),
    ),
    Candidate("inertia", (Parameter("dM", "kg", -1, 1, (0.1,)),)),
    Candidate(
        "position_ripple",
        (
            Parameter("sine", "N", -5, 5, (1.0,)),
            Parameter("cosine", "N", -5, 5, (1.0,)),
            Parameter(
                "period",
                "m",
                0.004,
                0.06,
                tuple(1 / np.linspace(17, 250, 60)),
                Role.SHAPE,
                inverse=True,
            ),
        ),
        flexible=True,
    ),
)


class Servo:
    """Runs of the axis; `predict(settings)` is the model, `measure` a lab with noise."""

    def __init__(self, runs: int = 3, samples: int = 400, rate_hz: float = 400.0) -> None:
        self.time_s = np.arange(samples) / rate_hz
        self.motions = [self._motion(1.0 + 0.7 * run, run) for run in range(runs)]

    def _motion(self, f: float, phase: float):
        """Position, velocity and acceleration of two sines."""
        t = self.time_s
        parts = [(0.1, 2 * np.pi * f, 0.0), (0.03, 2 * np.pi * 2.7 * f, phase)]
        q = sum(a * np.sin(w * t + p) for a, w, p in parts)
        v = sum(a * w * np.cos(w * t + p) for a, w, p in parts)
        a = sum(-a * w * w * np.sin(w * t + p) for a, w, p in parts)
        return q, v, a

    def predict(self, settings):
        return [self._force(motion, settings) for motion in self.motions]

    def _force(self, motion, settings):
        q, v, a = motion
        direction = np.tanh(v / SMOOTHING_M_S)
        force = MASS_KG * a
        for name, p in settings.items():
            force = force + {
                "viscous": lambda p: p["b"] * v,
                "coulomb": lambda p: p["Fc"] * direction,
                "asymmetric_coulomb": lambda p: p["forth"] * (v > 0) - p["back"] * (v < 0),
                "stribeck": lambda p: p["Fs"] * direction * np.exp(-((v / p["v0"]) ** 2)),
                "inertia": lambda p: p["dM"] * a,
                "position_ripple": lambda p: (
                    p["sine"] * np.sin(2 * np.pi * q / p["period"])
                    + p["cosine"] * np.cos(2 * np.pi * q / p["period"])
                ),
                "bump": lambda p: p["height"] * np.exp(-(((q - 0.05) / 0.01) ** 2)),
                "drift": lambda p: p["rate"] * self.time_s,
                "hum": lambda p: p["A"] * np.sin(2 * np.pi * 50 * self.time_s + 1),
            }[name](p)
        return force

    def measure(self, truth, sigma: float, seed: int, offset: float = 0.3) -> list[Series]:
        rng = np.random.default_rng(seed)
        return [
            Series(
                run=f"run {i}", sensor="force", unit="N",
                values=force + offset + sigma * rng.standard_normal(len(force)),
                sigma=sigma, time_s=self.time_s, labels={"position": motion[0]},
            )
            for i, (force, motion) in enumerate(zip(self.predict(truth), self.motions, strict=True))
        ]  # fmt: skip
