"""The diagnosis of a motor's experiment, without what follows from it."""

from dataclasses import dataclass

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


def diagnose(experiment: Experiment, jobs: int = 1, left_out=()) -> Diagnosis:
    return Diagnosis(*conclusion.diagnose(Sawyer(experiment), jobs, left_out=left_out))
