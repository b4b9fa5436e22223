"""Draws the pictures of the pages: `python docs/pictures.py` writes docs/images/.

Each PNG holds the numbers that it shows as text; a test compares them with today's.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mopro
from mopro.experiment.comparison import Comparison
from mopro.plot.comparison import plot_comparison
from mopro.recording import Recording
from mopro.recording.envelope import Band
from mopro.recording.figure import BLACK, BLUE, VERMILLION, draw_band

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).parent
ROOT = DOCS.parent
IMAGES = DOCS / "images"
THERMAL = ROOT / "programs" / "thermal" / "experiment.toml"
_DPI = 75
_IN_M = 0.0254

Facts = dict[str, float]


def lvdt3() -> tuple[Recording, Facts]:
    """The run of LVDT3, and the numbers that its picture shows."""
    recording = mopro.emulate(mopro.compile_file(ROOT / "programs" / "LVDT3.CMD"))
    moves = recording.run.moves
    lags = [move.max_lag for move in moves]
    return recording, {"largest_lag_in": max(lags), "duration_s": recording.run.duration_s}


def draw_lvdt3(recording: Recording) -> Figure:
    """Position, speed and lag of the first second."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.6), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    seen = recording["time_s"] <= 1.0
    time_s = recording["time_s"][seen]
    lag = recording["command_1_m"] - recording["position_1_m"]
    for panel, values, label in (
        (panels[0], recording["position_1_m"], "position (in)"),
        (panels[1], recording["velocity_1_m_s"], "speed (in/s)"),
        (panels[2], lag, "lag (in)"),
    ):
        band = Band.of(time_s, values[seen] / _IN_M)
        draw_band(panel, band, label, {"color": BLUE, "linestyle": "-"})
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    panels[2].set_xlabel("time (s)")
    figure.suptitle("LVDT3.CMD, line 23: 15 in at 40 in/s, and the ringing after it", fontsize=11)
    return figure


def gap() -> tuple[tuple[Comparison, Comparison], Facts]:
    """The thermal table compared before and after its reconciliation."""
    before = mopro.open_experiment(THERMAL)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.toml"
        file.write_text(before.conclude().machine_text, "utf-8")
        after = mopro.open_experiment(THERMAL, str(file)).compare()
    compared = before.compare()
    return (compared, after), {"before_K": compared.series[0].rms, "after_K": after.series[0].rms}


def draw_gap(pair: tuple[Comparison, Comparison]) -> Figure:
    """The eight temperatures: measured, by theory, with the effects."""
    from matplotlib.figure import Figure

    before, after = (comparison.compared[0] for comparison in pair)
    measured = before.series.values
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    panel = figure.subplots()
    rows = range(1, len(measured) + 1)
    panel.bar(rows, measured - before.residual, width=0.7, color=VERMILLION, alpha=0.35,
              label="the theory of 1992")  # fmt: skip
    panel.bar(
        rows, measured - after.residual, width=0.4, color=BLUE, label="with two effects added"
    )
    panel.plot(rows, measured, "o", color=BLACK, label="measured")
    panel.set_xlabel("row of Table 3.2")
    panel.set_ylabel("temperature rise (K)")
    panel.set_xticks(list(rows))
    panel.grid(axis="y", alpha=0.3)
    panel.legend()
    sizes = [f"{comparison.series[0].rms:.3g} K" for comparison in pair]
    figure.suptitle(f"residual {sizes[0]} RMS before, {sizes[1]} after", fontsize=11)
    return figure


def hidden() -> tuple[tuple[Comparison, Comparison], Facts]:
    """The comparisons of docs/hide-and-find.md: before, and an unseen run after."""
    from mopro.cli.main import group

    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        _write_files(DOCS / "hide-and-find.md")
        with contextlib.redirect_stdout(io.StringIO()):
            for program, seed in (("strokes", 0), ("unseen", 5)):
                words = f"measure {program}.CMD --machine hidden.toml --instrument laser"
                end = f"--seed {seed} --out {program}.csv"
                group([*words.split(), *end.split()], standalone_mode=False)
        found = mopro.open_experiment("experiment.toml").compare()
        unseen = mopro.open_experiment("unseen.toml").compare()
        mended = mopro.open_experiment("unseen.toml", "hidden.toml").compare()
    facts = {"found_mm": found.series[0].rms, "mended_mm": mended.series[0].rms}
    return (found, unseen, mended), facts


def draw_found(comparisons: tuple[Comparison, ...]) -> Figure:
    return plot_comparison(comparisons[0], "experiment.toml on chow1992")


def draw_mended(comparisons: tuple[Comparison, ...]) -> Figure:
    _, before, after = comparisons
    return plot_comparison(after, "unseen.toml on the repaired machine", before)


# picture -> what it shows, and how it is drawn
PICTURES: dict[str, tuple[Any, Any]] = {
    "lvdt3.png": (lvdt3, draw_lvdt3),
    "gap.png": (gap, draw_gap),
    "gap-found.png": (hidden, draw_found),
    "gap-mended.png": (hidden, draw_mended),
}


def _write_files(page: Path) -> None:
    """Write the files that the fenced blocks of a page name."""
    text = page.read_text("utf-8")
    for file, content in re.findall(r"^```\w+ file=(\S+)\n(.*?)^```", text, re.M | re.S):
        Path(file).write_text(content, "utf-8")


def main() -> None:
    IMAGES.mkdir(exist_ok=True)
    made: dict[Any, Any] = {}
    for name, (make, draw) in PICTURES.items():
        content, facts = made.setdefault(make, None) or make()
        made[make] = content, facts
        figure = draw(content)
        note = json.dumps(facts)
        figure.savefig(IMAGES / name, dpi=_DPI, metadata={"Description": note, "Software": None})


if __name__ == "__main__":
    main()
