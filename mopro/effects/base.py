"""An effect: one object that the emulator runs, a machine file switches on and the diagnosis fits.

An effect overrides the hooks of its domain and leaves the others alone. Parameters reach
every hook in their order, in the unit that they state (SI throughout).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.model import Candidate, Role, Settings
from mopro.diagnosis.model import Parameter as Fitted

if TYPE_CHECKING:
    from mopro.instruments.sensor import Sensor
    from mopro.machine import Machine
    from mopro.machine.constants import PlantConstants
    from mopro.motion import PlannedMove, Schedule
    from mopro.program import Program

Floats = NDArray[np.float64]
# A term of the equation of motion: scalars in, scalars out, in the Python numba compiles.
Term = Callable[..., Any]

# What a setting may add to an effect's own parameters: the axis on which alone it acts (0 for
# all), and the run in which alone it happened (-1 for all).
AXIS, RUN = "axis", "run"

# A range is fitted this many times as far as is plausible, so that its ends can be told.
WIDER = 1.5


class Domain(StrEnum):
    """Where an effect acts: on the command, the dynamics, the measurement, the heat."""

    COMMAND = "C"
    DYNAMICS = "D"
    MEASUREMENT = "M"
    HEAT = "T"


def angle_in(run: int, angle: str) -> str:
    """The name under which `angle`, a parameter that is `per_run`, is fitted in run `run`."""
    return f"{angle}_{run + 1}"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    `low` and `high` are the bounds of what makes sense at all, `plausible` the range to
    expect, `null` the value at which the effect vanishes, `default` one to try.
    `dimension` is the units.py dimension that a machine file may convert from. An angle that
    is `per_run` is another one in each run. `role` is how the response follows it; unless
    given, one whose null is its default and not 0 is a shape, any other an amplitude.
    """

    name: str
    unit: str
    dimension: str
    default: float
    plausible: tuple[float, float]
    low: float
    high: float
    meaning: str
    null: float = 0.0
    whole: bool = False
    per_run: bool = False
    role: Role | None = None

    def fault(self, value: float) -> str | None:
        """What is wrong with `value`, if anything."""
        if not math.isfinite(value) or not self.low <= value <= self.high:
            bounds = f"{self.low:g} to {self.high:g} {self.unit}"
            return f"{self.name} = {value:g} is out of bounds: expected {bounds}"
        if self.whole and value != round(value):
            return f"{self.name} = {value:g} must be a whole number"
        return None

    @property
    def response(self) -> Role:
        """The role that is stated, or else follows from the null."""
        implied = Role.SHAPE if self.null == self.default != 0 else Role.AMPLITUDE
        return self.role or implied

    def fitted(self, *starts: float) -> Fitted:
        """An amplitude to fit, from `starts`, in a range somewhat wider than the plausible one."""
        low, high = self.plausible
        low = low if low < 0 else 0.0
        return Fitted(
            self.name, self.unit, max(WIDER * low, self.low), min(WIDER * high, self.high),
            starts, plausible=(low, high),
        )  # fmt: skip

    def tried(self) -> Fitted:
        """One of an effect that declares no forms: fitted as far again beyond what is plausible."""
        if self.response is Role.PHASE:
            return phase(self.name)
        low, high = self.plausible
        reach = max(abs(low), abs(high)) or 1.0
        return Fitted(
            self.name, self.unit, max(self.low, low - reach), min(self.high, high + reach),
            (self.default or high / 2,), null=self.null, plausible=self.plausible,
        )  # fmt: skip


def phase(name: str, *starts: float) -> Fitted:
    """An angle to fit."""
    return Fitted(name, "rad", -math.pi, math.pi, starts, Role.PHASE)


@dataclass
class Surroundings:
    """The forcer's heat balance at one moment; effects of the heat domain change it.

    `coil_W` is put into the coils, `conductance_W_K` leads to air of `air_C`,
    `speeds_m_s` are the axes' speeds, `lengths_m` their strokes, `extra_W` whatever
    else comes in.
    """

    time_s: float
    temperature_C: float
    air_C: float
    coil_W: float
    conductance_W_K: float
    speeds_m_s: tuple[float, ...]
    lengths_m: tuple[float, ...]
    machine: Machine
    extra_W: float = 0.0

    @property
    def flow_W(self) -> float:
        """The net heat flow into the forcer."""
        loss = self.conductance_W_K * (self.temperature_C - self.air_C)
        return self.coil_W + self.extra_W - loss


@dataclass(frozen=True)
class Scene:
    """What surrounds a measurement: samples of the true run on one axis and its other."""

    time_s: Floats
    other_m: Floats
    temperature_C: Floats
    air_C: float


