"""Whole runs: determinism, the compiled kernel, phase currents, stall, pieces, heat."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

import mopro
from mopro.emulator import Emulator
from mopro.errors import MoproError
from mopro.machine import load_machine
from mopro.machine.constants import PlantConstants
from mopro.motion import plan
from mopro.plant.heat import HeatHistory, heat_balance
from mopro.plant.simulation import compiling_pays
from mopro.program.compile import compile_file
from mopro.recording import MemorySink, column_names

SETUP = "UU012500/1\nVEL0 40.0\nACC0 {acc}\n"
FORTH_AND_BACK = "MRI1 15.0\nWX1\nWT500\nMRI1 -15.0\nWX1\nWT500\n"
MACHINE = load_machine("chow1992")


def emulate(body, acc="0.25", **options):
    return mopro.emulate(mopro.compile(SETUP.format(acc=acc) + body), **options)


@pytest.mark.parametrize(
    ("name", "profile", "peak", "duration_s"),
    [
        ("LVDT1", "trapezoid", 40, 15 / 40 + 40 / 250),
        ("LVDT2", "triangle", math.sqrt(1500), 2 * math.sqrt(0.15)),
        ("LVDT3", "smooth", 40, 15 / 40 + 4 * 40 / 1800),
        ("LVDT4", "parabola", math.sqrt(22500) / 4, math.sqrt(90 / 250)),
    ],
)
def test_lvdt_programs_have_the_shapes_peaks_and_times_of_table_4_5(
    name, profile, peak, duration_s, programs_folder
):
    run = mopro.emulate(compile_file(programs_folder / f"{name}.CMD")).run
    assert [m.profile for m in run.moves] == [profile] * 2
    assert [m.distance for m in run.moves] == [15.0, -15.0]
    for move in run.moves:
        assert move.peak_velocity == pytest.approx(peak, rel=1e-12)
        assert move.duration_s == pytest.approx(duration_s, abs=1e-9)
        assert move.max_lag < 0.01
        assert 0.3 < move.stall_margin < 1
    assert run.duration_s == pytest.approx(2 * duration_s + 2, abs=1e-9)
    assert not run.stalled


def test_a_run_can_be_repeated_bit_by_bit_and_compiled_or_not():
    def once(compiled):
        return emulate(FORTH_AND_BACK, compiled=compiled).columns

    plain, again, built = once(False), once(False), once(True)
    for name, values in plain.items():
        assert np.array_equal(values, again[name]), name
        assert np.array_equal(values, built[name]), name


def test_long_work_is_compiled_and_short_work_is_not(programs_folder):
    temp1 = compile_file(programs_folder / "TEMP1.CMD")
    lvdt3 = compile_file(programs_folder / "LVDT3.CMD")
    step_s = Emulator(MACHINE).max_step_s
    assert compiling_pays(plan(temp1, 60.0), step_s)
    assert not compiling_pays(plan(lvdt3), step_s)


def test_chunks_do_not_show_in_the_recording(monkeypatch):
    whole = emulate(FORTH_AND_BACK)
    monkeypatch.setattr("mopro.emulator.backend._CHUNK", 100)
    chunks = emulate(FORTH_AND_BACK)
    for name, values in whole.columns.items():
        assert np.allclose(values, chunks[name], rtol=0, atol=1e-12), name
    assert whole.run.moves[0].max_lag == pytest.approx(chunks.run.moves[0].max_lag, rel=1e-9)


def test_columns_are_those_of_the_contract():
    recording = emulate("MRI1 1.0\nWX1\n")
    assert list(recording.columns) == column_names([1, 2])
    assert {len(v) for v in recording.columns.values()} == {len(recording)}
    assert np.array_equal(recording["time_s"], np.arange(len(recording)) / 2000)


def test_phase_currents_turn_by_whole_microsteps():
    recording = emulate("MRI1 1.0\nWX1\n")
    a, b = recording["phase_a_1_A"], recording["phase_b_1_A"]
    assert np.allclose(a**2 + b**2, 16.0, rtol=1e-12)
    turns = np.unwrap(np.arctan2(b, a)) / (2 * math.pi)
    microsteps = turns * 500
    assert np.allclose(microsteps, np.rint(microsteps), atol=1e-6)
    assert microsteps[-1] * 2.032e-6 == pytest.approx(recording["command_1_m"][-1], abs=1e-12)


def test_force_is_what_accelerates_the_mass():
    recording = emulate("MRI1 15.0\nWX1\n")
    speed = recording["velocity_1_m_s"]
    impulse = trapezoid(recording["force_1_N"], recording["time_s"])
    c_s = MACHINE.axis.drive_damping_N_s_m
    lag = recording["command_1_m"] - recording["position_1_m"]
    momentum = MACHINE.axis.moving_mass_kg * speed[-1] - c_s * (lag[-1] - lag[0])
    assert impulse == pytest.approx(momentum, abs=0.01)


def test_the_source_line_of_each_sample():
    recording = emulate("MRI1 15.0\nWX1\nWT500\nMRI2 1.0\nWX2\n")
    seen, first = np.unique(recording["line"], return_index=True)
    assert seen.tolist() == [4, 6, 7]
    assert recording["time_s"][first] == pytest.approx([0.0, 0.535, 1.035], abs=6e-4)


class TestStall:
    def test_too_much_acceleration_stalls_and_says_by_how_much(self):
        recording = emulate(FORTH_AND_BACK, acc="1.3")
        forth, back = recording.run.moves
        assert recording.run.stalled
        assert forth.slipped
        assert forth.stall_margin == 0
        settled = np.searchsorted(recording["time_s"], back.start_s) - 1
        behind = recording["command_1_m"][settled] - recording["position_1_m"][settled]
        assert forth.lost_pitches == round(behind / MACHINE.axis.pitch_m) != 0
        end = recording["command_1_m"][-1] - recording["position_1_m"][-1]
        assert forth.lost_pitches + back.lost_pitches == round(end / MACHINE.axis.pitch_m)

    def test_the_threshold_is_the_undamped_pull_out(self):
        """0.7246 F0/m, for damping too small to matter within one swing."""
        machine = replace(MACHINE, axis=replace(MACHINE.axis, damping_ratio=1e-6))
        pull_out_in_s2 = machine.axis.pull_out_force_N / machine.axis.moving_mass_kg / 0.0254
        for share, stalls in ((0.724, False), (0.7255, True)):
            acc = f"{share * pull_out_in_s2 / 1000:.6f}"
            start = emulate("VEL1 60.0\nMRI1 15.0\nWX1\n", acc=acc, machine=machine, for_s=0.04)
            assert start.run.stalled == stalls

    def test_a_light_load_has_margin_and_a_heavy_one_less(self):
        margins = [
            emulate("MRI1 15.0\nWX1\n", acc="0.5", payload_kg=kg).run.moves[0].stall_margin
            for kg in (0.0, 0.5, 1.0)
        ]
        assert margins == sorted(margins, reverse=True)

    def test_steady_margin_is_what_is_left_of_the_static_force(self):
        """A parabola's peak demand comes once at each end: lag within its quarter pitch."""
        move = emulate("MRI1 1.0\nWX1\n", acc="0.05").run.moves[0]
        k = MACHINE.axis.wave_number_1_m
        assert move.stall_margin == pytest.approx(1 - math.sin(k * move.max_lag * 0.0254))


