"""The source text of a kernel for one set of effects.

The equation of motion with exactly their terms is put together as the text of an
integrator, to be run plain or compiled. It solves

    m ẍ = F + Σ forces + c_s (ẋ_c - ẋ),  F = F0 q (-i_a sin kx + i_b cos kx)

with the currents i over I from the setpoints through what the drive does to them, and
q the force constant's factor. States that follow time (currents behind an inductance) are
integrated by the same RK4. Others are taken at each of its stages from what happened since
the step began, which no stiffness disturbs: states that follow the path (presliding) from
the way gone, currents behind a lag from their setpoints, as a parabola through the step has
them; so are the currents of a voltage loop in intervals where its supply must suffice. The
command and the steps are those of `kernel.integrate`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mopro.effects import Active
from mopro.effects.base import Effect, Term

# How fast the voltage loop takes a deviation of the current back, and the longest step that
# resolves it.
CURRENT_LOOP_S = 5e-5
LOOP_STEP_S = 1e-5
# What the text takes as given besides its arguments.
CONSTANTS = {"CURRENT_LOOP_S": CURRENT_LOOP_S, "LOOP_STEP_S": LOOP_STEP_S}


@dataclass(frozen=True)
class Layout:
    """What a set of effects needs of a kernel; the same for all values of their numbers.

    `states` names the states beyond position and velocity, those in time first.
    """

    effects: tuple[Effect, ...]

    @classmethod
    def of(cls, active: Sequence[Active]) -> Layout:
        return cls(tuple(a.effect for a in active if _has_term(a.effect)))

    @property
    def lag(self) -> int | None:
        return self._loop("lag")

    @property
    def voltage(self) -> int | None:
        return self._loop("voltage")

    def _loop(self, kind: str) -> int | None:
        """The place of the effect that is this block of the current loop."""
        places = [i for i, e in enumerate(self.effects) if e.current_loop == kind]
        return places[0] if places else None

    @property
    def in_time(self) -> list[str]:
        return self.behind + self.integrated

    @property
    def behind(self) -> list[str]:
        """The currents behind a lag, which follow their setpoints."""
        return [] if self.lag is None else ["la", "lb"]

    @property
    def integrated(self) -> list[str]:
        """The states in time that RK4 takes."""
        states = [] if self.voltage is None else ["ja", "jb"]
        return states + [f"s{i}" for i, e in enumerate(self.effects) if e.rate]

    @property
    def commanded(self) -> list[str]:
        """Those of them that are known without integrating as long as the supply suffices.

        The voltage loop then takes the currents where they are wanted.
        """
        return [] if self.voltage is None else self.integrated[:2]

    @property
    def on_path(self) -> list[str]:
        return [f"z{i}" for i, e in enumerate(self.effects) if e.slide]

    @property
    def states(self) -> list[str]:
        return self.in_time + self.on_path

    def numbers(self, i: int) -> str:
        """The parameters of effect `i` as further arguments."""
        count = len(self.effects[i].parameters)
        return "".join(f", p{i}_{j}" for j in range(count))

    def all_numbers(self) -> str:
        return "".join(self.numbers(i) for i in range(len(self.effects)))

    def terms(self) -> dict[str, Term]:
        """Every term under the name that the source text gives it."""
        kinds = ("force", "slide", "rate", "setpoint")
        found = {
            f"{kind}{i}": getattr(effect, kind)
            for i, effect in enumerate(self.effects)
            for kind in kinds
        }
        return {name: term for name, term in found.items() if term is not None}


def _has_term(effect: Effect) -> bool:
    return bool(effect.force or effect.slide or effect.rate or effect.setpoint) or (
        effect.current_loop is not None
    )


def kernel_parts(layout: Layout) -> dict[str, str]:
    """The functions of the kernel by name, each after those that it calls."""
    followed = {"followed": _FOLLOWED} if layout.behind or layout.commanded else {}
    return {
        "aims": aims_source(layout),
        **followed,
        "drive": drive_source(layout),
        "rates": rates_source(layout),
        "integrate": integrate_source(layout),
    }


def _indented(lines: Sequence[str], depth: int) -> str:
    return "".join(f"{'    ' * depth}{line}\n" for line in lines)


def _tuple(names: Sequence[str]) -> str:
    return "".join(f"{name}, " for name in names)


def aims_source(layout: Layout) -> str:
    """`aims`: the setpoints of the currents over I."""
    lines = ["theta = k * c", "ia = math.cos(theta)", "ib = math.sin(theta)"]
    for i, effect in enumerate(layout.effects):
        if effect.setpoint:
            lines.append(f"ia, ib = setpoint{i}(theta, ia, ib{layout.numbers(i)})")
    lines.append("return ia * gain, ib * gain")
    return f"def aims(c, gain, k{layout.all_numbers()}):\n{_indented(lines, 1)}"


# tau ds/dt = setpoint - s, exact at t for a setpoint that is a parabola over h.
_FOLLOWED = """\
def followed(behind, s0, s_mid, s1, t, h, tau):
    if tau <= 0.0:
        return behind
    slope = (4.0 * s_mid - 3.0 * s0 - s1) / h
    bend = 2.0 * (s1 - 2.0 * s_mid + s0) / (h * h)
    first = s0 - tau * slope + 2.0 * tau * tau * bend
    last = s0 + (t - tau) * slope + (t * t - 2.0 * tau * t + 2.0 * tau * tau) * bend
    return last + (behind - first) * math.exp(-t / tau)