class ViewedRun(Protocol):
    """One run of an experiment; one that followed a logged command has no program."""

    @property
    def program(self) -> Program | None: ...


class ViewedReading(Protocol):
    """What one sensor showed in one run: its samples' times (s)."""

    @property
    def sensor(self) -> Sensor: ...

    @property
    def time_s(self) -> Floats: ...


class View(Protocol):
    """The experiment that an effect is to be fitted to, as the machine's model predicts it.

    Series are numbered in the order of the runs' readings, steady tables last.
    """

    @property
    def machine(self) -> Machine: ...

    @property
    def runs(self) -> Sequence[ViewedRun]: ...

    def own(self, name: str) -> Mapping[str, float]:
        """The numbers of the effect `name` that the machine has already; none if it has not."""
        ...

    def positions(self) -> Mapping[int, tuple[int, ViewedReading]]:
        """Of each series of positions: the number of its run, and its reading."""
        ...

    def schedule(self, index: int, /) -> Schedule:
        """What run number `index` commands."""
        ...

    def targets(self, settings: Settings, /) -> Sequence[Floats]:
        """Each series, in its unit, of a sensor that errs in time only."""
        ...

    def travel_m(self) -> tuple[float, float]:
        """The least and the greatest position that any sensor was to see."""
        ...


@dataclass(frozen=True)
class Toleranced:
    """The number of a machine file that an effect's parameter corrects.

    `key` is the file's `section.key`. The parameter is `middle` where the file is right, and
    moves by `scale` times the share by which it is wrong.
    """

    key: str
    middle: float
    scale: float


