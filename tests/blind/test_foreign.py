"""Each foreign kind against a closed form or a property, and how its cases are judged."""

import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from mopro.blind.cases.foreign_kinds import FOREIGN_KINDS
from mopro.blind.cases.grids import case_specs
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS
from mopro.blind.cases.hidden_sizes import of_size
from mopro.blind.cases.make import make
from mopro.blind.cases.spec import ENCODER, LASER, case_instruments
from mopro.blind.reference import axis, equation
from mopro.blind.reference.listing import timeline
from mopro.blind.reference.motor import THESIS
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.uncatalogued import (
    Foreign,
    clock,
    noise,
    signal,
    stored_badly,
    with_lost_microsteps,
)
from mopro.blind.scoring.judge import judge
from mopro.blind.scoring.score import Score
from mopro.blind.scoring.scored_cases import hidden_plant, with_named_set

MOVE = "UU012500/1\nVEL1 20.0\nACC1 0.25\nMRI1 4.0\nWX1\nWT300\nMRI1 -4.0\nWX1\nWT300\n"
SPEED = 0.05
INSTRUMENTS = case_instruments(ENCODER, "strokes")
# Kinds that would make the axis stall at their full strength.
MECHANICS = (
    "lugre", "hysteretic_spring", "structural_mode", "place_friction", "fading_friction",
    "direction_gain",
)  # fmt: skip


@pytest.fixture
def generator():
    return np.random.default_rng(7)


def cruise(times, name, speed=SPEED, **numbers):
    """Position less command (m) at `times` of an axis that moves evenly."""
    row = np.array([[0.0, 9.0, 0.0, speed, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]])
    p = axis.numbers({"electrical_damping": {"zeta": 0.1}}, foreign=Foreign(name, numbers))
    found = axis.axis_response(np.asarray(times), row, p)
    return found[:, 0] - found[:, 3]


def aside(force_N):
    """The lag (m) at which the motor gives this force."""
    return -math.asin(force_N / THESIS.force_N) / THESIS.wave_1_m


class TestMechanics:
    def test_lugre_friction_falls_with_the_speed(self):
        law = {"N": 4.0, "presliding": 1e-5, "static": 1.5, "vs": 0.05, "inner": 0.3}
        for speed in (0.02, 0.1):
            (lag,) = cruise([1.5], "lugre", speed, **law)
            force = 4.0 + 2.0 * math.exp(-((speed / 0.05) ** 2))
            assert lag == pytest.approx(aside(force), rel=1e-3)

    def test_friction_depends_on_the_place(self):
        law = {"N": 4.0, "presliding": 5e-6, "depth": 0.9, "length": 0.5, "phi": 0.0}
        times = np.array([1.0, 2.5, 7.5])
        forces = 4.0 * (1 + 0.9 * np.sin(2 * np.pi * SPEED * times / 0.5))
        lags = cruise(times, "place_friction", **law)
        assert lags == pytest.approx([aside(f) for f in forces], rel=2e-2)

    def test_friction_fades_as_grease_warms(self):
        law = {"N": 4.0, "presliding": 5e-6, "fade": 0.8, "tau": 1.0}
        lags = cruise([1.0, 6.0], "fading_friction", **law)
        forces = [4.0 * (1 - 0.8 * (1 - math.exp(-t))) for t in (1.0, 6.0)]
        assert lags == pytest.approx([aside(f) for f in forces], rel=1e-2)

    def test_a_spring_with_a_loop_saturates_after_its_reach(self):
        lags = cruise([0.2, 3.0], "hysteretic_spring", N=5.0, reach=0.02)
        forces = [5.0 * (1 - math.exp(-SPEED * t / 0.02)) for t in (0.2, 3.0)]
        assert lags == pytest.approx([aside(f) for f in forces], rel=2e-2)

    def test_a_second_mass_rings_at_its_frequency(self):
        """Beside a forcer that hardly moves: with a hundredth of its mass, well below 83 Hz."""
        mode = Foreign("structural_mode", {"share": 0.01, "f": 20.0, "zeta": 0.0})
        p = axis.numbers({}, foreign=mode)
        assert p[equation.MASS] + p[equation.MODE_MASS] == pytest.approx(THESIS.mass_kg)
        rest = np.array([[0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]])
        times, out = np.arange(0.0, 1.0, 1e-4), np.empty((10_000, 4))
        start = np.zeros(equation.STATES)
        start[equation.IA] = 1.0
        start[equation.X] = 1e-6
        equation.response(times, rest, p, start, equation.TOLERANCE, out)
        slow = out[4000:, 0]
        power = np.abs(np.fft.rfft(slow * np.hanning(len(slow)))) ** 2
        frequency = np.fft.rfftfreq(len(slow), 1e-4)
        low = (frequency > 5) & (frequency < 50)
        assert frequency[low][np.argmax(power[low])] == pytest.approx(20.0, abs=1.7)

    def test_the_gain_depends_on_the_direction(self):
        lags = []
        for sign in (1.0, -1.0):
            a = sign * 6.0
            row = np.array([[0.0, 2.0, 0.0, 0.0, a, 0.0, 1.0, 1.0, 1.0, 0.0]])
            p = axis.numbers({}, foreign=Foreign("direction_gain", {"e": 0.2}))
            found = axis.axis_response(np.array([1.5]), row, p)
            lags.append(abs(found[0, 0] - found[0, 3]))
        for lag, gain in zip(lags, (1.2, 0.8), strict=True):
            exact = math.asin(THESIS.mass_kg * 6.0 / (gain * THESIS.force_N)) / THESIS.wave_1_m
            assert lag == pytest.approx(exact, rel=1e-3)

    def test_lost_microsteps_leave_the_axis_behind(self):
        whole = axis.rows(timeline(MOVE), 1, {})
        lossy = Foreign("missing_microsteps", {"rate": 10.0, "phi": 0.3})
        cut = with_lost_microsteps(whole, lossy, THESIS.microstep_m)
        assert (cut[1:, equation.T0] == cut[:-1, equation.T1]).all()
        times = np.linspace(0.01, whole[-1, equation.T0], 500)
        behind = axis.position_m(whole, times) - axis.position_m(cut, times)
        steps = behind / THESIS.microstep_m
        assert steps == pytest.approx(np.rint(steps), abs=1e-6)
        first = times < whole[2, equation.T1]
        assert (np.diff(steps[first]) > -1e-6).all()
        assert 1 <= round(steps[first].max()) <= 10

    def test_nothing_foreign_is_not_integrated(self):
        assert axis.numbers({})[equation.USED] == equation.PLAIN_STATES
        assert axis.numbers({}, foreign=Foreign("outliers", {}))[equation.USED] == 5


