"""Text of a repaired machine file: what came in, with numbers and effects in their places."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from mopro.formula.written import WrittenEffect, toml_lines
from mopro.machine.run_effects import RUNS
from mopro.tomlfile.edit import Text, quoted

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def with_effects(
    text: Text,
    own: Sequence[WrittenEffect],
    formulas: Sequence[WrittenEffect],
    sections: Mapping[str, Sequence[str]],
) -> str:
    """The file `text` with effects, each by its name with the lines of its section.

    `own`: the effects that the file states as formulas, in their order. `formulas`: those that it
    must state; they take the place of its own ones of the same names.
    """
    stated = [toml_lines(effect) for effect in own]
    wanted = [toml_lines(effect) for effect in formulas]
    names = {effect.name for effect in formulas}
    for name in sections:
        text = text.without("effects", name)
    for nth, (effect, lines) in enumerate(zip(own, stated, strict=True)):
        if effect.name in names and lines not in wanted:
            text = text.without("effect", nth)
    parts = [str(text), *("\n".join(lines) for lines in wanted if lines not in stated)]
    parts += ["\n".join([heading(name), *lines]) for name, lines in sections.items()]
    return "\n\n".join(parts) + "\n"


def heading(name: str) -> str:
    """The heading of the section that switches an effect on."""
    return f"[effects.{name if _BARE.fullmatch(name) else quoted(name)}]"


def runs_lines(runs: Mapping[str, str]) -> Iterator[str]:
    """The line of an effect's section with the `runs` that it belongs to, if there are any."""
    if runs:
        stated = ", ".join(f"{quoted(file)} = {quoted(sum_)}" for file, sum_ in runs.items())
        yield f"{RUNS} = {{ {stated} }}  # data files and their CRC-32; off in all other runs"


def rounded(value: float) -> float:
    """The value with eight digits: more than any data determine, the same on every platform."""
    return float(f"{value:.8g}")