"""


def drive_source(layout: Layout) -> str:
    """`drive`: currents over I, their rates, phase voltages (V) and motor force (N)."""
    lines = [f"ia, ib = aims(c, gain, k{layout.all_numbers()})"]
    lines += ["da = -k * w * gain * math.sin(k * c)", "db = k * w * gain * math.cos(k * c)"]
    lines += ["va = vb = dla = dlb = dja = djb = 0.0"]
    lines += ["sine = math.sin(k * x)", "cosine = math.cos(k * x)"]
    if layout.lag is not None:
        tau = f"p{layout.lag}_0"
        lines += [f"if {tau} > 0.0:", f"    da = dla = (ia - la) / {tau}"]
        lines += [f"    db = dlb = (ib - lb) / {tau}", "    ia = la", "    ib = lb"]
    if layout.voltage is not None:
        lines += _voltage_lines(f"p{layout.voltage}_0")
    lines.append("force = f0 * constant * (ib * cosine - ia * sine)")
    lines.append("return ia, ib, dla, dlb, dja, djb, va, vb, force")
    arguments = f"c, w, x, v, {_tuple(layout.states)}gain, constant, k, f0, amps, ohms, henries"
    return f"def drive({arguments}{layout.all_numbers()}):\n{_indented(lines, 1)}"


def _voltage_lines(limit: str) -> list[str]:
    """Each phase asks for the voltage that follows its setpoint, and gets what there is."""
    lines = ["emf = f0 * constant / amps * v", "ea = -emf * sine", "eb = emf * cosine"]
    for n in "ab":
        wanted = f"henries * amps * (d{n} + (i{n} - j{n}) / CURRENT_LOOP_S)"
        lines.append(f"v{n} = ohms * amps * j{n} + e{n} + {wanted}")
        lines.append(f"v{n} = min(max(v{n}, -{limit}), {limit})")
        lines.append(f"dj{n} = (v{n} - ohms * amps * j{n} - e{n}) / (henries * amps)")
    return [*lines, "ia = ja", "ib = jb"]


def rates_source(layout: Layout) -> str:
    """`rates`: the acceleration and the rate of every state in time."""
    call = f"c, w, x, v, {_tuple(layout.states)}gain, constant, k, f0, amps, ohms, henries"
    lines = [f"ia, ib, dla, dlb, dja, djb, va, vb, force = drive({call}{layout.all_numbers()})"]
    for i, effect in enumerate(layout.effects):
        if effect.force:
            state = f", z{i}" if effect.slide else f", s{i}" if effect.rate else ""
            lines.append(f"force += force{i}(x, v{state}{layout.numbers(i)})")
        if effect.rate:
            lines.append(f"ds{i} = rate{i}(s{i}, x, v{layout.numbers(i)})")
    # A drive that is switched off damps nothing.
    lines += ["if gain > 0.0:", "    force += damping * (w - v)", "a = force / mass"]
    lines.append(f"return a, {_tuple([f'd{s}' for s in layout.in_time])}0.0")
    arguments = f"{call}, damping, mass{layout.all_numbers()}"
    return f"def rates({arguments}):\n{_indented(lines, 1)}"


def _stage_lines(layout: Layout, n: int) -> list[str]:
    """Stage `n` of RK4 at (x{n}, v{n}) with the states that belong to it."""
    command = ("c0, w0", "c_mid, w_mid", "c_mid, w_mid", "c1, w1")[n - 1]
    lines = _lag_lines(layout, n)
    for state in layout.integrated:
        step = {1: "", 2: f" + half * d{state}_1", 3: f" + half * d{state}_2"}
        lines.append(f"{state}_{n} = {state}{step.get(n, f' + h * d{state}_3')}")
    lines += _commanded_lines(layout, n)
    lines += [_slide_line(layout, state, f"{state}_{n}", f"x{n} - x") for state in layout.on_path]
    states = _tuple([f"{s}_{n}" for s in layout.states])
    call = f"{command}, x{n}, v{n}, {states}gain, constant, k, f0, amps, ohms, henries"
    results = _tuple([f"a{n}", *(f"d{s}_{n}" for s in layout.in_time)])
    lines.append(f"{results}_ = rates({call}, damping, mass{layout.all_numbers()})")
    return lines


def _lag_lines(layout: Layout, n: int) -> list[str]:
    """The currents behind a lag at stage `n`."""
    if layout.lag is None:
        return []
    if n == 1:
        places = (("c0", "0"), ("c_mid", "_mid"), ("c1", "1"))
        call = f"gain, k{layout.all_numbers()}"
        aims = [f"sa{at}, sb{at} = aims({c}, {call})" for c, at in places]
        return [*aims, "la_1 = la", "lb_1 = lb"]
    if n == 3:
        return ["la_3 = la_2", "lb_3 = lb_2"]
    span = f"{'half' if n == 2 else 'h'}, h, p{layout.lag}_0"
    return [f"l{p}_{n} = followed(l{p}, s{p}0, s{p}_mid, s{p}1, {span})" for p in "ab"]


def _commanded_lines(layout: Layout, n: int) -> list[str]:
    """The currents at stage `n` of a drive that is free to set them.

    Its loop knows how ideal setpoints change, or those behind a lag, and is behind by its own
    time with the rest.
    """
    if not layout.commanded or (n == 1 and layout.lag is not None):
        return []
    if n == 1:
        places = (("u0", "c0", "0"), ("u_mid", "c_mid", "_mid"), ("u1", "c1", "1"))
        lines = []
        for u, c, at in places:
            angle = f"k * {u} * microstep"
            lines += [f"qa{at}, qb{at} = gain * math.cos({angle}), gain * math.sin({angle})"]
            lines += [f"sa{at}, sb{at} = aims({c}, gain, k{layout.all_numbers()})"]
        return ["if free:", *(f"    {line}" for line in lines)]
    at, span = ("1", "h") if n == 4 else ("_mid", "half")
    if layout.lag is not None:
        return ["if free:"] + [
            f"    j{p}_{n} = l{p}_{n} + followed(j{p} - l{p}, 0.0, 0.0, 0.0, {span}, h,"
            " CURRENT_LOOP_S)"
            for p in "ab"
        ]
    return ["if free:"] + [
        f"    j{p}_{n} = q{p}{at} + followed(j{p} - q{p}0, s{p}0 - q{p}0, s{p}_mid - q{p}_mid,"
        f" s{p}1 - q{p}1, {span}, h, CURRENT_LOOP_S)"
        for p in "ab"
    ]


def _pace_lines(layout: Layout) -> list[str]:
    """The longest step of an interval, and whether its drive has all the voltage it can ask for.

    An axis gains no more speed than twice the pull-out force gives it.
    """
    if layout.voltage is None:
        return ["longest = max_step"]
    lines = [
        f"ia, ib = aims(u0 * microstep, gain, k{layout.all_numbers()})",
        "tau = t + length - anchor",
        "w1 = (uv + tau * (ua + tau * uj / 2)) * microstep",
        "fastest = max(abs(v), abs(w0), abs(w1)) + 2.0 * f0 / mass * length",
        *_off_lines(layout),
        "asked = amps * (ohms * gain + henries * off)",
        "asked += (f0 * constant / amps + henries * amps * k * gain) * fastest",
        f"free = free and asked < p{layout.voltage}_0",
    ]
    return [*lines, "longest = max_step if free else min(max_step, LOOP_STEP_S)"]


def _off_lines(layout: Layout) -> list[str]:
    """`off`: how fast the currents (over I) are to change for being off their setpoints.

    A lag of no length follows nothing: its loop is integrated.
    """
    if layout.lag is None:
        return ["off = max(abs(ia - ja), abs(ib - jb)) / CURRENT_LOOP_S", "free = True"]
    lag = f"p{layout.lag}_0"
    return [
        "off = max(abs(la - ja), abs(lb - jb)) / CURRENT_LOOP_S",
        f"free = {lag} > 0.0",
        "if free:",
        f"    off += max(abs(ia - la), abs(ib - lb)) / {lag}",
    ]


def _slide_line(layout: Layout, state: str, target: str, way: str) -> str:
    i = int(state[1:])
    return f"{target} = slide{i}({state}, {way}{layout.numbers(i)})"


def _step_lines(layout: Layout) -> list[str]:
    lines = ["x1 = x", "v1 = v", *_stage_lines(layout, 1)]
    lines += ["x2 = x + half * v1", "v2 = v + half * a1", *_stage_lines(layout, 2)]
    lines += ["x3 = x + half * v2", "v3 = v + half * a2", *_stage_lines(layout, 3)]
    lines += ["x4 = x + h * v3", "v4 = v + h * a3", *_stage_lines(layout, 4)]
    lines += ["way = h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)"]
    lines += [_slide_line(layout, state, state, "way") for state in layout.on_path]
    lines += ["x += way", "v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)"]
    lines += [f"{s} = {s}_4" for s in layout.behind]
    for s in layout.integrated:
        lines.append(f"{s} += h / 6 * (d{s}_1 + 2 * d{s}_2 + 2 * d{s}_3 + d{s}_4)")
    if layout.commanded:
        lines += ["if free:", *(f"    {s} = {s}_4" for s in layout.commanded)]
    return lines


def _rest_lines(layout: Layout) -> list[str]:
    """Whether nothing moves and nothing is about to, under a command at rest."""
    states = _tuple(layout.states)
    call = f"u0 * microstep, 0.0, x, v, {states}gain, constant, k, f0, amps, ohms, henries"
    results = _tuple(["a1", *(f"d{s}_1" for s in layout.in_time)])
    lines = [f"{results}_ = rates({call}, damping, mass{layout.all_numbers()})"]
    lines.append("still = abs(v) < rest * natural and abs(a1) < rest * natural * natural")
    lines += [f"still = still and abs(d{s}_1) < rest * k * natural" for s in layout.in_time]
    return lines


def integrate_source(layout: Layout) -> str:
    """`integrate`: as kernel.integrate, with what the effects need besides.

    Further inputs: gain_of and constant_of (the factors on current and force constant
    for each interval), the drive's numbers, `numbers` (the effects' parameters in order)
    and `memory` (the states, taken up and left there). Further outputs at the knots:
    currents over I, voltages and motor force.
    """
    parameters = [
        f"p{i}_{j}"
        for i, effect in enumerate(layout.effects)
        for j in range(len(effect.parameters))
    ]
    at_knot = f"c1, w1, x, v, {_tuple(layout.states)}gain, constant, k, f0, amps, ohms, henries"
    return _INTEGRATE.format(
        unpack=_indented([f"{name} = numbers[{i}]" for i, name in enumerate(parameters)], 1),
        recall=_indented([f"{s} = memory[{i}]" for i, s in enumerate(layout.states)], 1),
        keep=_indented([f"memory[{i}] = {s}" for i, s in enumerate(layout.states)], 1),
        rest=_indented(_rest_lines(layout), 3),
        pace=_indented(_pace_lines(layout), 3),
        step=_indented(_step_lines(layout), 3),
        observe=f"drive({at_knot}{layout.all_numbers()})",
    )


_INTEGRATE = """\
def integrate(knots, row_of, anchor_of, x_of, v_of, a_of, j_of, gain_of, constant_of,
              k, f0, amps, ohms, henries, damping, mass, microstep, resolved, max_step,
              max_way, rest,
              numbers, memory, position, velocity, lag_low, lag_high,
              current_a, current_b, voltage_a, voltage_b, motor_force):
    natural = math.sqrt(k * f0 / mass)
    x = position[0]
    v = velocity[0]
{unpack}{recall}    row = -1
    steps = 0
    for i in range(-1, len(knots) - 1):
        first = i < 0
        t = knots[max(i, 0)]
        length = 0.0 if first else knots[i + 1] - t
        here = 0 if first else i
        if row_of[here] != row:
            row = row_of[here]
            anchor = anchor_of[row]
            ux = x_of[row]
            uv = v_of[row]
            ua = a_of[row]
            uj = j_of[row]
        gain = gain_of[here]
        constant = constant_of[here]
        holding = uv == 0.0 and ua == 0.0 and uj == 0.0
        tau = t - anchor
        u0 = ux + tau * (uv + tau * (ua / 2 + tau * uj / 6))
        w0 = (uv + tau * (ua + tau * uj / 2)) * microstep
        low = high = u0 * microstep - x
        still = first
        if holding and not first:
{rest}        if still:
            count = 0
            u1 = u0
            w1 = w0
            if not first:
                v = 0.0
        else:
{pace}            way = max(abs(v), abs(w0)) * length
            count = max(1, math.ceil(max(length / longest, way / max_way) - 1e-9))
        steps += count
        h = length / max(count, 1)
        half = h / 2
        for n in range(count):
            tau_mid = t + (n + 0.5) * h - anchor
            tau_end = t + (n + 1) * h - anchor
            u_mid = ux + tau_mid * (uv + tau_mid * (ua / 2 + tau_mid * uj / 6))
            u1 = ux + tau_end * (uv + tau_end * (ua / 2 + tau_end * uj / 6))
            w_mid = (uv + tau_mid * (ua + tau_mid * uj / 2)) * microstep
            w1 = (uv + tau_end * (ua + tau_end * uj / 2)) * microstep
            shift = 0.0
            if resolved and not holding:
                r0 = u0 - math.floor(u0 + 0.5)
                r1 = u1 - math.floor(u1 + 0.5)
                if abs(u1 - u0) > 1e-6:
                    shift = -(r1 * r1 - r0 * r0) / (2.0 * (u1 - u0))
                else:
                    shift = -(u_mid - math.floor(u_mid + 0.5))
            c0 = (u0 + shift) * microstep
            c_mid = (u_mid + shift) * microstep
            c1 = (u1 + shift) * microstep
{step}            u0 = u1
            w0 = w1
            lag = u1 * microstep - x
            if lag < low:
                low = lag
            if lag > high:
                high = lag
        if not first:
            position[i + 1] = x
            velocity[i + 1] = v
            lag_low[i] = low
            lag_high[i] = high
        c1 = u1
        if resolved:
            c1 = math.floor(u1 + 0.5)
        c1 *= microstep
        ia, ib, dla, dlb, dja, djb, va, vb, force = {observe}
        current_a[i + 1] = ia
        current_b[i + 1] = ib
        voltage_a[i + 1] = va
        voltage_b[i + 1] = vb
        motor_force[i + 1] = force
{keep}    return steps
"""
