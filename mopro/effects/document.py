"""The catalogue as a page for people."""

from __future__ import annotations

from mopro.effects import OWN
from mopro.effects.base import Effect, Parameter

_STAGES = {
    "C": "Command: what the controller does before the drive sees it",
    "D": "Dynamics: forces, phase currents, the drive",
    "M": "Measurement: between the true position and what an instrument shows",
    "T": "Heat: what the heat balance leaves out",
}

_HEAD = """\
# Effects

Everything that a machine can do which the nominal model leaves out. A machine file
switches one on, with numbers in the unit given here or with another unit:

```toml
[effects.viscous_drag]
b = 9.0

[effects.current_loop_lag]
tau = { value = 120, unit = "us", origin = "measured", place = "bench" }
axes = [1]
```

In Python: `mopro.emulate(program, effects={"viscous_drag": {"b": 9.0}})`. What is not
stated has its default. A drive with `model = "full"` has voltage_saturation at its supply.
A package adds effects through the entry-point group `mopro.effects`, each a subclass of
`mopro.effects.Effect`.

This page is printed by `mopro machine effects`.
"""


def markdown() -> str:
    """The page: one section for each stage, one for each of mopro's own effects."""
    parts = [_HEAD]
    for stage, title in _STAGES.items():
        parts.append(f"\n## {title}\n")
        parts += [_section(kind()) for kind in OWN if kind.stage == stage]
    return "".join(parts)


def _section(effect: Effect) -> str:
    rows = "".join(map(_row, effect.parameters))
    head = "| parameter | unit | default | plausible | bounds | |\n|---|---|---|---|---|---|\n"
    family = f" Family: {', '.join(effect.families)}.\n" if effect.families else ""
    return f"\n### {effect.name}\n\n{effect.equation()}\n{family}\n{head}{rows}"


def _row(p: Parameter) -> str:
    plausible = f"{p.plausible[0]:g} to {p.plausible[1]:g}"
    bounds = f"{p.low:g} to {p.high:g}"
    return f"| `{p.name}` | {p.unit} | {p.default:g} | {plausible} | {bounds} | {p.meaning} |\n"
