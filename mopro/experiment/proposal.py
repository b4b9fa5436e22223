"""The experiment that would tell rivals apart."""

from __future__ import annotations

from dataclasses import dataclass

from mopro.diagnosis import Verdict
from mopro.experiment.model import Experiment


@dataclass(frozen=True)
class Proposal:
    """A program to run, and by how many σ it separates each pair of rivals."""

    text: str
    summary: str
    separations: dict[str, float]


def propose(experiment: Experiment, verdict: Verdict) -> Proposal | None:
    """None until there is a search for one."""
    return None
