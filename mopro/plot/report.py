"""One self-contained HTML page for a run."""

from __future__ import annotations

import base64
import html
import io

from mopro.plot.picture import plot_recording
from mopro.recording import Recording, Run
from mopro.recording.table import MOVE_COLUMNS, move_cells, outcome

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; }}
table {{ border-collapse: collapse; }}
td, th {{ padding: .2rem .7rem; text-align: right; border-bottom: 1px solid #ddd; }}
img {{ max-width: 100%; }}
</style>
<h1>{title}</h1>
<p>{outcome}</p>
<table>
<tr>{head}</tr>
{rows}
</table>
<p><img alt="Position, velocity, following error, force, temperature" src="{picture}"></p>
<h2>How it was made</h2>
<table>
{header}
</table>
</html>
"""


def report_page(recording: Recording, run: Run) -> str:
    """The page: outcome, moves, picture and header of the run."""
    header = recording.header.as_json()
    return _PAGE.format(
        title=html.escape(f"{run.program} on {run.machine}"),
        outcome=html.escape(outcome(run)),
        head="".join(f"<th>{html.escape(c)}</th>" for c in MOVE_COLUMNS),
        rows="\n".join(_row(move_cells(move)) for move in run.moves),
        picture=_picture(recording),
        header="\n".join(_row([key, str(value)]) for key, value in header.items()),
    )


def _row(cells: list[str]) -> str:
    return f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in cells)}</tr>"


def _picture(recording: Recording) -> str:
    image = io.BytesIO()
    plot_recording(recording).savefig(image, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}"