class Effect:
    """Base of all effects; the subclass' docstring states equation, units and source."""

    name: ClassVar[str]
    domain: ClassVar[Domain]
    parameters: ClassVar[tuple[Parameter, ...]]
    # Effects of one family look alike to many sensors.
    families: ClassVar[tuple[str, ...]] = ()
    # Terms of the equation of motion, composed into the kernel (see plant/kernel/terms.py);
    # z is the effect's own state if it has a `slide`:
    #   force(x, v, [z,] *parameters) -> N              a force on the forcer
    #   reaction(x, v, [z,] motor_N, *parameters) -> N  one that depends on the motor's own
    #   slide(z, dx, *parameters) -> z                  a state that follows the path
    #   setpoint(theta, ia, ib, *parameters) -> (ia, ib)   phase currents over I
    force: ClassVar[Term | None] = None
    reaction: ClassVar[Term | None] = None
    slide: ClassVar[Term | None] = None
    setpoint: ClassVar[Term | None] = None
    # Blocks that the drive itself knows: "lag" or "voltage".
    current_loop: ClassVar[str | None] = None
    # Effects of one group cost little: whoever simulates many sets of them gives each set the
    # whole group, at neutral values, and compiles one kernel for all.
    kernel_group: ClassVar[str | None] = None
    # Acts on what all others of its hook have made; else they act in the catalogue's order.
    acts_last: ClassVar[bool] = False
    # Why it is no property of the machine, in words that follow "not in the machine file: ".
    reservation: ClassVar[str | None] = None
    # Its parameter that is a constant added to all readings of one sensor.
    constant_offset: ClassVar[str | None] = None

    # An effect has no state: two objects of one class are one effect, and one kernel.
    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def parameter(self, name: str) -> Parameter:
        """Its parameter of that name; KeyError if it has none."""
        return {p.name: p for p in self.parameters}[name]

    def equation(self) -> str:
        """The docstring: what the effect is, its equation, units and source."""
        return inspect.getdoc(type(self)) or ""

    def neutral(self, machine: Machine) -> dict[str, float]:
        """The values at which the effect vanishes on `machine`."""
        return {p.name: p.null for p in self.parameters}

    # -- what a machine, a person and a diagnosis are told ------------------------

    def stated_by(self, machine: Machine) -> tuple[float, ...] | None:
        """Its values on a machine that has it by what it states elsewhere than as an effect."""
        return None

    def toleranced(self, machine: Machine) -> Toleranced | None:
        """The number of the machine file that it corrects."""
        return None

    def fastest(self) -> tuple[float, ...] | None:
        """Plausible values at which a program is over soonest; None if it takes its time."""
        return None

    def static_deflection_m(self, machine: Machine) -> float:
        """How far, plausibly, it holds a resting axis off its command, the same everywhere."""
        return 0.0

    @property
    def needs_temperature(self) -> bool:
        """Whether motion or position depend on the temperature through it."""
        return type(self).force_factor is not Effect.force_factor

    @property
    def changes_program(self) -> bool:
        """Whether it acts on a program's statements, which a logged command has not."""
        return type(self).program is not Effect.program

    # -- what is fitted of it -------------------------------------------------------

    def forms(self, view: View) -> Iterator[Candidate]:
        """The forms in which it is fitted to the experiment of `view`.

        Unless an effect says otherwise: each of its amplitudes alone, and with all of them
        where that one has been found. What is not fitted is as the machine has it, else off;
        temperatures of reference are those of the air.
        """
        own, air_C = view.own(self.name), view.machine.heat.ambient_C
        amplitudes, angles, fixed = [], [], {}
        for p in self.parameters:
            if p.dimension == "temperature":
                fixed[p.name] = own.get(p.name, air_C)
            elif p.response is Role.SHAPE:
                fixed[p.name] = own.get(p.name, p.default)
            elif p.response is Role.PHASE:
                angles.append(p.tried())
            else:
                amplitudes.append(p)
        if len(amplitudes) == 1:
            yield self.form(amplitudes[0].tried(), *angles, fixed=fixed)
            return
        for p in amplitudes:
            others = [other for other in amplitudes if other is not p]
            without = fixed | {other.name: own.get(other.name, other.null) for other in others}
            yield self.form(p.tried(), *angles, form=p.name, fixed=without)
            words = " and ".join(each.name for each in (p, *others))
            every = (each.tried() for each in (p, *others))
            yield self.form(*every, *angles, form=words, fixed=fixed, extends=p.name)

    def form(
        self,
        *parameters: Fitted,
        form: str = "",
        fixed: Mapping[str, float] | None = None,
        **more: Any,
    ) -> Candidate:
        """A form of this effect that fits `parameters`; for `more` see Candidate."""
        return Candidate(self.name, parameters, form, fixed or {}, **more)

    def fitted(self, name: str, *starts: float) -> Fitted:
        """Its amplitude `name` as it is fitted, from `starts`; see Parameter.fitted."""
        return self.parameter(name).fitted(*starts)

    # -- hooks: command ---------------------------------------------------------

    def program(self, program: Program, *p: float) -> Program:
        """The program as the controller takes it."""
        return program

    def schedule(self, schedule: Schedule, *p: float) -> Schedule:
        """The schedule as the controller keeps it."""
        return schedule

    def tick_s(self, *p: float) -> tuple[float, bool]:
        """The controller's update interval, and whether it interpolates; 0 for none."""
        return 0.0, False

    # -- hooks: dynamics --------------------------------------------------------

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        """The constants of the equation of motion."""
        return plant

    def force_factor(self, temperature_C: Floats, *p: float) -> Floats | None:
        """The factor on the force constant at these temperatures."""
        return None

    def hold(self, *p: float) -> tuple[float, float] | None:
        """(time at rest in s, factor on the current from then on)."""
        return None

    def jumps(self, moves: list[PlannedMove], *p: float) -> list[tuple[float, float]]:
        """(time, pitches) at which the axis falls behind at once, for the axis' moves."""
        return []

    # -- hooks: heat ------------------------------------------------------------

    def heat(self, here: Surroundings, *p: float) -> None:
        """Change the heat balance in place."""

    # -- hooks: measurement -----------------------------------------------------

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        """When the sample labelled `time_s` is really taken."""
        return time_s

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """Where the sensor's target is when the axis is at `x` (m)."""
        return x

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """What the transducer makes of its target at `x` (m)."""
        return x

    def bandwidth_s(self, quantity: str, *p: float) -> float:
        """The time constant of a first-order lag of a sensor of `quantity`."""
        return 0.0

    def electronics(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        """What is added after the transducer, at the times of sampling."""
        return x

    @property
    def distorts(self) -> bool:
        """Whether it changes what is read of the target, and not only when."""
        own = type(self)
        return own.reading is not Effect.reading or own.electronics is not Effect.electronics


@dataclass(frozen=True)
class Active:
    """An effect switched on with these values, on these axes."""

    effect: Effect
    values: tuple[float, ...]
    axes: tuple[int, ...]

    @property
    def name(self) -> str:
        return self.effect.name

    def as_json(self) -> dict[str, object]:
        numbers = {p.name: v for p, v in zip(self.effect.parameters, self.values, strict=True)}
        return {"name": self.name, "axes": list(self.axes), "parameters": numbers}


def on_axis(active: tuple[Active, ...], axis: int) -> tuple[Active, ...]:
    """Those of `active` that act on `axis`."""
    return tuple(a for a in active if axis in a.axes)
