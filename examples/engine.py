"""A simulator of your own, ten lines of it, asked what it lacks: python examples/engine.py

A tank that fills and empties. Its model knows the inflow and the outlet, and not that the tank
leaks from 0.3 m upwards, which is hidden in the data. Imports mopro.engine alone.
"""

import numpy as np

from mopro.engine import Candidate, Parameter, Series, reconcile

T = np.arange(0.0, 600.0, 1.0)  # s
INFLOW = 0.004 * (1 + np.sign(np.sin(T / 40)))  # m³/s


def simulate(settings):
    """The level (m) over time; an effect that is not in `settings` is off."""
    gain = settings.get("inflow gain", {}).get("k", 0.0)
    leak = settings.get("leak", {"q": 0.0, "from": 1.0})
    narrow = settings.get("narrow outlet", {}).get("c", 0.0)
    level = [0.2]
    for inflow in INFLOW[:-1]:
        out = 0.006 * (1 - narrow) * level[-1] ** 0.5 + leak["q"] * max(level[-1] - leak["from"], 0)
        level.append(max(level[-1] + ((1 + gain) * inflow - out) / 0.5, 0.0))
    return [np.array(level)]


EFFECTS = [
    Candidate("inflow gain", (Parameter("k", "1", -0.5, 0.5, starts=(0.05,)),)),
    Candidate("narrow outlet", (Parameter("c", "1", -0.5, 0.5, starts=(0.05,)),)),
    Candidate("leak", (Parameter("q", "m²/s", 0.0, 0.1, starts=(0.01,)),), fixed={"from": 0.3}),
]

if __name__ == "__main__":
    noise = 0.002 * np.random.default_rng(1).standard_normal(len(T))
    measured = simulate({"leak": {"q": 0.02, "from": 0.3}})[0] + noise
    exact = np.zeros((len(T), 0))  # a level gauge without an offset
    data = [Series("run 1", "level", "m", measured, 0.002, T, T // 100, nuisances=exact)]
    verdict = reconcile(simulate, EFFECTS, data)
    print(verdict)
    for taken in verdict.trace:
        if taken.decides:
            print(f"{taken.name}: {', '.join(taken.after)}, EBIC {taken.ebic:.1f} ({taken.why})")