class TestInstrument:
    def test_a_jittered_clock_stays_in_order_and_on_average(self, generator):
        stamps = np.arange(2000) / 1000.0
        taken = clock(stamps, Foreign("jittered_clock", {"share": 0.45}), generator)
        assert (np.diff(taken) > 0).all()
        assert np.std(taken - stamps) == pytest.approx(0.45e-3 / math.sqrt(3), rel=0.05)

    def test_a_stepping_clock_skips(self, generator):
        stamps = np.arange(2000) / 1000.0
        late = clock(stamps, Foreign("stepping_clock", {"step": 3e-3, "every": 0.5}), generator)
        assert sorted(set(np.round(late - stamps, 9))) == [0.0, 0.003, 0.006, 0.009]

    def test_ar1_noise_has_the_stated_size_and_correlation(self, generator):
        found = noise(200_000, 2e-5, Foreign("ar1_noise", {"phi": 0.8}), generator)
        assert found.std() == pytest.approx(2e-5, rel=0.02)
        for lag in (1, 3):
            correlation = np.mean(found[lag:] * found[:-lag]) / found.var()
            assert correlation == pytest.approx(0.8**lag, abs=0.02)

    def test_flicker_noise_has_the_stated_size_and_slope(self, generator):
        found = np.array([noise(4096, 2.0, Foreign("flicker_noise", {}), generator)
                          for _ in range(40)])  # fmt: skip
        assert math.sqrt(np.mean(found**2)) == pytest.approx(2.0, rel=0.03)
        power = np.mean(np.abs(np.fft.rfft(found)) ** 2, axis=0)[1:1000]
        slope = np.polyfit(np.log(np.arange(1, 1000)), np.log(power), 1)[0]
        assert slope == pytest.approx(-1.0, abs=0.05)

    def test_white_noise_is_as_before(self):
        one, other = np.random.default_rng(1), np.random.default_rng(1)
        assert (noise(9, 2.0, None, one) == other.normal(0.0, 2.0, 9)).all()

    def test_a_wandering_gain_scales_the_reading(self, generator):
        time_s, seen = np.arange(20_000) / 1000.0, np.full(20_000, 0.1)
        law = Foreign("wandering_gain", {"rms": 1e-2, "tau": 0.05})
        gain = signal(seen, time_s, None, law, generator) / seen - 1
        assert gain.std() == pytest.approx(1e-2, rel=0.2)
        assert np.corrcoef(gain[50:], gain[:-50])[0, 1] == pytest.approx(math.exp(-1), abs=0.1)

    def test_a_thermal_bow_grows_with_heat_and_the_square_of_the_place(self, generator):
        law = Foreign("thermal_bow", {"bow": 1e-5, "half": 0.2})
        seen = np.array([0.0, 0.1, 0.2, 0.2])
        found = signal(seen, seen, np.array([9.0, 2.0, 2.0, 4.0]), law, generator)
        assert found - seen == pytest.approx([0.0, 5e-6, 2e-5, 4e-5])

    def test_a_sticking_sensor_repeats_its_last_reading(self, generator):
        reading = generator.standard_normal(3000)
        law = Foreign("sticking_sensor", {"rate": 1.0, "lasts": 0.03})
        kept = stored_badly(reading, 1.0, 1000.0, law, generator)
        stuck = np.flatnonzero(np.diff(kept) == 0.0)
        assert 30 <= len(stuck) <= 3 * 30
        assert (kept == reading).sum() >= 3000 - 3 * 30

    def test_dropouts_are_zero(self, generator):
        law = Foreign("dropouts", {"rate": 1.0, "lasts": 0.01})
        kept = stored_badly(np.ones(3000), 1.0, 1000.0, law, generator)
        assert set(kept) == {0.0, 1.0}
        assert 10 <= (kept == 0.0).sum() <= 30

    def test_outliers_are_few_and_far(self, generator):
        law = Foreign("outliers", {"count": 8})
        kept = stored_badly(np.zeros(3000), 2.0, 1000.0, law, generator)
        off = np.abs(kept[kept != 0.0]) / 2.0
        assert len(off) == 8
        assert (off.min() >= 20, off.max() <= 500) == (True, True)


