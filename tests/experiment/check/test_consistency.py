"""Data that cannot be of their run are refused; a machine that behaves oddly is not."""

import numpy as np
import pytest

from helpers.laboratory import LASER
from mopro.errors import ModelError, MotionError
from mopro.experiment.steps import step_note
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor

BOTH = "UU012500/1\nVEL0 6.0\nACC0 0.1\nMRI1 2.0\nWX1\nMRI2 1.0\nWX2\nMRI1 -2.0\nWX1\nWT300\n"


def refusal(lab, kind=ModelError):
    with pytest.raises(kind) as caught:
        lab.load()
    return caught.value.render()


def scaled(lab, factor, name="fast.csv", column="position_1_in"):
    rows = lab.path(name).read_text().splitlines()[1:]
    rows = [f"{t},{float(x) * factor!r}" for t, x in (row.split(",") for row in rows)]
    lab.write(name, "\n".join([f"time_s,{column}", *rows]) + "\n")


# -- what is refused ----------------------------------------------------------------


def test_two_swapped_programs_are_both_named(lab):
    path = lab.two_runs()
    text = path.read_text()
    swapped = text.replace("fast.CMD", "X").replace("slow.CMD", "fast.CMD")
    path.write_text(swapped.replace('"X"', '"slow.CMD"'))
    text = refusal(lab)
    assert "e.toml:13:1: two runs seem to be swapped: fast.csv fits fast.CMD far better" in text
    assert "than slow.CMD, and slow.csv the other way round [swapped]" in text


def test_swapped_programs_are_found_among_many_and_under_a_coarse_sensor(lab):
    lab.write("mid.CMD", "UU012500/1\nVEL1 8.0\nACC1 0.1\nMRI1 3.0\nWX1\nWT300\n")
    coarse = [Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 0.025)]
    for name in ("fast", "slow", "mid"):
        lab.record(f"{name}.CMD", f"{name}.csv", sensors=coarse)
    pairs = [("fast", "fast"), ("slow", "mid"), ("mid", "slow")]
    lab.experiment([f'program = "{p}.CMD"\ndata = "{d}.csv"' for p, d in pairs])
    text = refusal(lab)
    assert "mid.csv fits mid.CMD far better than slow.CMD" in text
    assert "fast.csv" not in text


@pytest.mark.parametrize(
    ("factor", "unit"), [(25.4, "mm"), (25400.0, "um"), (0.0254, "m"), (2.54, "cm")]
)
def test_values_in_another_unit_than_their_column_says(lab, factor, unit):
    lab.two_runs()
    scaled(lab, factor)
    text = refusal(lab)
    assert "e.toml:13:1: fast.csv: position_1_in goes" in text
    assert f"the data seem to be in {unit}, not in in [mixed-units]" in text
    assert "units are not guessed" in text
    assert "slow.csv" not in text


@pytest.mark.parametrize(("factor", "said"), [(2.0, "2"), (0.5, "1/2"), (4.0, "4"), (0.25, "1/4")])
def test_values_that_are_twice_or_four_times_as_large(lab, factor, said):
    lab.two_runs()
    scaled(lab, factor)
    text = refusal(lab)
    assert "times as far as fast.CMD commands: a factor of" in text
    assert f"a factor of {said}, such as" in text
    assert "[wrong-scale]" in text


@pytest.mark.parametrize(("noise", "told"), [(1e-4, True), (0.01, False), (None, False)])
def test_readings_of_a_step_that_is_not_stated_are_told(noise, told):
    rng = np.random.default_rng(0)
    values = 1e-3 * np.rint(1e3 * np.sin(np.arange(4000) / 500) + rng.normal(size=4000))
    note = step_note("laser", "in", values, 1e-3 if noise is None else 0.0, noise)
    wanted = "laser: every reading is a multiple of 0.001 in: state adc_step = 0.001"
    assert note == (wanted if told else None)


def test_data_that_go_the_other_way(lab):
    lab.two_runs()
    scaled(lab, -1.0)
    assert "fast.csv: position_1_in goes the other way than fast.CMD commands" in refusal(lab)


