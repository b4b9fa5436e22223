"""The table of a run's ends as docs/link.md shows it, from the one that the host uses."""

from mopro.link.course import TABLE, Awaited, Entry, Step
from mopro.link.dialect import STATES

_WORDS = {Step.GO_ON: "go on", Step.END: "**end**", Step.STOP: "**stop, then end**"}


def _words(entry: Entry) -> str:
    return _WORDS[entry] if isinstance(entry, Step) else "trouble"


def rows() -> list[str]:
    """The lines of the table, in Markdown; `before / at` its time where these differ."""
    heads = [awaited.value for awaited in Awaited]
    lines = [f"| state | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    for state in STATES:
        cells = []
        for awaited in Awaited:
            early, due = map(_words, TABLE[awaited][state])
            cells.append(early if early == due else f"{early} / {due}")
        lines.append(f"| {state} | {' | '.join(cells)} |")
    return lines
