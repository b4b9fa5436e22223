"""Effects that can stand in for hidden ones: decided when a case is made, without noise.

A rival is equivalent if its best fit to the hidden response leaves less than the margin of
evidence: chi-squared below 10, with an offset free in each series. Both are simulated by the
reference plant. The rival is at most 1.5 times as strong as the far end of its range, as in a
diagnosis. Of sets of several rivals there are too many to try them all, and a fit may miss the best
parameters: what a verdict names is tried by itself, when the verdict is judged.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS, HiddenEffect, Parameters
from mopro.blind.cases.hidden_sizes import NoiselessRuns, Plant
from mopro.blind.reference.motor import Floats, Generator

# Parameters to begin with, and the names of those to fit.
Start = tuple[Parameters, tuple[str, ...]]
# chi-squared by which evidence distinguishes two effects.
MARGIN = 10.0
_STARTS = 2
_DRAWS = 6
# Strengths of the probe and of no effect; the probe is then scaled to the hidden size.
_PROBE = 0.2
# A rival's start may be weaker than the near end of its range.
_WEAKEST = 0.05
# Below this update interval (s) and this lag of the currents (s) simulations take long, as steps
# are as short, and the response is in proportion to it.
_FLOORS = {"T": 1e-4, "tau": 2e-5}
# A rival that leaves more than this share of chi-squared in the linear approximation is dropped.
_HOPELESS = 0.3
_EVALUATIONS = 8
_STEP = 1e-3
_STALLED = 1e6
_ANY = (-np.inf, np.inf)
# Parameters to fit that do not depend on the strength, with their ends (SI) but for angles.
_SHAPES = {
    "coulomb_friction": {"delta": (1e-6, 2e-5)},
    "stribeck_friction": {"delta": (1e-6, 2e-5), "vs": (2.5e-3, 0.45)},
    "load_dependent_friction": {"delta": (1e-6, 2e-5)},
    "umbilical_spring": {"x_h": (-0.3, 0.3)},
    "detent_force": {"phi": _ANY},
    "hold_current_reduction": {"t_h": (0.025, 0.75)},
    "periodic_error": {"lambda": (1.5e-4, 0.075), "phi": _ANY},
    "sensor_nonlinearity": {"mid": (-0.1, 0.1)},
    "hum": {"phi": _ANY, "phi2": _ANY, "phi3": _ANY},
    "platen_conduction": {"g": (0.0, 60.0)},
    "resistance_tempco": {"alpha": (0.0, 6e-3)},
}
# Physical ends of parameters that depend on the strength.
_PHYSICAL = {"h": (0.0, 1.0), "zeta": (0.0, 0.15)}
# A rival may be this much stronger than the far end of its range; draws that show both signs.
_WIDER, _FAINT, _SIGNS = 1.5, 1e-6, 8
# Fractions of a pitch in which forces and currents repeat, for a rival with a wavelength.
_WAVELENGTH, _PITCH_SHARES = "lambda", (1.0, 0.5, 0.25)


def equivalents(
    noiseless: NoiselessRuns, truth: dict[str, Parameters], generator: Generator
) -> list[str]:
    """The effects that are equivalent to `truth` on these runs, by name.

    What cannot be fitted in the first run is not tried in all of them.
    """
    domains = {HIDDEN_EFFECTS[name].thermal for name in truth}
    rivals = [e for e in HIDDEN_EFFECTS.values() if e.thermal in domains and e.name not in truth]
    first = NoiselessRuns(noiseless.runs[:1], noiseless.instruments, noiseless.nominal)
    for runs in (first, noiseless):
        target = runs.change(truth)
        if target is None:
            return []
        rivals = [r for r in rivals if least_left(runs, target, [r], generator) < MARGIN]
    return [rival.name for rival in rivals]


def left_by_set(
    noiseless: NoiselessRuns,
    truth: Plant,
    named: Mapping[str, Parameters],
    generator: Generator,
) -> float | None:
    """Chi-squared that the effects `named` together leave of all that is in `truth` on these runs.

    With their parameters in `named`, as a verdict states them, or, if that is not below the margin,
    with the best ones that a fit finds. None if the reference plant does not know one of them.
    """
    target = noiseless.change_of(truth)
    rivals = [HIDDEN_EFFECTS[name] for name in sorted(named) if name in HIDDEN_EFFECTS]
    if target is None or len(rivals) < len(named):
        return None
    (drawing,) = generator.spawn(1)
    forms = (_forms(noiseless, rival, named[rival.name], drawing) for rival in rivals)
    least = np.inf
    for stated in product(*forms):
        change = noiseless.change({r.name: own for r, own in zip(rivals, stated, strict=True)})
        if change is not None:
            least = min(least, float(np.sum((change - target) ** 2)))
    if least < MARGIN:
        return least
    return min(least, least_left(noiseless, target, rivals, generator))


def _forms(
    noiseless: NoiselessRuns,
    rival: HiddenEffect,
    stated: Parameters,
    generator: Generator,
) -> list[Parameters]:
    """The `stated` parameters of a rival; others are off, or as drawn for one of its forms."""
    forms: list[Parameters] = []
    for _ in range(_DRAWS):
        own = {**rival.draw(generator, noiseless.nominal)(_FAINT), **stated}
        if own not in forms:
            forms.append(own)
    return forms


def least_left(
    noiseless: NoiselessRuns,
    target: Floats,
    rivals: Sequence[HiddenEffect],
    generator: Generator,
) -> float:
    """Chi-squared that the best fit of `rivals` together leaves of `target`, the changes in σ."""
    total = float(target @ target)
    best, size = total, np.sqrt(total)
    for start in product(*(list(_starts(noiseless, r, size, generator)) for r in rivals)):
        if best >= MARGIN:
            own = {r.name: each for r, each in zip(rivals, start, strict=True)}
            best = min(best, Fit(noiseless, target, own).left())
    return best


def _starts(
    noiseless: NoiselessRuns, rival: HiddenEffect, size: float, generator: Generator
) -> Iterable[Start]:
    """Parameters of about the hidden size, and the names of those to fit.

    One for each form that is drawn (other parameters are not fitted), or other values of them;
    two at least where a shape is fitted.
    """
    seen: list[Parameters] = []
    for _ in range(_DRAWS):
        drawn = rival.draw(generator, noiseless.nominal)
        fixed = {n: v for n, v in drawn(1.0).items() if drawn(0.5)[n] == v}
        fixed = {n: v for n, v in fixed.items() if n not in _SHAPES.get(rival.name, ())}
        if fixed in seen and (rival.name not in _SHAPES or len(seen) >= _STARTS):
            continue
        seen.append(fixed)
        own = noiseless.change({rival.name: drawn(max(_PROBE, rival.least))})
        probed = float(np.linalg.norm(own)) if own is not None else 0.0
        if probed == 0.0:
            continue
        strength = float(np.clip(_PROBE * size / probed, _WEAKEST * rival.least, 1.0))
        start, other = drawn(strength), drawn(0.7 * strength)
        free = [name for name in start if start[name] != other[name]]
        free += [name for name in _SHAPES.get(rival.name, ()) if name not in free]
        yield start, tuple(free)
        if _WAVELENGTH in start:
            for share in _PITCH_SHARES:
                yield {**start, _WAVELENGTH: share * noiseless.nominal.pitch_m}, tuple(free)


@dataclass
class Fit:
    """Fit of rivals to the hidden response, from `starts`: parameters and names of the free."""

    noiseless: NoiselessRuns
    target: Floats
    starts: dict[str, Start]

    def left(self) -> float:
        """The remaining chi-squared; an estimate of it where that is far too much."""
        free = self._free
        if not free:
            return float(np.sum(self._residual(np.empty(0)) ** 2))
        ends = np.array([self._ends(*each) for each in free]).T
        scale = np.array([self._scale(*each) for each in free])
        first = np.clip([self.starts[rival][0][name] for rival, name in free], ends[0], ends[1])
        linear, step = self._linear(first, ends, scale)
        if linear > _HOPELESS * float(self.target @ self.target):
            return linear
        begin = np.clip(first + step * scale, ends[0], ends[1])
        inside = np.clip(begin, ends[0] + 1e-9 * scale, ends[1] - 1e-9 * scale)
        found = least_squares(
            self._residual, inside, bounds=(ends[0], ends[1]), x_scale=scale,
            diff_step=_STEP, max_nfev=_EVALUATIONS, callback=_enough,
        )  # fmt: skip
        return 2.0 * float(found.cost)

    @property
    def _free(self) -> list[tuple[str, str]]:
        """Each free parameter, by its rival and its name."""
        return [(rival, name) for rival, (_, free) in self.starts.items() for name in free]

    def _ends(self, rival: str, name: str) -> tuple[float, float]:
        if name in (shapes := _SHAPES.get(rival, {})):
            return shapes[name]
        if name in _PHYSICAL:
            return _PHYSICAL[name]
        effect, nominal = HIDDEN_EFFECTS[rival], self.noiseless.nominal
        draws = [effect.draw(np.random.default_rng(i), nominal) for i in range(_SIGNS)]
        ends = [drawn(strength)[name] for drawn in draws for strength in (_FAINT, _WIDER)]
        return min(ends), max(ends)

    def _scale(self, rival: str, name: str) -> float:
        ends = self._ends(rival, name)
        start = abs(self.starts[rival][0][name])
        return 1.0 if ends == _ANY else start or 1e-3 * max(map(abs, ends))

    def _residual(self, values: Floats) -> Floats:
        settings = {rival: dict(start) for rival, (start, _) in self.starts.items()}
        for (rival, name), value in zip(self._free, values.tolist(), strict=True):
            settings[rival][name] = value
        share = 1.0
        # The response of a set is not in proportion to one of its parameters.
        if len(settings) == 1:
            (own,) = settings.values()
            for name, floor in _FLOORS.items():
                if name in own and own[name] < floor:
                    share, own[name] = own[name] / floor, floor
        change = self.noiseless.change(settings)
        if change is None:
            return np.full(len(self.target), _STALLED)
        return share * change - self.target

    def _linear(self, at: Floats, ends: Floats, scale: Floats) -> tuple[float, Floats]:
        """Chi-squared left in the linear approximation at `at`, and the step, over `scale`."""
        here = self._residual(at)
        columns = []
        for i in range(len(at)):
            step = _STEP * scale[i] * (-1.0 if at[i] + _STEP * scale[i] > ends[1][i] else 1.0)
            moved = at.copy()
            moved[i] += step
            columns.append((self._residual(moved) - here) * scale[i] / step)
        basis = np.column_stack(columns)
        step = np.linalg.lstsq(basis, -here, rcond=1e-10)[0]
        left = here + basis @ step
        return float(left @ left), step


def _enough(intermediate_result: Any) -> None:
    """Stop a fit that leaves less than the margin already."""
    if 2.0 * intermediate_result.cost < MARGIN:
        raise StopIteration
