"""The drive: the currents of the two phases, over I, for a command.

The loop of each current has a setpoint, behind a lag where there is one
(`current_loop = "lag"`). An ideal loop follows at once. One with a supply of limited
voltage (`current_loop = "voltage"`) sets the voltage of its phase,

    v_a = R i_a + L di_a/dt - Kf ẋ sin kx,  v_b = R i_b + L di_b/dt + Kf ẋ cos kx,

so that the current follows its setpoint, and takes a deviation back within
CURRENT_LOOP_S. As long as the supply suffices the currents are known without integrating.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, exp, sin

from mopro.plant.kernel.effect_terms import Numbers, Pair, Prepare, Setpoints, TermSet, setpoints

# How fast the voltage loop takes a deviation of the current back, and the longest step that
# resolves it, in s.
CURRENT_LOOP_S = 5e-5
LOOP_STEP_S = 1e-5

# The currents (ia, ib) over I of a lag or a loop, or nothing.
Currents = tuple[float, ...]
# The lagged currents and those of the coils.
Electric = tuple[Currents, Currents]
# Gain on the currents, Kf = F0/I (N/A), I (A), R (ohm), L (H), microstep (m). Not k, which is the
# axis's: were it here as well, compiled code would take two sines of one angle.
DriveNumbers = tuple[float, float, float, float, float, float]
# The setpoints of the loops at the start, the middle and the end of a step.
StepSetpoints = tuple[Pair, Pair, Pair]
# Command (m), gain, k (1/m) and the effects' parameters to a pair for the two phases.
Phasewise = Callable[[Currents, float, float, float, Numbers], Pair]


@dataclass(frozen=True)
class Drive:
    """The composed functions of a drive; c is the command and x the position in m, k in 1/m.

    loop_setpoints(lagged, c, gain, k, numbers): those of the loops;
    lag_rates(lagged, c, gain, k, numbers): the rates of the lagged currents in 1/s;
    through(electric, c0, c_mid, c1, u0, u_mid, u1, h, free, k, drive, numbers): the loops'
    setpoints in a step of h s, the currents at its start, middle and end, and the states after
    it, where no loop is short of voltage;
    phases(setpoint, c, w, x, v, currents, k, drive, numbers): voltages (V) and the rates of the
    currents in 1/s;
    charged(coil, dt, setpoint, c, w, x, v, currents, k, drive, numbers): the coils' currents
    after dt s at the rates that hold for `currents`;
    suffices(electric, c, fastest, k, drive, numbers): whether the supply does up to `fastest`
    m/s.
    """

    loop_setpoints: Phasewise
    lag_rates: Phasewise
    through: Callable[..., tuple[StepSetpoints, Pair, Pair, Pair, Electric]]
    phases: Callable[..., tuple[Pair, Pair]]
    charged: Callable[..., Pair]
    suffices: Callable[[Electric, float, float, float, DriveNumbers, Numbers], bool]


def drive_of(terms: TermSet, prepare: Prepare) -> Drive:
    """The drive of a set of effects, of functions that `prepare` has made ready."""
    aims = setpoints(terms, prepare)
    supply = -1 if terms.voltage is None else terms.voltage
    followed = prepare(follow)
    loop_setpoints: Phasewise
    rates: Phasewise
    if terms.lag is None:
        loop_setpoints = prepare(_loop_setpoints(aims))
        rates = prepare(no_rates)
        in_step = prepare(_setpoints_at_once(aims))
        known = prepare(_known_of_smooth(followed))
        change = prepare(change_of_smooth)
        deviation_rate = prepare(_deviation_rate(aims))
    else:
        loop_setpoints = prepare(_lagged_setpoints(aims, terms.lag))
        rates = prepare(_lag_rates(aims, terms.lag))
        in_step = prepare(_setpoints_behind(aims, followed, terms.lag))
        known = prepare(known_of_lagged)
        change = prepare(_change_of_lagged(rates, prepare(change_of_smooth), terms.lag))
        deviation_rate = prepare(_lagged_deviation_rate(aims, terms.lag))
    phases = prepare(_phases(change, prepare(one_phase), supply))
    return Drive(
        loop_setpoints,
        rates,
        prepare(_through(in_step, known, terms.voltage is not None)),
        phases,
        prepare(_charged(phases)),
        prepare(_suffices(deviation_rate, supply)),
    )


def follow(
    behind: float, s0: float, s_mid: float, s1: float, t: float, h: float, tau: float
) -> float:
    """tau ds/dt = s_set - s, exact at t (s) for a setpoint that is a parabola over h (s).

    behind: the state at 0; s0, s_mid, s1: the setpoint at 0, h/2 and h.
    """
    slope = (4.0 * s_mid - 3.0 * s0 - s1) / h
    bend = 2.0 * (s1 - 2.0 * s_mid + s0) / (h * h)
    first = s0 - tau * slope + 2.0 * tau * tau * bend
    last = s0 + (t - tau) * slope + (t * t - 2.0 * tau * t + 2.0 * tau * tau) * bend
    return last + (behind - first) * exp(-t / tau)


# -- the setpoints of the loops ---------------------------------------------------


def _loop_setpoints(aims: Setpoints) -> Phasewise:
    def loop_setpoints(lagged: Currents, c: float, gain: float, k: float, numbers: Numbers) -> Pair:
        """The setpoints themselves."""
        return aims(c, gain, k, numbers)

    return loop_setpoints


def _lagged_setpoints(aims: Setpoints, place: int) -> Phasewise:
    def loop_setpoints(lagged: Currents, c: float, gain: float, k: float, numbers: Numbers) -> Pair:
        """The lagged setpoints; a lag of no length is none."""
        if numbers[place][0] > 0.0:
            return lagged[0], lagged[1]
        return aims(c, gain, k, numbers)

    return loop_setpoints


def no_rates(lagged: Currents, c: float, gain: float, k: float, numbers: Numbers) -> Pair:
    return 0.0, 0.0


def _lag_rates(aims: Setpoints, place: int) -> Phasewise:
    def rates(lagged: Currents, c: float, gain: float, k: float, numbers: Numbers) -> Pair:
        """di/dt = (i_set - i) / tau, in 1/s."""
        tau = numbers[place][0]
        if tau <= 0.0:
            return 0.0, 0.0
        ia, ib = aims(c, gain, k, numbers)
        return (ia - lagged[0]) / tau, (ib - lagged[1]) / tau

    return rates


def _setpoints_at_once(aims: Setpoints) -> Callable[..., tuple[StepSetpoints, Currents]]:
    def in_step(
        lagged: Currents, c0: float, c_mid: float, c1: float,
        h: float, gain: float, k: float, numbers: Numbers,
    ) -> tuple[StepSetpoints, Currents]:  # fmt: skip
        """The setpoints at the start, the middle and the end of a step."""
        start, middle = aims(c0, gain, k, numbers), aims(c_mid, gain, k, numbers)
        return (start, middle, aims(c1, gain, k, numbers)), lagged

    return in_step


def _setpoints_behind(
    aims: Setpoints, followed: Callable[..., float], place: int
) -> Callable[..., tuple[StepSetpoints, Currents]]:
    def in_step(
        lagged: Currents, c0: float, c_mid: float, c1: float,
        h: float, gain: float, k: float, numbers: Numbers,
    ) -> tuple[StepSetpoints, Currents]:  # fmt: skip
        """The lagged setpoints, exact for setpoints that are parabolas over the step."""
        a0, b0 = aims(c0, gain, k, numbers)
        a_mid, b_mid = aims(c_mid, gain, k, numbers)
        a1, b1 = aims(c1, gain, k, numbers)
        tau = numbers[place][0]
        if tau <= 0.0:
            return ((a0, b0), (a_mid, b_mid), (a1, b1)), lagged
        la, lb = lagged
        half = h / 2
        middle = (
            followed(la, a0, a_mid, a1, half, h, tau),
            followed(lb, b0, b_mid, b1, half, h, tau),
        )
        end = followed(la, a0, a_mid, a1, h, h, tau), followed(lb, b0, b_mid, b1, h, h, tau)
        return ((la, lb), middle, end), end

    return in_step


def _through(
    setpoints_through: Callable[..., tuple[StepSetpoints, Currents]],
    known: Callable[..., tuple[Pair, Pair]],
    has_loop: bool,
) -> Callable[..., tuple[StepSetpoints, Pair, Pair, Pair, Electric]]:
    def through(
        electric: Electric, c0: float, c_mid: float, c1: float,
        u0: float, u_mid: float, u1: float, h: float, free: bool,
        k: float, drive: DriveNumbers, numbers: Numbers,
    ) -> tuple[StepSetpoints, Pair, Pair, Pair, Electric]:  # fmt: skip
        """Setpoints of the loops, currents through the step, and the states after it.

        Loops that are not `free` have only their currents at the start right.
        """
        lagged, coil = electric
        in_step, lagged = setpoints_through(lagged, c0, c_mid, c1, h, drive[0], k, numbers)
        start, middle, end = in_step
        if has_loop:
            start = coil[0], coil[1]
            if free:
                middle, end = known(coil, in_step, u0, u_mid, u1, h, k, drive)
            coil = end
        return in_step, start, middle, end, (lagged, coil)

    return through


# -- loops with a supply of limited voltage ---------------------------------------


def _known_of_smooth(followed: Callable[..., float]) -> Callable[..., tuple[Pair, Pair]]:
    def known(
        coil: Currents, in_step: StepSetpoints, u0: float, u_mid: float, u1: float,
        h: float, k: float, drive: DriveNumbers,
    ) -> tuple[Pair, Pair]:  # fmt: skip
        """The loop knows how ideal setpoints change, and is behind with the rest by its time.

        Ideal are those of the smooth command, from u0 over u_mid to u1 (microsteps).
        """
        gain, microstep = drive[0], drive[5]
        t0, t_mid, t1 = k * u0 * microstep, k * u_mid * microstep, k * u1 * microstep
        qa0, qa_mid, qa1 = gain * cos(t0), gain * cos(t_mid), gain * cos(t1)
        qb0, qb_mid, qb1 = gain * sin(t0), gain * sin(t_mid), gain * sin(t1)
        da, db = coil[0] - qa0, coil[1] - qb0
        ra0, ra_mid, ra1 = in_step[0][0] - qa0, in_step[1][0] - qa_mid, in_step[2][0] - qa1
        rb0, rb_mid, rb1 = in_step[0][1] - qb0, in_step[1][1] - qb_mid, in_step[2][1] - qb1
        half = h / 2
        a_mid = qa_mid + followed(da, ra0, ra_mid, ra1, half, h, CURRENT_LOOP_S)
        b_mid = qb_mid + followed(db, rb0, rb_mid, rb1, half, h, CURRENT_LOOP_S)
        a1 = qa1 + followed(da, ra0, ra_mid, ra1, h, h, CURRENT_LOOP_S)
        b1 = qb1 + followed(db, rb0, rb_mid, rb1, h, h, CURRENT_LOOP_S)
        return (a_mid, b_mid), (a1, b1)

    return known


def known_of_lagged(
    coil: Currents, in_step: StepSetpoints, u0: float, u_mid: float, u1: float,
    h: float, k: float, drive: DriveNumbers,
) -> tuple[Pair, Pair]:  # fmt: skip
    """The loop knows how lagged setpoints change; its deviation decays with its time."""
    da, db = coil[0] - in_step[0][0], coil[1] - in_step[0][1]
    mid, end = exp(-(h / 2) / CURRENT_LOOP_S), exp(-h / CURRENT_LOOP_S)
    middle = in_step[1][0] + da * mid, in_step[1][1] + db * mid
    return middle, (in_step[2][0] + da * end, in_step[2][1] + db * end)


def change_of_smooth(
    setpoint: Pair, c: float, w: float, gain: float, k: float, numbers: Numbers
) -> Pair:
    """Rates of change (1/s) of ideal setpoints at the command's speed w (m/s)."""
    return -k * w * gain * sin(k * c), k * w * gain * cos(k * c)


