"""The diagnosis of a motor's experiment, without what follows from it."""

from dataclasses import dataclass

from mopro.effects import catalogue
from mopro.engine.verdict import Verdict
from mopro.experiment import conclusion
from mopro.experiment.sawyer.system import Sawyer
from mopro.experiment.sawyer.trials import Experiment


@dataclass(frozen=True)
class Diagnosis:
    """The verdict, and the variant of the motor that it is of."""

    system: Sawyer
    verdict: Verdict

    @property
    def resolved(self) -> bool:
        return self.system.resolved


def all_but(*names: str) -> frozenset[str]:
    """The names of all other effects of the catalogue: a search among few takes less time."""
    return frozenset(catalogue().keys() - set(names))


# The forces on an axis, which are told apart by little.
OTHER_THAN_FORCES = all_but(
    "viscous_drag", "quadratic_drag", "coulomb_friction", "stribeck_friction",
    "load_dependent_friction", "umbilical_spring", "constant_force", "detent_force",
)  # fmt: skip


def diagnose(experiment: Experiment, jobs: int = 1, left_out=()) -> Diagnosis:
    return Diagnosis(*conclusion.diagnose(Sawyer(experiment), jobs, left_out=left_out))
