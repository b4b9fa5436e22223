"""One self-contained HTML page for a run."""

from __future__ import annotations

from mopro.plot.page import heading, page, paragraph, picture, table
from mopro.recording import Recording, Run
from mopro.recording.moves import MOVE_COLUMNS, move_cells
from mopro.recording.run import outcome


def report_page(recording: Recording, run: Run) -> str:
    """The page: outcome, moves, picture and header of the run."""
    header = recording.header.as_json()
    return page(
        f"{run.program} on {run.machine}",
        [
            paragraph(outcome(run)),
            table("Moves", MOVE_COLUMNS, map(move_cells, run.moves)),
            picture(recording.plot(), "Position, velocity, following error, force, temperature"),
            heading("Provenance"),
            table("The recording", (), ([key, str(value)] for key, value in header.items())),
        ],
    )