@pytest.mark.parametrize("name", FOREIGN_KINDS)
def test_each_kind_shows_in_a_run(name):
    drawn = FOREIGN_KINDS[name].draw(np.random.default_rng(3), THESIS)
    (laser,) = case_instruments(LASER, "strokes")
    run = ProgramRun(MOVE)
    strength = 0.2 if name in MECHANICS else 1.0
    odd = ReferencePlant({}, foreign=Foreign(name, drawn(strength)))
    _, (seen,) = odd.readings(run, [laser], np.random.default_rng(1))
    _, (usual,) = ReferencePlant({}).readings(run, [laser], np.random.default_rng(1))
    stored = FOREIGN_KINDS[name].coloured or not FOREIGN_KINDS[name].sized
    assert bool((seen == usual).all()) is stored
    assert not odd.stalled


def test_a_size_is_reached():
    kind, g = FOREIGN_KINDS["direction_gain"], np.random.default_rng(1)
    numbers, size = of_size(kind, 50.0, lambda n: 1000.0 * abs(n["e"]) ** 1.2, g)
    assert size == pytest.approx(50.0, rel=0.11)
    assert 1000.0 * abs(numbers["e"]) ** 1.2 == size


def test_kinds_and_grid():
    assert len(FOREIGN_KINDS) >= 15
    specs = case_specs("foreign", 1)
    assert {s.foreign for s in specs} == set(FOREIGN_KINDS)
    assert sum(bool(s.effects) for s in specs) == len(specs) / 2
    names = {n for k in FOREIGN_KINDS.values() for n in (*k.same, *k.akin)}
    assert names <= set(HIDDEN_EFFECTS)


def test_a_case_is_made_and_its_plant_is_found_again(tmp_path):
    specs = case_specs("foreign", 1)
    at = next(i for i, s in enumerate(specs, 1) if s.foreign == "structural_mode" and s.effects)
    number, _ = make(1, "foreign", tmp_path, frozenset([f"{at:03d}"]))
    answer = json.loads((tmp_path / "answers.json").read_text())["cases"][number]
    assert answer["foreign"]["name"] == "structural_mode"
    assert 36 < answer["foreign_sigma"] < 445
    assert hidden_plant(answer).foreign == Foreign(**answer["foreign"])
    told = "\n".join(p.read_text() for p in (tmp_path / number).glob("*.*") if p.suffix != ".csv")
    assert "mode" not in told