def _change_of_lagged(
    rates: Callable[..., Pair], smooth: Callable[..., Pair], place: int
) -> Callable[..., Pair]:
    def change(setpoint: Pair, c: float, w: float, gain: float, k: float, numbers: Numbers) -> Pair:
        """Rates of change (1/s) of lagged setpoints."""
        if numbers[place][0] > 0.0:
            return rates(setpoint, c, gain, k, numbers)
        return smooth(setpoint, c, w, gain, k, numbers)

    return change


def one_phase(
    setpoint: float, change: float, i: float, emf: float, limit: float,
    amps: float, ohms: float, henries: float,
) -> Pair:  # fmt: skip
    """The voltage (V) that one loop gets of what it asks for, and di/dt (1/s), i over I.

    setpoint, change: of the loop, and its rate (1/s); emf, limit: in V.
    """
    inductive = henries * amps * (change + (setpoint - i) / CURRENT_LOOP_S)
    voltage = ohms * amps * i + emf + inductive
    if voltage > limit:
        voltage = limit
    elif voltage < -limit:
        voltage = -limit
    return voltage, (voltage - ohms * amps * i - emf) / (henries * amps)


def _phases(
    change: Callable[..., Pair], phase: Callable[..., Pair], place: int
) -> Callable[..., tuple[Pair, Pair]]:
    def phases(
        setpoint: Pair, c: float, w: float, x: float, v: float,
        coil: Currents, k: float, drive: DriveNumbers, numbers: Numbers,
    ) -> tuple[Pair, Pair]:  # fmt: skip
        """Both phases' voltages (V) and rates (1/s) at position x (m) and speed v (m/s)."""
        gain, kf, amps, ohms, henries, _ = drive
        limit = numbers[place][0]
        da, db = change(setpoint, c, w, gain, k, numbers)
        emf_a, emf_b = -kf * v * sin(k * x), kf * v * cos(k * x)
        va, ja = phase(setpoint[0], da, coil[0], emf_a, limit, amps, ohms, henries)
        vb, jb = phase(setpoint[1], db, coil[1], emf_b, limit, amps, ohms, henries)
        return (va, vb), (ja, jb)

    return phases


