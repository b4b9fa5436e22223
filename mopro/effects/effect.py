"""Base of effects: objects that the emulator runs, a machine file switches on, a diagnosis fits.

An effect overrides the hooks of its domain only. Parameters are passed to every hook in
their order, in the unit that they state (SI throughout).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.engine.series import Settings
from mopro.units import to_si

if TYPE_CHECKING:
    from mopro.instruments.quantity import Quantity
    from mopro.instruments.sensor import Sensor
    from mopro.machine import Machine
    from mopro.machine.constants import PlantConstants
    from mopro.motion import PlannedMove, Schedule
    from mopro.program import Program

Floats = NDArray[np.float64]
# A term of the equation of motion: scalars in, scalars out, in the Python numba compiles.
Term = Callable[..., Any]

# What a setting may add to an effect's own parameters: the axis on which alone it acts (0 for all).
AXIS = "axis"

# The fitted range as a multiple of the plausible one, so that a value beyond it can be seen.
WIDER = 1.5


class Domain(StrEnum):
    """Part of the machine that an effect acts on: command, dynamics, measurement or heat."""

    COMMAND = "C"
    DYNAMICS = "D"
    MEASUREMENT = "M"
    HEAT = "T"


def angle_in(run: int, angle: str) -> str:
    """Name under which the `per_run` parameter `angle` is fitted in run `run` (from 0)."""
    return f"{angle}_{run + 1}"


def without_run(name: str) -> str:
    """The `per_run` parameter that has this name in one run (see `angle_in`)."""
    return name.rpartition("_")[0]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    `low` and `high` are the physical bounds, `plausible` the range to expect, `null` the value
    at which the effect vanishes, `default` the value of an effect that states none.
    `dimension` is the units.py dimension that a machine file may convert from. A `per_run`
    angle has a value of its own in each run. `role` is how the response depends on it; unless
    given, one whose null is its default and not 0 is a shape, any other an amplitude. A `unit_of`
    others is the measure in which they are stated: any value of it does, with other ones of them.
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
    unit_of: tuple[str, ...] = ()

    def converted(self, number: float, unit: str) -> float:
        """`number`, stated in `unit`, in the parameter's own unit; ValueError if it is no such."""
        return to_si(number, unit, self.dimension)

    def fault(self, value: float) -> str | None:
        """Error message for `value`; None if it is valid."""
        if not math.isfinite(value) or not self.low <= value <= self.high:
            bounds = f"{self.low:g} to {self.high:g} {self.unit}"
            return f"{self.name} = {value:g} is out of bounds: expected {bounds}"
        if self.whole and value != round(value):
            return f"{self.name} = {value:g} must be a whole number"
        return None

    @property
    def response(self) -> Role:
        """The stated role, else the one implied by the null."""
        implied = Role.SHAPE if self.null == self.default != 0 else Role.AMPLITUDE
        return self.role or implied

    def fitted(self, *starts: float) -> Fitted:
        """An amplitude to fit from `starts`, within WIDER times the plausible range."""
        low, high = self.plausible
        low = low if low < 0 else 0.0
        return Fitted(
            self.name, self.unit, max(WIDER * low, self.low), min(WIDER * high, self.high),
            starts, plausible=(low, high),
        )  # fmt: skip

    def assumed(self, value: float) -> Fitted:
        """A constant assumed to be in the plausible range, to fit from `value` and its ends."""
        low, high = self.plausible
        starts = dict.fromkeys((min(max(value, low), high), low, high))
        return Fitted(self.name, self.unit, low, high, tuple(starts), Role.CONSTANT)

    def tried(self) -> Fitted:
        """The fitted parameter of an effect without forms: twice the plausible reach as range."""
        if self.response is Role.PHASE:
            return phase(self.name)
        low, high = self.plausible
        reach = max(abs(low), abs(high)) or 1.0
        return Fitted(
            self.name, self.unit, max(self.low, low - reach), min(self.high, high + reach),
            (self.default or high / 2,), null=self.null, plausible=self.plausible,
        )  # fmt: skip


def phase(name: str, *starts: float, run: str | None = None) -> Fitted:
    """An angle (rad) to fit from `starts`; of one run only if that is named."""
    return Fitted(name, "rad", -math.pi, math.pi, starts, Role.PHASE, run=run)


