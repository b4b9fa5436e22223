"""The answer at a glance as the strip on top of a page."""

from __future__ import annotations

from collections.abc import Iterable

from mopro.experiment.glance import Chain, Found, Glance
from mopro.markup import escaped, heading

_LABEL = "The answer at a glance"


def strip(glance: Glance) -> str:
    """The rows of the answer, each under its heading, for the head of the page."""
    rows = "\n".join(
        f'<div class="row">{heading(label)}<ul>{"".join(map(_item, lines))}</ul></div>'
        for label, lines in glance.rows()
    )
    return (
        f'<section class="glance {escaped(glance.verdict)}" aria-label="{_LABEL}">{rows}</section>'
    )


def _item(line: Found | Chain | str) -> str:
    """A line in the words of the terminal, with its subject and figures marked."""
    if isinstance(line, str):
        return f"<li>{escaped(line)}</li>"
    if isinstance(line, Found):
        first, last = line.sizes[:-1], line.sizes[-1:]
        return _about(line.effect, [*(f"{escaped(size)}," for size in first), *map(escaped, last)])
    steps = [f"{escaped(step.of)} <strong>{escaped(step.rms)}</strong>" for step in line.steps]
    return _about(line.sensor, [steps[0], *(f"→ {step}" for step in steps[1:])])


def _about(subject: str, told: Iterable[str]) -> str:
    """A line of parts, between which a narrow window breaks it, and not within one that fits."""
    parts = " ".join(f'<span class="part">{part}</span>' for part in told)
    return f"<li><strong>{escaped(subject)}</strong>: {parts}</li>"