def _charged(phases: Callable[..., tuple[Pair, Pair]]) -> Callable[..., Pair]:
    def charged(
        coil: Pair, dt: float, setpoint: Pair, c: float, w: float, x: float, v: float,
        currents: Pair, k: float, drive: DriveNumbers, numbers: Numbers,
    ) -> Pair:  # fmt: skip
        """The currents `coil` after dt s at the rates that hold for `currents` at x and v."""
        da, db = phases(setpoint, c, w, x, v, currents, k, drive, numbers)[1]
        return coil[0] + dt * da, coil[1] + dt * db

    return charged


def charge_end(coil: Pair, second: Pair, third: Pair, fourth: Pair, fifth: Pair) -> Pair:
    """The currents after a Runge-Kutta step from those that its four rates lead to.

    second and third lie half a step behind `coil`, fourth and fifth a whole one.
    """
    return (
        (2 * second[0] + 4 * third[0] + 2 * fourth[0] + fifth[0] - 3 * coil[0]) / 6,
        (2 * second[1] + 4 * third[1] + 2 * fourth[1] + fifth[1] - 3 * coil[1]) / 6,
    )


def _deviation_rate(aims: Setpoints) -> Callable[..., tuple[bool, float]]:
    def deviation_rate(
        electric: Electric, c: float, gain: float, k: float, numbers: Numbers
    ) -> tuple[bool, float]:
        """Rate of change (1/s) that corrects the currents' deviation from their setpoints."""
        ia, ib = aims(c, gain, k, numbers)
        coil = electric[1]
        deviation_a, deviation_b = abs(ia - coil[0]), abs(ib - coil[1])
        return True, (deviation_a if deviation_a > deviation_b else deviation_b) / CURRENT_LOOP_S

    return deviation_rate


