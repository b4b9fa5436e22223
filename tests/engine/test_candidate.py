"""Kinds of candidates: angles, inverse parameters, forms, own searches, curved responses."""

import math

import numpy as np
import pytest

import mopro
from mopro.engine import Candidate, Parameter, Role, Series
from mopro.engine.assumed import TOLERANCE

T = np.arange(600) / 600
POSITION = np.sin(2 * np.pi * 3 * T)
SIGMA = 0.1
EVEN = (2, 4, 6, 8, 10, 12, 14, 16)


def diagnosed(predict, truth, *candidates, seed=0):
    """The verdict on two runs of `predict` with `truth` in them."""
    rng = np.random.default_rng(seed)
    runs = [predict(truth) + SIGMA * rng.standard_normal(len(T)) for _ in range(2)]
    data = [
        Series(f"run {i}", "force", "N", run, SIGMA, T, np.arange(len(T)) // 100 + 10 * i,
               labels={"position": POSITION})
        for i, run in enumerate(runs)
    ]  # fmt: skip
    return mopro.reconcile(lambda settings: [predict(settings)] * 2, candidates, data)


@pytest.mark.parametrize("phi", [0.4, 3.1, -3.1, -1.6])
def test_an_angle_is_found_wherever_it_is(phi):
    def predict(settings):
        wave = settings.get("wave", {"A": 0.0, "phi": 0.0})
        return wave["A"] * np.sin(2 * np.pi * 7 * T + wave["phi"])

    angle = Parameter("phi", "rad", -math.pi, math.pi, role=Role.PHASE)
    wave = Candidate("wave", (Parameter("A", "N", 0, 1, (0.1,)), angle))
    (effect,) = diagnosed(predict, {"wave": {"A": 0.2, "phi": phi}}, wave).effects
    phase = effect.parameters["phi"].value
    assert abs(math.remainder(phase - phi, 2 * math.pi)) < 0.15
    assert -math.pi <= phase <= math.pi
    assert effect.parameters["A"].value == pytest.approx(0.2, abs=0.03)


def test_an_angle_whose_response_is_not_a_combination_of_two_is_tried_at_each_start():
    """At π the response has another frequency, which probes at 0 and π/2 do not show."""

    def predict(settings):
        wave = settings.get("wave", {"A": 0.0, "phi": 0.0})
        there, back = max(math.cos(wave["phi"]), 0.0), max(-math.cos(wave["phi"]), 0.0)
        shape = there * np.sin(2 * np.pi * 7 * T) + back * np.sin(2 * np.pi * 11 * T)
        return wave["A"] * (shape + math.sin(wave["phi"]) * np.sin(2 * np.pi * 5 * T))

    def verdict(*starts):
        angle = Parameter("phi", "rad", -math.pi, math.pi, starts, Role.PHASE)
        wave = Candidate("wave", (Parameter("A", "N", 0, 1, (0.1,)), angle))
        return diagnosed(predict, {"wave": {"A": 0.2, "phi": math.pi}}, wave)

    assert not verdict().effects
    (effect,) = verdict(0.0, math.pi).effects
    phase = effect.parameters["phi"].value
    assert abs(math.remainder(phase - math.pi, 2 * math.pi)) < 0.15


def test_a_parameter_that_acts_by_its_inverse_is_found_from_a_distant_start():
    def predict(settings):
        corner = settings.get("corner", {"f": math.inf})["f"]
        return np.cos(2 * np.pi * 2 * T) * 100 / corner

    f = Parameter("f", "Hz", 50, 1e6, (5000.0,), inverse=True, null=math.inf)
    (effect,) = diagnosed(predict, {"corner": {"f": 200.0}}, Candidate("corner", (f,))).effects
    low, high = effect.parameters["f"].ci95
    assert low < 200 < high
    assert high - low < 10


def drag(settings):
    """F = b v |v|^(n-1), by its form."""
    v = np.cos(2 * np.pi * 3 * T)
    b, n = (settings.get("drag", {"b": 0.0, "n": 1.0})[key] for key in ("b", "n"))
    return b * np.sign(v) * np.abs(v) ** n


B = Parameter("b", "N", 0, 5, (0.5,))


@pytest.mark.parametrize(("n", "form"), [(1.0, "linear"), (2.0, "square")])
def test_of_several_forms_the_evidence_picks_one(n, form):
    linear = Candidate("drag", (B,), "linear", {"n": 1.0})
    square = Candidate("drag", (B,), "square", {"n": 2.0})
    verdict = diagnosed(drag, {"drag": {"b": 1.0, "n": n}}, linear, square)
    (effect,) = verdict.effects
    assert (effect.name, effect.form) == ("drag", form)
    assert effect.indistinguishable_from == []
    assert verdict.settings["drag"]["n"] == n