class TestEnds:
    def test_a_loop_runs_a_minute_unless_told_otherwise(self):
        recording = emulate(":B1\nMRI1 1.0\nWX1\nMRI1 -1.0\nWX1\nJUMP B1\n", rate_hz=100.0)
        assert recording.run.duration_s == 60.0
        assert recording.run.loops_forever
        assert len(recording) == 6001

    def test_a_move_cut_short_is_marked(self):
        run = emulate("MRI1 15.0\nWX1\n", for_s=0.2).run
        assert (run.complete, run.moves[0].complete, run.stalled) == (False, False, False)

    def test_ten_thousand_rounds_end_on_the_microstep(self):
        program = mopro.compile(
            "UU012500/3\nVEL0 40.0\nACC0 0.25\n:B1\nMRI1 0.1\nWX1\nWT1\nJUMP B1\n"
        )
        last = plan(program, 600.0).moves[9_999]
        platen = replace(MACHINE.platen, length_m=20.0)
        recording = mopro.emulate(
            program, replace(MACHINE, platen=platen), for_s=last.end_s + 0.001, rate_hz=2000.0
        )
        assert len(recording.run.moves) == 10_000
        microsteps = recording["command_1_m"][-1] / MACHINE.microstep_m
        assert microsteps == pytest.approx(4_166_667, abs=1e-6)
        assert not recording.run.stalled
        assert recording["position_1_m"][-1] == pytest.approx(
            recording["command_1_m"][-1], abs=MACHINE.axis.pitch_m / 4
        )

    def test_a_program_without_motion_is_a_recording_of_rest(self):
        recording = emulate("WT100\n")
        assert not recording.run.moves
        assert not recording["position_1_m"].any()
        assert len(recording) == 201

    def test_a_recording_too_long_to_keep_is_refused(self):
        with pytest.raises(MoproError, match="expected at most"):
            emulate("WT999999999\n")

    def test_its_settling_counts(self):
        emulator = Emulator(MACHINE, rate_hz=1e9)
        with pytest.raises(MoproError, match=r"0\.501 s at 1e\+09 Hz are 5\.01e\+08 samples"):
            emulator.run(mopro.compile("WT1\n"), MemorySink(), settle_s=0.5)