def _lagged_deviation_rate(aims: Setpoints, place: int) -> Callable[..., tuple[bool, float]]:
    def deviation_rate(
        electric: Electric, c: float, gain: float, k: float, numbers: Numbers
    ) -> tuple[bool, float]:
        """As above behind a lag; the loop of a lag of zero length is integrated."""
        tau = numbers[place][0]
        (la, lb), coil = electric
        deviation_a, deviation_b = abs(la - coil[0]), abs(lb - coil[1])
        of_loop = (deviation_a if deviation_a > deviation_b else deviation_b) / CURRENT_LOOP_S
        if tau <= 0.0:
            return False, of_loop
        ia, ib = aims(c, gain, k, numbers)
        deviation_a, deviation_b = abs(ia - la), abs(ib - lb)
        return True, of_loop + (deviation_a if deviation_a > deviation_b else deviation_b) / tau

    return deviation_rate


def _suffices(
    deviation_rate: Callable[..., tuple[bool, float]], place: int
) -> Callable[[Electric, float, float, float, DriveNumbers, Numbers], bool]:
    def suffices(
        electric: Electric, c: float, fastest: float,
        k: float, drive: DriveNumbers, numbers: Numbers,
    ) -> bool:  # fmt: skip
        """True if the supply has all the voltage that the loops can ask for.

        R I gain + L I off + (Kf + L I k gain) v_max < Vb, in V.
        """
        gain, kf, amps, ohms, henries, _ = drive
        known, rate = deviation_rate(electric, c, gain, k, numbers)
        asked = amps * (ohms * gain + henries * rate)
        asked += (kf + henries * amps * k * gain) * fastest
        return known and asked < numbers[place][0]

    return suffices