@pytest.mark.parametrize(("n", "form"), [(1.0, ""), (1.4, "any power")])
def test_a_form_with_more_parameters_is_taken_only_where_the_ebic_is_lower(n, form):
    plain = Candidate("drag", (B,), fixed={"n": 1.0})
    power = Parameter("n", "1", 0.2, 3.0, (1.0,), Role.SHAPE)
    freed = Candidate("drag", (B, power), "any power", extends="")
    (effect,) = diagnosed(drag, {"drag": {"b": 1.0, "n": n}}, plain, freed).effects
    assert effect.form == form
    if form:
        assert effect.parameters["n"].value == pytest.approx(n, abs=0.1)


def test_a_searched_parameter_keeps_the_value_that_the_search_found():
    def predict(settings):
        step = settings.get("step", {"height": 0.0, "at": 0.5})
        return step["height"] * (step["at"] < T)

    def largest_cumulative_sum(view):
        means = [r.cumsum() for r in view.residuals]
        at = int(np.argmax(np.abs(sum(means))))
        yield {"at": float(T[at] + T[at + 1]) / 2, "height": 0.3}

    height = Parameter("height", "N", -2, 2)
    at = Parameter("at", "s", 0, 1, role=Role.SEARCHED)
    step = Candidate("step", (height, at), find_starts=largest_cumulative_sum)
    (effect,) = diagnosed(predict, {"step": {"height": -0.4, "at": 0.3712}}, step).effects
    assert effect.parameters["at"].value == pytest.approx(0.3712, abs=2 / 600)
    assert effect.parameters["height"].value == pytest.approx(-0.4, abs=0.03)
    assert not diagnosed(predict, {}, step).effects


def test_a_start_that_a_search_found_is_not_resized_where_that_leaves_more():
    """The frequency of the line grows with its size; a larger one is further off."""

    def predict(settings):
        size = settings.get("detuned", {"size": 0.0})["size"]
        return size * np.sin(2 * np.pi * (8 + 2 * size) * T)

    size = Parameter("size", "N", 0, 5)
    detuned = Candidate("detuned", (size,), find_starts=lambda view: [{"size": 1.9}])
    (effect,) = diagnosed(predict, {"detuned": {"size": 2.0}}, detuned).effects
    assert effect.parameters["size"].value == pytest.approx(2.0, abs=0.05)


def test_a_start_of_the_wrong_sign_for_its_range_is_not_added():
    """The data need a height of -0.5 N, and the range begins at 0."""

    def predict(settings):
        height = settings.get("hill", {"height": 0.0})["height"]
        # Switching an effect on changes the rounding of a simulation.
        return (height + 1e-12 * ("hill" in settings)) * np.sin(2 * np.pi * 8 * T)

    height = Parameter("height", "N", 0, 5)
    forth = Candidate("hill", (height,), find_starts=lambda view: [{"height": 1.0}])
    verdict = diagnosed(predict, {"hill": {"height": -0.5}}, forth)
    assert (verdict.verdict, verdict.effects) == ("unexplained", ())


@pytest.mark.parametrize("seed", range(3))
def test_a_small_effect_is_sized_well_though_its_response_is_curved_at_its_probe(seed):
    """Probed where the phase has moved far, hidden where it is a straight line."""
    probe_rad, hidden_rad = 0.9, 0.03

    def predict(settings):
        turned = settings.get("turned", {"angle": 0.0})["angle"]
        return np.sin(2 * np.pi * 3 * T + turned) - np.sin(2 * np.pi * 3 * T)

    angle = Parameter("angle", "rad", -1.2, 1.2, (probe_rad,))
    turned = Candidate("turned", (angle,))
    (effect,) = diagnosed(predict, {"turned": {"angle": hidden_rad}}, turned, seed=seed).effects
    # Of a cosine of this amplitude in so many samples of this noise.
    error_rad = SIGMA * math.sqrt(2 / (2 * len(T)))
    assert effect.parameters["angle"].value == pytest.approx(hidden_rad, abs=4 * error_rad)


def test_two_effects_of_the_same_response_are_each_others_alternatives():
    def predict(settings):
        total = sum(settings.get(n, {"b": 0.0})["b"] for n in ("one", "other"))
        return total * np.cos(2 * np.pi * 3 * T)

    (effect,) = diagnosed(
        predict, {"one": {"b": 1.0}}, Candidate("one", (B,)), Candidate("other", (B,))
    ).effects
    assert {effect.name, *effect.indistinguishable_from} == {"one", "other"}
    (settings,) = effect.alternatives.values()
    assert next(iter(settings.values()))["b"] == pytest.approx(1.0, abs=0.05)