def test_data_of_the_other_axis(lab):
    lab.program("both.CMD", BOTH)
    other = [Sensor("laser", POSITION, "position_2_in", 2000.0, 2, 2e-5)]
    lab.record("both.CMD", "both.csv", sensors=other)
    scaled(lab, 1.0, "both.csv")
    lab.experiment(['program = "both.CMD"\ndata = "both.csv"'])
    text = refusal(lab)
    assert "both.csv: position_1_in follows the command of axis 2" in text
    assert "sensor laser is said to be on axis 1 [wrong-axis]" in text


def test_data_shorter_than_the_program_says_both_durations(lab):
    path = lab.two_runs()
    rows = lab.path("fast.csv").read_text().splitlines()
    lab.write("fast.csv", "\n".join(rows[:1502]) + "\n")
    text = refusal(lab)
    assert "e.toml:13:1: fast.csv ends after 0.75 s, and fast.CMD takes 1.21667 s" in text
    assert "[data-too-short]" in text
    path.write_text(path.read_text().replace('"fast.csv"', '"fast.csv"\npartial = true'))
    assert lab.load().trials[0].partial


def test_a_program_that_stalls_is_named_with_its_line(lab):
    lab.record("fast.CMD", "fast.csv")
    lab.program("fast.CMD", "UU012500/1\nVEL1 15.0\nACC1 3.0\nMRI1 2.0\nWX1\nWT100\n")
    lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"'])
    text = refusal(lab, MotionError)
    assert "fast.CMD:4:1: when simulated, axis 1 stalled here: it " in text
    assert "[stall]" in text


def test_a_program_that_runs_into_a_limit_switch(lab):
    lab.program("far.CMD", "UU012500/1\nVEL1 15.0\nACC1 0.2\nMRI1 60.0\nWX1\n")
    t = np.arange(0, 4.2, 0.0005)
    lab.csv("far.csv", {"time_s": t, "position_1_in": np.clip(15 * t, 0, 60)})
    lab.experiment(['program = "far.CMD"\ndata = "far.csv"'])
    text = refusal(lab, MotionError)
    assert "far.CMD:4:1: axis 1 runs into its limit switch at" in text


# -- what is not -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "effects",
    [
        {"acceleration_scale": {"e": 0.5}},
        {"acceleration_scale": {"e": -0.5}},
        {"velocity_scale": {"e": 0.02}},
        {"velocity_scale": {"e": -0.02}},
        {"start_delay": {"d": 0.02}},
        {"start_delay": {"d": 0.02, "every_move": 1.0}},
        {"trigger_delay": {"t_d": 0.01}},
        {"sensor_gain": {"g": 0.01}},
        {"sensor_gain": {"g": -0.01}},
        {"controller_clock": {"e": 0.005}},
        {"controller_clock": {"e": -0.005}},
        {"sample_clock": {"e": 0.005}},
        {"lost_steps": {"n": 10.0}},
        {"lost_steps": {"n": -50.0}},
        {"umbilical_spring": {"k_h": 50.0}},
        {"coulomb_friction": {}},
        {"acceleration_scale": {"e": 0.5}, "start_delay": {"d": 0.02}, "sensor_gain": {"g": 0.01}},
    ],
    ids=str,
)
@pytest.mark.parametrize("noise", [2e-5, 0.025], ids=["laser", "lvdt"])
def test_a_large_real_effect_is_not_mistaken(lab, effects, noise):
    sensor = [Sensor("laser", POSITION, "position_1_in", 2000.0, 1, noise)]
    for name in ("fast", "slow"):
        lab.record(f"{name}.CMD", f"{name}.csv", effects, sensor)
    runs = [f'program = "{name}.CMD"\ndata = "{name}.csv"' for name in ("fast", "slow")]
    lab.experiment(runs, LASER.replace("2e-5", str(noise)))
    assert [trial.name for trial in lab.load().trials] == ["fast.csv", "slow.csv"]