@dataclass
class Surroundings:
    """The forcer's heat balance at one time; effects of the heat domain change it in place.

    `coil_W` is the power of the coils, `conductance_W_K` the conductance to air at `air_C`,
    `speeds_m_s` and `lengths_m` the speeds and strokes of the axes, `extra_W` any other power
    into the forcer.
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
        """Net heat flow into the forcer (W)."""
        loss = self.conductance_W_K * (self.temperature_C - self.air_C)
        return self.coil_W + self.extra_W - loss


@dataclass(frozen=True)
class Scene:
    """Conditions of a measurement, one value a sample: time, the other axis, temperatures."""

    time_s: Floats
    other_m: Floats
    temperature_C: Floats
    air_C: float


class ViewedRun(Protocol):
    """One run of an experiment; one that followed a logged command has no program."""

    @property
    def name(self) -> str: ...

    @property
    def program(self) -> Program | None: ...

    @property
    def payload_kg(self) -> float: ...


class ViewedReading(Protocol):
    """Samples of one sensor in one run: the sensor and the sample times (s)."""

    @property
    def sensor(self) -> Sensor: ...

    @property
    def time_s(self) -> Floats: ...


class View(Protocol):
    """The experiment that an effect is fitted to, and the predictions of the machine's model.

    Series are numbered in the order of the runs' readings, steady tables last.
    """

    @property
    def machine(self) -> Machine: ...

    @property
    def runs(self) -> Sequence[ViewedRun]: ...

    def own(self, name: str) -> Mapping[str, float]:
        """Parameters of the effect `name` in the machine file; empty if it has no such effect."""
        ...

    def positions(self) -> Mapping[int, tuple[int, ViewedReading]]:
        """Run number and reading of each series whose sensor measures position."""
        ...

    def schedule(self, index: int, /) -> Schedule:
        """Schedule of run `index`."""
        ...

    def targets(self, settings: Settings, /) -> Sequence[Floats]:
        """Each series, in its unit, from a sensor without distortion; errors in time remain."""
        ...

    def travel_m(self) -> tuple[float, float]:
        """Least and greatest position (m) at any position sensor."""
        ...


@dataclass(frozen=True)
class Toleranced:
    """The number of a machine file that an effect's parameter corrects.

    `key` is the file's `section.key`. The parameter is `middle` where the file's number is
    right, and differs by `scale` times the number's relative error, and by half as much for each
    of `roots`, numbers whose square root the parameter is in proportion to.
    """

    key: str
    middle: float
    scale: float
    roots: tuple[str, ...] = ()

    def reach(self, tolerance: Callable[[str], float]) -> float:
        """Largest deviation of the parameter (its unit), by each number's relative `tolerance`."""
        return self.scale * (tolerance(self.key) + sum(map(tolerance, self.roots)) / 2)