def test_an_effect_whose_largest_plausible_size_would_not_show_is_below_resolution():
    def predict(settings):
        sizes = {n: settings.get(n, {"b": 0.0})["b"] for n in ("weak", "plain")}
        return (1e-4 * sizes["weak"] + sizes["plain"]) * np.cos(2 * np.pi * 3 * T)

    verdict = diagnosed(predict, {}, Candidate("weak", (B,)), Candidate("plain", (B,)))
    (unseen,) = verdict.below_resolution
    # 5 units of 1e-4 N over sqrt(600) samples of a cosine's rms.
    expected = 5e-4 * math.sqrt(600) / SIGMA
    assert unseen.name == "weak"
    assert unseen.expected_sigmas == pytest.approx(expected, rel=0.01)
    assert [r.name for r in verdict.rejected] == ["plain"]


def test_an_effect_with_a_clearly_implausible_value_is_no_alternative():
    tight = Candidate("drag", (Parameter("b", "N", 0, 5, (0.5,), plausible=(0, 0.2)),),
                      fixed={"n": 1.0})  # fmt: skip

    def predict(settings):
        renamed = dict(settings)
        if "other" in renamed:
            renamed["drag"] = {"b": renamed.pop("other")["b"], "n": 1.0}
        return drag(renamed)

    (effect,) = diagnosed(
        predict, {"drag": {"b": 1.0, "n": 1.0}}, tight, Candidate("other", (B,))
    ).effects
    assert (effect.name, effect.indistinguishable_from) == ("other", [])


@pytest.mark.parametrize(("beyond", "told"), [(2.5, True), (4.0, False)])
def test_an_effect_is_an_alternative_unless_its_value_is_very_strongly_implausible(beyond, told):
    """A true value 2 to 3 standard deviations beyond its range is rare, and is still told."""

    def predict(settings):
        total = sum(settings.get(n, {"b": 0.0})["b"] for n in ("tight", "other"))
        return total * np.cos(2 * np.pi * 3 * T)

    truth, other = {"other": {"b": 1.0}}, Candidate("other", (B,))
    (effect,) = diagnosed(predict, truth, other).effects
    size = effect.parameters["b"]
    deviation = (size.ci95[1] - size.ci95[0]) / (2 * 1.96)
    end = (size.value - beyond * deviation) / (1 + TOLERANCE)
    tight = Candidate("tight", (Parameter("b", "N", 0, 5, (0.5,), plausible=(0, end)),))
    (effect,) = diagnosed(predict, truth, tight, other).effects
    assert effect.name == "other"
    assert effect.indistinguishable_from == (["tight"] if told else [])


@pytest.mark.parametrize("seed", range(4))
def test_an_effect_that_only_made_up_for_a_fixed_parameter_is_not_named(seed):
    """A cubic about 0.08 is one about 0 with a parabola and a slope, which even powers mimic."""

    def predict(settings):
        cubic = settings.get("cubic", {"c": 0.0, "middle": 0.0})
        powers = (settings.get(f"x{n}", {"s": 0.0})["s"] * POSITION**n for n in EVEN)
        return cubic["c"] * (POSITION - cubic["middle"]) ** 3 + sum(powers)

    c = Parameter("c", "N", -10, 10, (1.0,))
    middle = Parameter("middle", "1", -0.9, 0.9, (0.0,), Role.SHAPE)
    plain = Candidate("cubic", (c,), fixed={"middle": 0.0})
    freed = Candidate("cubic", (c, middle), "middle fitted", extends="")
    powers = [Candidate(f"x{n}", (Parameter("s", "N", -10, 10, (1.0,)),)) for n in EVEN]
    truth = {"cubic": {"c": 1.0, "middle": 0.08}}
    (effect,) = diagnosed(predict, truth, plain, freed, *powers, seed=seed).effects
    assert (effect.name, effect.form) == ("cubic", "middle fitted")
    assert effect.parameters["middle"].value == pytest.approx(0.08, abs=0.02)


@pytest.mark.parametrize("can_enter_first", [False, True])
def test_an_extended_form_may_enter_first_where_the_plain_one_explains_nothing(can_enter_first):
    """The plain form has a line at 7 Hz, the data one at 11 Hz."""

    def predict(settings):
        line = settings.get("line", {"A": 0.0, "f": 7.0})
        return line["A"] * np.sin(2 * np.pi * line["f"] * T)

    height = Parameter("A", "N", -1, 1, (0.1,))
    hertz = Parameter("f", "Hz", 5.0, 13.0, (7.0, 10.8), Role.SHAPE)
    plain = Candidate("line", (height,), fixed={"f": 7.0})
    freed = Candidate("line", (height, hertz), "any f", extends="", can_enter_first=can_enter_first)
    verdict = diagnosed(predict, {"line": {"A": 0.2, "f": 11.0}}, plain, freed)
    assert [e.form for e in verdict.effects] == (["any f"] if can_enter_first else [])


