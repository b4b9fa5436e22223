"""Runs of loops: what is repeated is what would have been simulated."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mopro
from mopro.emulator import Emulator
from mopro.machine import load_machine
from mopro.plant import Simulation
from mopro.recording import MemorySink

MACHINE = load_machine("chow1992")
TEMP2 = """UU012500/1
VEL0 15.0
ACC0 0.2
:B1
MR2 8.0
MR1 -8.0
GO
WX2
WX1
MR2 -8.0
MR1 8.0
GO
WX1
WX2
JUMP B1
"""


def run(text, for_s, monkeypatch, worth_s, **settings):
    """The recording of a run in which what lasts longer than `worth_s` is repeated."""
    monkeypatch.setattr("mopro.emulator.loop.WORTH_S", worth_s)
    emulator, sink = Emulator(MACHINE, **{"max_step_s": 2e-4, **settings}), MemorySink()
    program = mopro.compile(text)
    result = emulator.run(program, sink, for_s)
    return sink.recording(emulator.header(program), result)


def both(text, for_s, **settings):
    with pytest.MonkeyPatch.context() as patch:
        return (
            run(text, for_s, patch, np.inf, **settings),
            run(text, for_s, patch, 1.0, **settings),
        )


def check_alike(plain, looped):
    """Positions to 10 nm; a command may be on the other side of a microstep's edge."""
    assert len(plain) == len(looped)
    assert np.array_equal(plain["time_s"], looped["time_s"])
    assert np.array_equal(plain["temperature_C"], looped["temperature_C"])
    microstep_m = MACHINE.microstep_m
    for n in (1, 2):
        far = np.abs(plain[f"position_{n}_m"] - looped[f"position_{n}_m"]).max()
        assert far < 1e-8
        steps = np.abs(plain[f"command_{n}_m"] - looped[f"command_{n}_m"]) / microstep_m
        assert steps.max() < 1.001
    assert len(plain.run.moves) == len(looped.run.moves)
    for one, other in zip(plain.run.moves, looped.run.moves, strict=True):
        for field in dataclasses.fields(one):
            a, b = getattr(one, field.name), getattr(other, field.name)
            assert a == (pytest.approx(b, abs=1e-4) if isinstance(a, float) else b), field.name
    assert plain.run.duration_s == looped.run.duration_s
    assert len(plain.run.stalls) == len(looped.run.stalls)
    for one, other in zip(plain.run.stalls, looped.run.stalls, strict=True):
        assert other.time_s == pytest.approx(one.time_s, abs=1.1 / plain.header.rate_hz)


@st.composite
def loops(draw):
    """A loop of a few strokes there and back, with waits between them."""
    lines = ["UU012500/1"]
    for axis in (1, 2):
        lines += [
            f"VEL{axis} {draw(st.sampled_from([2, 4, 5, 8, 10, 20]))}.0",
            f"ACC{axis} {draw(st.sampled_from(['0.1', '0.2', '0.25']))}",
        ]
    first = draw(st.booleans())
    lines += ["MRI1 1.0", "WX1"] * first + [":B1"]
    strokes = draw(
        st.lists(st.tuples(st.integers(1, 2), st.integers(1, 6)), min_size=1, max_size=3)
    )
    for axis, length in [*strokes, *((axis, -length) for axis, length in strokes)]:
        lines += [f"MRI{axis} {length / 2}", f"WX{axis}"]
        wait = draw(st.sampled_from([0, 50, 200]))
        lines += [f"WT{wait}"] * bool(wait)
    return "\n".join([*lines, "JUMP B1", ""])


@settings(max_examples=8)
@given(
    text=loops(), rate_hz=st.sampled_from([400.0, 500.0]), payload_kg=st.sampled_from([0.0, 2.0])
)
def test_a_loop_is_repeated_as_it_would_be_simulated(text, rate_hz, payload_kg):
    check_alike(*both(text, 20.0, rate_hz=rate_hz, payload_kg=payload_kg))


# Of the drive, of the command (in ticks that a round is no multiple of), with a memory of the path,
# of the heat, and with losses at times of their own.
EFFECTS = {
    "hold_current_reduction": {}, "profile_tick": {}, "stribeck_friction": {},
    "force_constant_temperature": {}, "lost_steps": {}, "umbilical_spring": {},
}  # fmt: skip


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_repeated_or_simulated(name):
    check_alike(*both(TEMP2, 25.0, rate_hz=500.0, effects={name: EFFECTS[name]}))


def simulated_s(monkeypatch, text, for_s, rate_hz):
    """How much of a run (s) is simulated rather than repeated."""
    counts = []
    advance = Simulation.advance

    def counted(self, times, end_s):
        counts.append(len(times))
        return advance(self, times, end_s)

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "advance", counted)
        emulator = Emulator(MACHINE, rate_hz=rate_hz, max_step_s=2e-4)
        emulator.run(mopro.compile(text), MemorySink(most=1000), for_s)
    return sum(counts) / rate_hz


def test_of_an_hour_a_few_rounds_are_simulated(monkeypatch):
    # Three rounds are 3.65 s: a whole number of samples at 100 Hz, as one round is not.
    assert simulated_s(monkeypatch, TEMP2, 3600.0, 100.0) < 20.0


def test_a_motor_that_stalls_again_and_again_tells_of_each_time():
    plain, looped = both(TEMP2.replace("ACC0 0.2", "ACC0 3.0"), 20.0, rate_hz=500.0)
    check_alike(plain, looped)
    assert len(plain.run.stalls) > 20


def test_repeated_columns_cannot_be_changed_by_who_gets_them(monkeypatch):
    class Careless:
        def write(self, columns):
            columns["position_1_m"] += 1.0

    monkeypatch.setattr("mopro.emulator.loop.WORTH_S", 1.0)
    with pytest.raises(ValueError, match="read-only"):
        Emulator(MACHINE, rate_hz=100.0).run(mopro.compile(TEMP2), Careless(), 30.0)