class Effect:
    """Base of all effects; the subclass' docstring states equation, units and source."""

    name: ClassVar[str]
    domain: ClassVar[Domain]
    parameters: ClassVar[tuple[Parameter, ...]]
    # Effects of one family look alike to many sensors.
    families: ClassVar[tuple[str, ...]] = ()
    # Terms of the equation of motion, composed into the kernel (see plant/kernel/effect_terms.py);
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
    # A simulation of many sets gives each set that has an effect of a group the whole group, at
    # neutral values, and compiles one kernel for all.
    kernel_group: ClassVar[str | None] = None
    # Acts after all others of its hook; else effects act in the catalogue's order.
    acts_last: ClassVar[bool] = False
    # Reason why it is no property of the machine; follows "not in the machine file: ".
    reservation: ClassVar[str | None] = None
    # It is one of the time since a run began, and says nothing of other runs.
    of_one_run: ClassVar[bool] = False
    # Its parameter that is a constant added to all readings of one sensor.
    constant_offset: ClassVar[str | None] = None
    # The tolerance of a sensor that allows sizes of it, which are relative.
    of_sensor: ClassVar[str | None] = None

    # An effect has no state: two objects of one class are one effect, and one kernel.
    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def parameter(self, name: str) -> Parameter:
        """Its parameter of that name; KeyError if it has none."""
        return {p.name: p for p in self.parameters}[name]

    def equation(self) -> str:
        """The docstring: description, equation, units and source."""
        return inspect.getdoc(type(self)) or ""

    @property
    def absent_at(self) -> tuple[tuple[int, float], tuple[int, float]] | None:
        """Places and nulls of its two sizes, at which one of a kernel group is absent.

        Of a single size twice the same; None for other numbers of sizes, or without a group.
        """
        amplitudes = ((i, p) for i, p in enumerate(self.parameters) if p.response is Role.AMPLITUDE)
        sizes = [(i, p.null) for i, p in amplitudes]
        return (sizes[0], sizes[-1]) if self.kernel_group and 1 <= len(sizes) <= 2 else None

    def neutral(self, machine: Machine) -> dict[str, float]:
        """The values at which the effect vanishes on `machine`."""
        return {p.name: p.null for p in self.parameters}

    # -- facts for a machine file and a diagnosis ---------------------------------

    @property
    def belongs_to_runs(self) -> bool:
        """True if a diagnosis may state it for the runs that it was fitted on alone."""
        return self.of_one_run or any(p.per_run for p in self.parameters)

    def stated_by(self, machine: Machine) -> tuple[float, ...] | None:
        """Values on a machine that states the effect outside of `[effects]`, else None."""
        return None

    def toleranced(self, machine: Machine) -> Toleranced | None:
        """The number of the machine file that the effect corrects, if any."""
        return None

    def fastest(self) -> tuple[float, ...] | None:
        """Plausible values at which a program takes least time; None if it gets no faster."""
        return None

    def static_deflection_m(self, machine: Machine) -> float:
        """Largest plausible deflection (m) of an axis at rest that is the same everywhere."""
        return 0.0

    @property
    def needs_temperature(self) -> bool:
        """True if it makes force or position depend on the temperature."""
        return type(self).force_factor is not Effect.force_factor

    @property
    def changes_program(self) -> bool:
        """True if it changes a program's statements, so that a logged command cannot show it."""
        return type(self).program is not Effect.program

    @property
    def changes_command(self) -> bool:
        """True if it changes the commanded position itself, as the drive receives it."""
        return type(self).command is not Effect.command

    # -- forms for the fit ----------------------------------------------------------

    def candidates(self, view: View) -> Iterator[Candidate]:
        """Its `forms`, in which each constant that it only assumes is fitted as well.

        That is one with a plausible range which the forms that hold it fix at one value, and the
        machine's file does not state. Held there, a wrong effect fits better than the true one, and
        its other numbers seem to be known better than they are.
        """
        forms = list(self.forms(view))
        assumed = [p for p in self.parameters if self._assumes(p, forms, view)]
        for form in forms:
            own = [p.assumed(form.fixed[p.name]) for p in assumed if p.name in form.fixed]
            fixed = {k: v for k, v in form.fixed.items() if k not in {p.name for p in own}}
            yield replace(form, parameters=(*form.parameters, *own), fixed=fixed)

    def _assumes(self, p: Parameter, forms: Sequence[Candidate], view: View) -> bool:
        if p.response is not Role.SHAPE or p.unit_of or p.name in view.own(self.name):
            return False
        fixed = {form.fixed[p.name] for form in forms if p.name in form.fixed}
        return p.plausible[0] != p.plausible[1] and len(fixed) == 1

    def forms(self, view: View) -> Iterator[Candidate]:
        """The forms in which it is fitted to the experiment of `view`.

        Unless overridden: each amplitude alone, and, extending that form, all amplitudes. The
        others are fixed at the machine's values, else at their nulls; reference temperatures
        are that of the air. `candidates` frees those of them that are only assumed.
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
            names = " and ".join(each.name for each in (p, *others))
            every = (each.tried() for each in (p, *others))
            yield self.form(*every, *angles, form=names, fixed=fixed, extends=p.name)

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
        """The amplitude `name` to fit from `starts`; see Parameter.fitted."""
        return self.parameter(name).fitted(*starts)

    # -- hooks: command ---------------------------------------------------------

    def program(self, program: Program, *p: float) -> Program:
        """The program as the controller executes it."""
        return program

    def schedule(self, schedule: Schedule, *p: float) -> Schedule:
        """The schedule as the controller executes it."""
        return schedule

    def command(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        """The command (m) of one axis at ascending times, where it was `x` (m)."""
        return x

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
        """(time in s, pitches) of each step by which the axis falls behind, for its `moves`."""
        return []

    # -- hooks: heat ------------------------------------------------------------

    def heat(self, here: Surroundings, *p: float) -> None:
        """Change the heat balance in place."""

    # -- hooks: measurement -----------------------------------------------------

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        """True times (s) of the samples labelled `time_s`."""
        return time_s

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """Position of the sensor's target (m) for the axis at `x` (m)."""
        return x

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """Output of the transducer (m) for its target at `x` (m)."""
        return x

    def bandwidth_s(self, quantity: Quantity, *p: float) -> float:
        """The time constant of a first-order lag of a sensor of `quantity`."""
        return 0.0

    def electronics(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        """Output of the electronics after the transducer, at the sample times."""
        return x

    @property
    def retimes(self) -> bool:
        """True if it changes the sample times, for any quantity."""
        return type(self).sampled_at is not Effect.sampled_at

    @property
    def distorts(self) -> bool:
        """True if it changes the values read of the target, and not only their times."""
        own = type(self)
        return own.reading is not Effect.reading or own.electronics is not Effect.electronics


@dataclass(frozen=True)
class Active:
    """An effect switched on: its parameters' values (SI) and the axes it acts on."""

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
    """The effects of `active` that act on `axis`."""
    return tuple(a for a in active if axis in a.axes)