def test_user_units_of_a_millimetre_are_named():
    program = mopro.compile("UU062500/127\nVEL1 100.0\nACC1 1.0\nMRI1 10.0\nWX1\n")
    move = mopro.emulate(program).run.moves[0]
    assert (move.unit, move.distance) == ("mm", 10.0)


def test_payload_leaves_the_drive_constant_alone():
    bare, laden = (PlantConstants.of(MACHINE, kg) for kg in (0.0, 2.543))
    assert laden.damping_1_s == pytest.approx(bare.damping_1_s / 2)
    assert laden.pull_out_m_s2 == pytest.approx(bare.pull_out_m_s2 / 2)


class TestHeat:
    # Table 3.2: velocity (in/s), moving axes, travelled length (in), theory column (K).
    ROWS = (
        (0, 0, 0, 76.5517), (3.5, 1, 8, 66.9469), (3.5, 1, 16, 47.3386), (15, 1, 16, 43.5173),
        (24, 1, 16, 41.7483), (24 * 2**0.5, 2, 8 * 2**0.5, 48.5993), (24, 1, 8, 59.0410),
    )  # fmt: skip

    @pytest.mark.parametrize(("velocity", "axes", "length", "theory"), ROWS)
    def test_final_rise_is_that_of_table_3_2(self, velocity, axes, length, theory):
        balance = heat_balance(MACHINE, axes, velocity * 0.0254, length * 0.0254)
        assert balance.rise_K == pytest.approx(theory, rel=1e-3)

    def test_temperature_follows_the_balance_through_moves_and_rests(self):
        """Against the heat equation stepped by hand."""
        program = mopro.compile(
            SETUP.format(acc="0.25") + ":B1\nMRI1 15.0\nWX1\nWT300\nMRI1 -15.0\nWX1\nJUMP B1\n"
        )
        moves = plan(program, 20.0).moves
        times = np.arange(0, 20.0, 1e-3)
        found = HeatHistory(MACHINE, moves).temperature_C(times)
        capacity = MACHINE.axis.moving_mass_kg * MACHINE.heat.specific_heat_J_kg_K
        rest = heat_balance(MACHINE, 0, 0, 0)
        moving = heat_balance(MACHINE, 1, 40 * 0.0254, 15 * 0.0254)
        T = ambient = MACHINE.heat.ambient_C
        for i, t in enumerate(times):
            assert found[i] == pytest.approx(T, abs=2e-5)
            under_way = any(m.start_s <= t < m.end_s for m in moves)
            now = moving if under_way else rest
            T += 1e-3 * (now.power_W - now.conductance_W_K * (T - ambient)) / capacity