def test_a_parked_axis_that_the_other_one_drags_along_is_not_mistaken(lab):
    lab.program("one.CMD", "UU012500/1\nVEL0 6.0\nACC0 0.1\nMRI2 8.0\nWX2\nWT300\n")
    lab.record("one.CMD", "one.csv", {"cross_axis_coupling": {"gamma": 0.001}})
    lab.experiment(['program = "one.CMD"\ndata = "one.csv"'])
    assert len(lab.load().trials) == 1


@pytest.mark.parametrize("noise", [0.0, 2e-5])
def test_a_motor_that_lost_its_lock_is_not_taken_for_the_parked_axis(lab, noise):
    """At rest it fits the other axis, which is commanded to rest, much better."""
    lab.two_runs()
    header, *rows = lab.path("fast.csv").read_text().splitlines()
    generator = np.random.default_rng(5)
    still = [f"{row.split(',')[0]},{x!r}" for row, x in zip(
        rows, generator.normal(0.0, noise, len(rows)).tolist(), strict=True)]  # fmt: skip
    lab.write("fast.csv", "\n".join([header, *still]) + "\n")
    experiment = lab.load()
    assert len(experiment.trials) == 2
    (note,) = experiment.notes
    assert note.startswith("fast.csv: position_1_in hardly follows fast.CMD: is it the right")


def test_hours_of_positions_are_refused_before_they_are_simulated(lab):
    lab.two_runs()
    lab.csv("fast.csv", {"time_s": np.arange(3601.0), "position_1_in": np.zeros(3601)})
    lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"'], LASER.replace("2000.0", "1.0"))
    assert "fast.csv has 3600 s of positions [data-too-long]" in refusal(lab)


def test_programs_that_differ_by_what_the_machine_gets_wrong_are_not_swapped(lab):
    """Half as much acceleration again makes the one run look like the other."""
    for name, rate in (("a", 0.1), ("b", 0.15)):
        lab.program(f"{name}.CMD", f"UU012500/1\nVEL1 15.0\nACC1 {rate}\nMRI1 2.0\nWX1\nWT300\n")
        lab.record(f"{name}.CMD", f"{name}.csv", {"acceleration_scale": {"e": 0.5}})
    lab.experiment([f'program = "{n}.CMD"\ndata = "{n}.csv"' for n in "ab"])
    assert len(lab.load().trials) == 2


def test_the_same_program_twice_is_never_swapped(lab):
    lab.record("fast.CMD", "one.csv")
    lab.record("fast.CMD", "two.csv", payload_kg=2.0)
    lab.experiment([f'program = "fast.CMD"\ndata = "{n}.csv"' for n in ("one", "two")])
    assert len(lab.load().trials) == 2


def test_data_may_go_on_after_the_program(lab):
    lab.record("fast.CMD", "fast.csv")
    rows = lab.path("fast.csv").read_text().splitlines()
    last_s, last = map(float, rows[-1].split(","))
    rows += [f"{last_s + n / 2000:.10g},{last}" for n in range(1, 2000)]
    lab.write("fast.csv", "\n".join(rows) + "\n")
    lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"'])
    assert lab.load().trials[0].duration_s == pytest.approx(last_s + 1999 / 2000)


def test_a_motion_without_end_lasts_as_long_as_its_data(lab):
    """Of the extended grammar: a velocity that is never taken back."""
    lab.program("on.CMD", "UU012500/1\nVEL1 4.0\nACC1 0.1\nMC1 4.0\n")
    t = np.arange(0, 2.0, 0.0005)
    position = np.where(t < 0.04, 50 * t**2, 4 * t - 0.08)
    lab.csv("on.csv", {"time_s": t, "position_1_in": position})
    path = lab.experiment(['program = "on.CMD"\ndata = "on.csv"\npartial = true'])
    path.write_text(f'grammar = "extended"\n{path.read_text()}')
    experiment = lab.load()
    assert experiment.trials[0].duration_s == pytest.approx(1.9995)
    assert experiment.notes == ()
