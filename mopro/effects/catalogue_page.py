"""The list of effects as Markdown, from the catalogue."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mopro.effects.effect import AXIS, Effect, Floats, Parameter, ViewedReading, ViewedRun
from mopro.effects.registry import own_effects
from mopro.engine.candidate import RUN, Candidate, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.engine.series import Settings
from mopro.machine import Machine, load_machine
from mopro.motion import Schedule, plan
from mopro.program import Program
from mopro.source import Source

_DOMAINS = {
    "C": "Command: the controller, before the drive",
    "D": "Dynamics: forces, phase currents, the drive",
    "M": "Measurement: between the true position and the reading of an instrument",
    "T": "Heat: terms beyond the nominal heat balance",
}
_EXAMPLE_MACHINE = "chow1992"
_EXAMPLE_TRAVEL_M = (0.0, 0.3)

_HEAD = f"""\
# Effects

Physical effects that the nominal model leaves out. A machine file switches one on, with
numbers in the unit given here or with a unit stated:

```toml
[effects.viscous_drag]
b = 9.0

[effects.current_loop_lag]
tau = {{ value = 120, unit = "us", origin = "measured", place = "bench" }}
axes = [1]
```

In Python: `mopro.emulate(program, effects={{"viscous_drag": {{"b": 9.0}}}})`. Parameters that
are not stated have their defaults. A drive with `model = "full"` has voltage_saturation with
the voltage of its supply. A package adds effects through the entry-point group
`mopro.effects`, each a subclass of `mopro.effects.Effect`; they are simulated, switched on and
fitted like those listed here. If an effect declares no `forms`, each of its amplitudes is
fitted alone and with the others; a parameter whose `null` is its default, and not 0, is a
shape and stays fixed.

An effect is fitted in one form or several. The parameters named are fitted within the range
given, here for one run on {_EXAMPLE_MACHINE}; the others are fixed. A form that extends another
is tried after that one has been found, unless it may come first. A free form can imitate many
other effects, and is accepted only if it leaves nothing unexplained. Where there are sensors
on both axes, effects of the measurement are also fitted on each axis alone.

This list is printed by `mopro machine effects`.
"""


@dataclass(frozen=True)
class _ProgrammedRun:
    program: Program | None
    payload_kg: float = 0.0
    name: str = "run"


@dataclass(frozen=True)
class _ExampleView:
    """A run without readings on a machine without effects, for listing the forms."""

    machine: Machine
    runs: Sequence[ViewedRun] = field(default=(_ProgrammedRun(Program((), Source("", ""))),))

    def own(self, name: str) -> Mapping[str, float]:
        return {}

    def positions(self) -> Mapping[int, tuple[int, ViewedReading]]:
        return {}

    def schedule(self, index: int, /) -> Schedule:
        program = self.runs[index].program
        assert program is not None, "the run has a program"
        return plan(program)

    def targets(self, settings: Settings, /) -> Sequence[Floats]:
        return []

    def travel_m(self) -> tuple[float, float]:
        return _EXAMPLE_TRAVEL_M


def markdown() -> str:
    """The page: one section for each domain, one for each of mopro's own effects."""
    parts, effects = [_HEAD], list(own_effects().values())
    view = _ExampleView(load_machine(_EXAMPLE_MACHINE))
    for domain, title in _DOMAINS.items():
        parts.append(f"\n## {title}\n")
        parts += [_section(e, effects, view) for e in effects if e.domain == domain]
    return "".join(parts)


def _section(effect: Effect, effects: Sequence[Effect], view: _ExampleView) -> str:
    rows = "".join(map(_row, effect.parameters))
    head = "| parameter | unit | default | plausible | bounds | |\n|---|---|---|---|---|---|\n"
    notes = [*_forms(effect, view), *_notes(effect, effects, view.machine)]
    ending = "".join(f"\n{note}\n" for note in notes)
    return f"\n### {effect.name}\n\n{effect.equation()}\n\n{head}{rows}{ending}"


def _row(p: Parameter) -> str:
    plausible = f"{p.plausible[0]:g} to {p.plausible[1]:g}"
    bounds = f"{p.low:g} to {p.high:g}"
    meaning = f"{p.meaning}, another in each run" if p.per_run else p.meaning
    return f"| `{p.name}` | {p.unit} | {p.default:g} | {plausible} | {bounds} | {meaning} |\n"


# -- forms --------------------------------------------------------------------------


def _forms(effect: Effect, view: _ExampleView) -> Iterator[str]:
    forms = list(effect.candidates(view))
    if not forms:
        yield "Not fitted."
    elif len(forms) == 1 and not forms[0].form:
        yield f"Fitted: {_form(forms[0])}."
    else:
        items = (f"- {form.form or 'plain'}: {_form(form)}" for form in forms)
        yield "Fitted:\n\n" + "\n".join(items)


def _form(form: Candidate) -> str:
    searched = " found by a search" if form.find_starts else ""
    parts = [", ".join(_fitted(p) for p in form.parameters) + searched]
    if form.extends is not None:
        extended = f"extends {form.extends or 'plain'}"
        parts.append(f"{extended}, or comes first" if form.can_enter_first else extended)
    if form.flexible:
        parts.append("a free form")
    return "; ".join(parts)


def _fitted(p: Fitted) -> str:
    if p.role is Role.SEARCHED:
        return f"`{p.name}`" + (" (the run that it happened in)" if p.name in (AXIS, RUN) else "")
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"`{p.name}` ({p.low:.3g} to {p.high:.3g}{unit})"


# -- notes --------------------------------------------------------------------------


def _notes(effect: Effect, effects: Sequence[Effect], machine: Machine) -> Iterator[str]:
    number = effect.toleranced(machine)
    if number is not None:
        halves = "".join(f" and half of that of {root}" for root in number.roots)
        yield f"A calibration, if within the machine file's tolerance of {number.key}{halves}."
    if effect.reservation is not None:
        yield f"Not in the machine file that a diagnosis writes: {effect.reservation}."
    if effect.belongs_to_runs:
        yield "In that file it belongs to the runs that it was fitted on, and is off in others."
    for family in effect.families:
        alike = [e.name for e in effects if family in e.families and e is not effect]
        yield f"Easily confused ({family}) with {', '.join(alike)}."
    if effect.constant_offset is not None:
        alike = [e.name for e in effects if e.static_deflection_m(machine)]
        yield f"If the same in all runs, easily confused with {', '.join(alike)}."
