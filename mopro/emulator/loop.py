"""The samples of a loop: simulated until they repeat themselves, and from there on repeated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mopro.plant import Repetition, Simulation
from mopro.recording.record import Columns

# What is repeated must be this long (s): a run below twice as much is simulated as it stands.
WORTH_S = 60.0
# Columns that go on while the motion repeats itself.
_CLOCK, _HEAT = "time_s", "temperature_C"


class Loop:
    """Takes a `simulation` through the repetition of its program, in chunks of samples.

    `samples` is how many have been given. The repeated columns of a chunk are views of arrays that
    all chunks share.
    """

    def __init__(self, simulation: Simulation, repetition: Repetition) -> None:
        self._simulation, self._repetition = simulation, repetition
        self.samples = 0
        # A move that the end of the run cuts off is simulated from its beginning.
        moves = simulation.schedule.moves
        longest_s = max(move.profile.duration_s for move in moves)
        self._until_s = simulation.schedule.duration_s - longest_s

    def chunks(self, most: int) -> Iterator[Columns]:
        """The samples up to the end of what can be repeated, up to `most` at once."""
        repetition, simulation = self._repetition, self._simulation
        yield from self._simulated(repetition.first, most)
        agreed = 0
        while self._left() * repetition.period_s > WORTH_S:
            before = simulation.state()
            stretch = list(self._simulated(self.samples + repetition.samples, most))
            yield from stretch
            agreed = agreed + 1 if simulation.repeats(before, repetition.period_s) else 0
            # The moves of the first that agreed have ended in the second.
            if agreed > 1:
                yield from self._repeated(_together(stretch), most)

    def _left(self) -> int:
        """The stretches that may be repeated."""
        return self._repetition.stretches(self.samples, self._until_s)

    def _simulated(self, end: int, most: int) -> Iterator[Columns]:
        """The samples before the sample `end`."""
        for times in self._times(end, most):
            yield self._simulation.advance(times, float(times[-1]))

    def _repeated(self, stretch: Columns, most: int) -> Iterator[Columns]:
        """The samples of all that is left, as those of the `stretch` simulated last."""
        count, length = self._left(), self._repetition.samples
        first = self.samples
        copies = -(-most // length) + 1
        endless = {name: _kept(np.tile(values, copies)) for name, values in stretch.items()}
        times = np.zeros(0)
        for times in self._times(first + count * length, most):
            begin = (self.samples - first - len(times)) % length
            columns = {n: values[begin : begin + len(times)] for n, values in endless.items()}
            yield columns | {_CLOCK: times, _HEAT: self._simulation.temperature_C(times)}
        self._simulation.skip(self._repetition.period_s, count, float(times[-1]))

    def _times(self, end: int, most: int) -> Iterator[NDArray[np.float64]]:
        """The times of the samples before the sample `end`."""
        while self.samples < end:
            first, self.samples = self.samples, min(self.samples + most, end)
            yield np.arange(first, self.samples) / self._repetition.rate_hz


def loop_of(simulation: Simulation, rate_hz: float) -> Loop | None:
    """The loop of a run whose samples are at `rate_hz`; None if none is worth repeating."""
    if simulation.schedule.duration_s < 2 * WORTH_S:
        return None
    repetition = simulation.repetition(rate_hz)
    return None if repetition is None else Loop(simulation, repetition)


def _together(chunks: list[Columns]) -> Columns:
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]}


def _kept(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """`values`, which nobody can change."""
    values.flags.writeable = False
    return values
