"""Random programs, judged by lint and run by the emulator: where do the two disagree?"""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass

import mopro
from mopro.lint import Settings
from mopro.lint.check import subject_of
from mopro.source import Source

SAFE_MARGIN = 0.05


@dataclass(frozen=True)
class Verdict:
    """Agreement of lint with the emulator on one program, at its payload (kg)."""

    text: str
    payload_kg: float
    outcome: str


def random_program(random: random.Random) -> str:
    """A few moves about the threshold of stall: alone or together, at once or after a rest."""
    lines = ["UU012500/1"]
    for axis in (1, 2):
        lines.append(f"VEL{axis} {random.choice((2.0, 10.0, 20.0, 40.0, 60.0))}")
        lines.append(f"ACC{axis} {random.uniform(0.05, 1.6):.3f}")
        lines.append(f"PARA{axis}{random.choice('+-')}")
    for _ in range(random.randint(1, 4)):
        distance = random.choice((-1, 1)) * random.choice((0.02, 0.2, 1.0, 4.0, 8.0))
        if random.random() < 0.3:
            share = random.choice((1.0, 0.5, 0.1))
            lines += [f"MR1 {distance}", f"MR2 {-distance * share:.5f}", "GO", "WX1", "WX2"]
        else:
            axis = random.choice((1, 2))
            lines += [f"MRI{axis} {distance}", f"WX{axis}"]
        if random.random() < 0.5:
            lines.append(f"WT{random.choice((1, 5, 20, 100, 500))}")
    return "\n".join(lines) + "\n"


def judge(text: str, payload_kg: float) -> Verdict:
    """Compare program by program, up to the first stall: after it nothing is as it was."""
    subject = subject_of(Source("random.CMD", text), Settings(payload_kg=payload_kg))
    margins = subject.stall_margins.each
    assert not subject.stall_margins.unchecked
    run = mopro.emulate(subject.program, payload_kg=payload_kg, rate_hz=50.0, compiled=True).run
    stalled = next((move.line for move in run.moves if move.slipped), None)
    called = min((s.move.span.line for s in margins if s.slips), default=None)
    passed = min(s.margin for s in margins) >= SAFE_MARGIN
    if called is not None:
        outcome = "stall, stalls" if stalled == called else "stall, does not"
    elif passed:
        outcome = "safe, stalls" if stalled else "safe, does not"
    else:
        outcome = "margin below 5 %"
    return Verdict(text, payload_kg, outcome)


def agreement(count: int, seed: int) -> tuple[Counter[str], list[Verdict]]:
    """Counts of the outcomes of `count` random programs, and the disagreements."""
    source = random.Random(seed)
    verdicts = [
        judge(random_program(source), source.choice((0.0, 0.0, 1.0, 2.268))) for _ in range(count)
    ]
    wrong = [v for v in verdicts if v.outcome in ("stall, does not", "safe, stalls")]
    return Counter(v.outcome for v in verdicts), wrong
