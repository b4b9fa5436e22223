"""The nominal axis written a second time, for comparison: SciPy, in inches and radians.

Shares no code with mopro. Profiles follow from integrating the velocity by hand; the
microsteps are met one by one, the integration restarting at each.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import ode, solve_ivp

PITCH = 1.016e-3
K = 2 * np.pi / PITCH
F0 = 111.0
MASS = 2.543
ZETA = 0.03
INCH = 0.0254
MICROSTEP = PITCH / 500
C_S = 2 * ZETA * np.sqrt(K * F0 * MASS)


class SmoothMove:
    """x and v of a smooth move that begins at time 0: s, V, a in metres and seconds."""

    def __init__(self, s, v, a):
        self.s, self.v, self.a = abs(s), v, a
        self.sign = np.sign(s)
        self.ramp = 2 * v / a
        self.cruise = (self.s - 8 * v**2 / (3 * a)) / v
        self.duration = 2 * self.ramp + self.cruise
        self.corners = (0.0, self.ramp, self.ramp + self.cruise, self.duration)

    def _ramp(self, t):
        return self.a * t**2 / 2 - self.a**2 * t**3 / (12 * self.v)

    def x(self, t):
        if t <= self.ramp:
            way = self._ramp(t)
        elif t <= self.ramp + self.cruise:
            way = self._ramp(self.ramp) + self.v * (t - self.ramp)
        elif t < self.duration:
            way = self.s - self._ramp(self.duration - t)
        else:
            way = self.s
        return self.sign * way

    def xs(self, times):
        """x at each of `times`."""
        cruising = self._ramp(self.ramp) + self.v * (times - self.ramp)
        slowing = self.s - self._ramp(self.duration - times)
        before = [times <= self.ramp, times <= self.ramp + self.cruise, times < self.duration]
        return self.sign * np.select(before, [self._ramp(times), cruising, slowing], self.s)

    def xdot(self, t):
        near = min(t, self.duration - t, self.ramp)
        return self.sign * max(0.0, self.a * near - self.a**2 * near**2 / (4 * self.v))


def smooth_response(command, start, times, mass=MASS):
    """x at `times` (ascending, the first one 0) from the state `start`; rtol 1e-11."""

    def slope(t, y):
        force = F0 * np.sin(K * (command.x(t) - y[0])) + C_S * (command.xdot(t) - y[1])
        return [y[1], force / mass]

    found, state = [], np.array(start, dtype=float)
    corners = [*[c for c in command.corners if c < times[-1]], times[-1]]
    for begin, end in pairwise(corners):
        inside = times[(times >= begin) & (times < end)]
        leg = solve_ivp(
            slope, (begin, end), state, method="DOP853", rtol=1e-11, atol=1e-15,
            t_eval=np.append(inside, end),
        )  # fmt: skip
        found.append(leg.y[0, :-1])
        state = leg.y[:, -1]
    return np.append(np.concatenate(found), state[0]), state


class Stepwise:
    """Moves one after the other with rests between: (start, move) in order of start."""

    def __init__(self, *moves):
        self.moves = moves
        self.corners = tuple(start + c for start, move in moves for c in move.corners)
        self.duration = moves[-1][0] + moves[-1][1].duration

    def x(self, t):
        return sum(move.x(t - start) for start, move in self.moves if t > start)

    def xdot(self, t):
        return sum(move.xdot(t - start) for start, move in self.moves if t > start)


def jump_times(command, until):
    """The times (s) at which the command passes from one microstep to the next, by bisection."""
    count = int(np.floor(abs(command.x(until)) / MICROSTEP + 0.5))
    half_steps = (np.arange(count) + 0.5) * MICROSTEP
    grid = np.linspace(0, until, 20_001)
    at = np.searchsorted(np.abs(command.xs(grid)), half_steps)
    low, high = grid[at - 1], grid[at]
    for _ in range(44):
        middle = (low + high) / 2
        below = np.abs(command.xs(middle)) < half_steps
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def stepped_response(command, times, mass=MASS):
    """x at `times` with the drive's angle moving in whole microsteps, from rest at 0.

    Damping acts on the smooth command's velocity, as in the model.
    """
    jumps = jump_times(command, times[-1])
    events = np.unique(np.concatenate((jumps, times)))
    level = np.searchsorted(jumps, events, side="right")

    def slope(t, y, angle):
        x, v = y.tolist()  # numbers of numpy take several times longer
        force = F0 * math.sin(angle - K * x) + C_S * (command.xdot(t) - v)
        return [v, force / mass]

    solver = ode(slope).set_integrator("dop853", rtol=1e-11, atol=1e-15, nsteps=100_000)
    solver.set_initial_value([0.0, 0.0], 0.0)
    wanted, found = set(times.tolist()), []
    for i, event in enumerate(events):
        if event > solver.t:
            solver.set_f_params(command.sign * K * MICROSTEP * level[i - 1] if i else 0.0)
            solver.set_initial_value(solver.y, solver.t)
            solver.integrate(event)
        if event in wanted:
            found.append(solver.y[0])
    return np.array(found)