def test_memory_sinks_thin_what_is_too_much():
    sink, kept = MemorySink(most=100), MemorySink()
    for start in range(0, 1000, 37):
        piece = np.arange(start, min(start + 37, 1000))
        sink.write({"time_s": piece})
        kept.write({"time_s": piece})
    header = Emulator(MACHINE).header(mopro.compile("GO"))
    thin = sink.recording(header)["time_s"]
    assert len(thin) <= 100
    assert np.array_equal(thin, kept.recording(header)["time_s"][:: thin[1]])


STALLS = "UU012500/1\nVEL1 40.0\nACC1 25.0\nMRI1 5.0\nWX1\n"


class TestSettling:
    """Recordings that go on after the last move."""

    def test_ringing_is_recorded_and_the_run_stays_the_same(self):
        program = mopro.compile("UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 8.0\nWX1\n")
        short, long = mopro.emulate(program), mopro.emulate(program, settle_s=0.5)
        assert long.run == short.run
        assert long.header == short.header
        for name, values in short.columns.items():
            assert np.array_equal(long[name][: len(short)], values), name
        ended_s = long.run.moves[0].start_s + long.run.moves[0].duration_s
        assert long["time_s"][-1] == pytest.approx(ended_s + 0.5, abs=1e-3)
        after = long["position_1_m"][len(short) :] - long["command_1_m"][len(short) :]
        assert np.abs(after[:50]).max() > 10 * np.abs(after[-50:]).max()

    def test_a_program_that_waits_long_enough_is_not_lengthened(self):
        program = mopro.compile("UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 8.0\nWX1\nWT600\n")
        assert len(mopro.emulate(program, settle_s=0.5)) == len(mopro.emulate(program))

    @pytest.mark.parametrize("for_s", [0.2, 3.0])
    def test_what_is_cut_is_not_lengthened(self, programs_folder, for_s):
        program = compile_file(programs_folder / "TEMP1.CMD")
        assert mopro.emulate(program, for_s=for_s, settle_s=0.5)["time_s"][-1] <= for_s

    def test_a_stall_is_marked_and_the_recording_agrees_with_the_table(self):
        recording = mopro.emulate(mopro.compile(STALLS), settle_s=0.5)
        (move,), (stall,) = recording.run.moves, recording.run.stalls
        assert (stall.line, stall.axis, stall.lost_pitches) == (4, 1, move.lost_pitches)
        lag_m = recording["command_1_m"] - recording["position_1_m"]
        pitch_m = 1.016e-3
        first_s = recording["time_s"][np.argmax(np.abs(lag_m) > pitch_m / 2)]
        assert stall.time_s == pytest.approx(first_s, abs=1e-3)
        assert round(lag_m[-1] / pitch_m) == move.lost_pitches != 0
        assert abs(lag_m[-1] - move.lost_pitches * pitch_m) < pitch_m / 10
        told = {"time_s": stall.time_s, "line": 4, "axis": 1, "lost_pitches": move.lost_pitches}
        assert recording.header.stalls == recording.run.as_json()["stalls"] == [told]

    def test_an_axis_that_slips_on_is_recorded_until_it_is_caught(self):
        program = mopro.compile(STALLS)
        recording = mopro.emulate(program, settle_s=0.001)
        assert recording["time_s"][-1] > recording.run.duration_s + 0.002
        lag_m = recording["command_1_m"][-1] - recording["position_1_m"][-1]
        assert round(lag_m / 1.016e-3) == recording.run.moves[0].lost_pitches

    def test_progress_is_told(self):
        heard = []
        program = mopro.compile("UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 8.0\nWX1\nWT50000\n")
        emulator = Emulator(load_machine("chow1992"))
        run = emulator.run(program, MemorySink(), on_progress=heard.append)
        assert len(heard) >= 2
        assert heard[-1].total_s == run.duration_s
        assert heard[-1].time_s == pytest.approx(run.duration_s, abs=1e-3)
        assert heard[-1].line == 6
        assert heard[-1].position_m[1] == pytest.approx(8 * 0.0254, abs=1e-6)