def test_a_form_nests_another_if_its_other_parameters_are_fixed_alike():
    b, n, m = (Parameter(name, "1", 0.0, 3.0, (1.0,)) for name in "bnm")
    plain = Candidate("drag", (b,), fixed={"n": 1.0, "m": 0.0})
    power = Candidate("drag", (b, n), "power", {"m": 0.0}, extends="")
    both = Candidate("drag", (b, n, m), "both", extends="power")
    assert power.nests(plain)
    assert both.nests(plain)
    assert both.nests(power)
    assert not plain.nests(power)
    assert not plain.nests(plain)
    elsewhere = Candidate("drag", (b, n), "power, there", {"m": 0.0, "axis": 2.0}, extends="")
    assert not elsewhere.nests(plain)
    assert not Candidate("lift", (b, n), "power", {"m": 0.0}).nests(plain)


def lines(*hertz):
    """Shapes of one size that have nothing in common, by their frequency."""
    return {n: np.sin(2 * np.pi * n * T) for n in hertz}


def turned_towards(shape, other, angle_rad):
    return math.cos(angle_rad) * shape + math.sin(angle_rad) * other


HEIGHT = Parameter("A", "N", -9, 9, (0.1,))
SEPARATE = (4, 5, 7, 9)


@pytest.mark.parametrize("turn_deg", [20.0, 42.0])
@pytest.mark.parametrize("beside", [{}, {"4 Hz": {"A": 0.6}}], ids=["alone", "beside another"])
def test_one_effect_of_a_curved_response_is_not_answered_as_several(beside, turn_deg):
    """At its size in the data it is the sum of three other lines.

    Probed at twice that it is turned towards a line that no other effect has.
    """
    shapes, hidden_N = lines(4, 5, 7, 9, 11), 0.5

    def predict(settings):
        size = settings.get("turning", {"a": 0.0})["a"] / hidden_N
        three = (shapes[5] + shapes[7] + shapes[9]) / math.sqrt(3)
        force = size * turned_towards(three, shapes[11], math.radians(turn_deg) * (size - 1))
        return force + sum(settings.get(f"{n} Hz", {"A": 0.0})["A"] * shapes[n] for n in SEPARATE)

    turning = Candidate("turning", (Parameter("a", "N", 0, 3, (2 * hidden_N,)),))
    truth = {"turning": {"a": hidden_N}} | beside
    separate = [Candidate(f"{n} Hz", (HEIGHT,)) for n in SEPARATE]
    verdict = diagnosed(predict, truth, turning, *separate)
    assert {e.name for e in verdict.effects} == set(truth)
    assert verdict.verdict == "named"


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("apart_deg", [100.0, 114.0, 125.0])
def test_two_effects_that_cancel_each_other_are_found_beside_a_stronger_one(apart_deg, seed):
    """Each of the two explains less than it leaves, and both leave nothing."""
    shapes = lines(5, 7, 9)
    shapes[9] = turned_towards(shapes[7], shapes[9], math.radians(apart_deg))

    def predict(settings):
        return sum((settings.get(f"{n} Hz", {"A": 0.0})["A"] * shapes[n] for n in shapes), 0.0 * T)

    effects = [Candidate(f"{n} Hz", (HEIGHT,)) for n in shapes]
    truth = {"5 Hz": {"A": 5.0}, "7 Hz": {"A": 3.8}, "9 Hz": {"A": 3.5}}
    verdict = diagnosed(predict, truth, *effects, seed=seed)
    assert (verdict.verdict, {e.name for e in verdict.effects}) == ("named", set(truth))


@pytest.mark.parametrize("turn_deg", [11.5, 17.0, 23.0])
def test_an_alternative_to_a_strong_effect_is_found_though_its_probe_points_elsewhere(turn_deg):
    """Probed at 1 N it has turned away from the data; at 0.5 N, its size there, it is the same."""
    shapes = lines(5, 7)

    def predict(settings):
        size = settings.get("turning", {"a": 0.0})["a"] / 0.5
        force = size * turned_towards(shapes[5], shapes[7], math.radians(turn_deg) * (size - 1))
        return force + settings.get("plain", {"A": 0.0})["A"] * shapes[5]

    turning = Candidate("turning", (Parameter("a", "N", 0, 3, (1.0,)),))
    plain = Candidate("plain", (HEIGHT,))
    (effect,) = diagnosed(predict, {"plain": {"A": 1.0}}, turning, plain).effects
    assert {effect.name, *effect.indistinguishable_from} == {"plain", "turning"}