ANSWER = {
    "group": "foreign", "sensor": "laser", "strange": None, "offsets": [0.0],
    "effects": [{"name": "viscous_drag", "parameters": {"b": 5.0}, "total_sigma": 90.0}],
    "foreign": {"name": "place_friction", "numbers": {}}, "coloured": False,
    "same": ["stribeck_friction"], "akin": ["coulomb_friction"], "variables": ["x", "sgn v"],
}  # fmt: skip


def reply(verdict, *names, b=5.1, ci=(5.0, 5.2), **others):
    parameters = {"b": {"value": b, "unit": "N s/m", "ci95": list(ci)}}
    effects = [{"name": name, "parameters": parameters} for name in names]
    return {"verdict": verdict, "effects": effects, **others}


def outcome(*args, **others):
    return judge("001", ANSWER, reply(*args, **others)).outcome


def test_outcomes():
    assert outcome("unexplained", "viscous_drag") == "right"
    assert outcome("unexplained", "viscous_drag", "coulomb_friction") == "right"
    assert outcome("named", "viscous_drag", "coulomb_friction") == "wrong"
    assert outcome("named", "viscous_drag", "stribeck_friction") == "family"
    assert outcome("unexplained", "hum") == "wrong"
    assert outcome("named", "viscous_drag") == "partly"
    assert outcome("none") == "none"


@pytest.mark.parametrize(("of", "expected"), [("sgn v", "family"), ("t", "wrong")])
def test_a_false_name_is_not_clean_if_a_term_of_the_right_variable_would_do_as_well(of, expected):
    rival = [{"of": of, "law": "2 * sign(v)", "unit": "N"}]
    assert outcome("ambiguous", "hum", drafts=rival) == expected
    # Beside something unexplained a draft excuses no name.
    assert outcome("unexplained", "hum", drafts=rival) == "wrong"


@pytest.mark.parametrize(("step_s", "expected"), [(2e-6, "family"), (1e-4, "wrong")])
def test_names_that_the_data_cannot_tell_from_what_is_foreign_are_equivalent(
    step_s, expected, tmp_path
):
    """A clock that steps is one of another rate, but for a sawtooth of half a step either way."""
    (tmp_path / "001").mkdir()
    (tmp_path / "001" / "run1.CMD").write_text(MOVE, encoding="ascii")
    answer = ANSWER | {
        "effects": [], "same": [], "akin": ["sample_clock"], "variables": ["t"],
        "foreign": {"name": "stepping_clock", "numbers": {"step": step_s, "every": 0.1}},
        "machine": asdict(THESIS), "instruments": [asdict(i) for i in INSTRUMENTS],
        "runs": [{"program": "run1.CMD", "payload_kg": 0.0, "until_s": None}],
    }  # fmt: skip
    said = {"verdict": "named", "effects": [{"name": n} for n in ("sample_clock", "start_delay")]}
    judged = with_named_set(answer, said, tmp_path / "001", 1)
    assert judge("001", judged, said).outcome == expected


@pytest.mark.parametrize(
    ("b", "ci", "right"),
    [(5.4, (5.35, 5.45), True), (6.0, (5.3, 6.7), True), (6.0, (5.9, 6.1), False),
     (6.0, (None, None), False)],
)  # fmt: skip
def test_the_size_of_the_effect_beside(b, ci, right):
    said = reply("unexplained", "viscous_drag", b=b, ci=ci)
    assert judge("001", ANSWER, said).size_is_right is right
    assert not judge("001", ANSWER, reply("unexplained")).size_is_right


def test_coloured_noise_is_nothing():
    quiet = ANSWER | {"effects": [], "coloured": True, "variables": []}
    assert judge("001", quiet, reply("none")).outcome == "right"
    assert judge("001", quiet, reply("named", "hum")).outcome == "wrong"


def test_the_table_of_the_grid():
    said = reply("unexplained", "viscous_drag", remainder={"variable": "x", "description": "a law"})
    quiet = ANSWER | {"effects": [], "coloured": True, "variables": []}
    cases = [judge("001", ANSWER, said), judge("002", quiet, reply("none")),
             judge("003", ANSWER, reply("named", "hum"))]  # fmt: skip
    rows = {r.what: r for r in Score(tuple(cases), (), "foreign").rows()}
    assert rows["foreign: a false clean name"].reached == "33.3% (1 of 3)"
    assert rows["foreign: right variable"].reached == "50.0% (1 of 2)"
    assert rows["coloured noise of the stated size: none"].reached == "100.0% (1 of 1)"
    beside = rows["an effect beside it, 20 σ or more: named with its size"]
    assert (beside.reached, beside.met) == ("50.0% (1 of 2)", False)
