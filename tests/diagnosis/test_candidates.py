"""How a candidate may be stated: angles, corners, forms, searches of its own, sizes that bend."""

import math

import numpy as np
import pytest

import mopro
from mopro.diagnosis import Candidate, Parameter, Role, Series
from mopro.diagnosis.spectrum import position_spectrum

T = np.arange(600) / 600
PLACE = np.sin(2 * np.pi * 3 * T)
SIGMA = 0.1
EVEN = (2, 4, 6, 8, 10, 12, 14, 16)


def asked(predict, truth, *candidates, seed=0):
    """The verdict on two runs of `predict` with `truth` in them."""
    rng = np.random.default_rng(seed)
    runs = [predict(truth) + SIGMA * rng.standard_normal(len(T)) for _ in range(2)]
    data = [
        Series(f"run {i}", "force", "N", run, SIGMA, T, np.arange(len(T)) // 100 + 10 * i,
               labels={"position": PLACE})
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
    (effect,) = asked(predict, {"wave": {"A": 0.2, "phi": phi}}, wave).effects
    found = effect.parameters["phi"].value
    assert abs(math.remainder(found - phi, 2 * math.pi)) < 0.15
    assert -math.pi <= found <= math.pi
    assert effect.parameters["A"].value == pytest.approx(0.2, abs=0.03)


def test_an_angle_whose_answer_is_no_mirror_image_is_tried_at_each_of_its_starts():
    """Half a turn on it is another shape, of which probes at 0 and a quarter tell nothing."""

    def predict(settings):
        wave = settings.get("wave", {"A": 0.0, "phi": 0.0})
        there, back = max(math.cos(wave["phi"]), 0.0), max(-math.cos(wave["phi"]), 0.0)
        shape = there * np.sin(2 * np.pi * 7 * T) + back * np.sin(2 * np.pi * 11 * T)
        return wave["A"] * (shape + math.sin(wave["phi"]) * np.sin(2 * np.pi * 5 * T))

    def verdict(*starts):
        angle = Parameter("phi", "rad", -math.pi, math.pi, starts, Role.PHASE)
        wave = Candidate("wave", (Parameter("A", "N", 0, 1, (0.1,)), angle))
        return asked(predict, {"wave": {"A": 0.2, "phi": math.pi}}, wave)

    assert not verdict().effects
    (effect,) = verdict(0.0, math.pi).effects
    found = effect.parameters["phi"].value
    assert abs(math.remainder(found - math.pi, 2 * math.pi)) < 0.15


def test_a_corner_that_acts_by_its_inverse_is_found_from_afar():
    def predict(settings):
        corner = settings.get("corner", {"f": math.inf})["f"]
        return np.cos(2 * np.pi * 2 * T) * 100 / corner

    f = Parameter("f", "Hz", 50, 1e6, (5000.0,), inverse=True, null=math.inf)
    (effect,) = asked(predict, {"corner": {"f": 200.0}}, Candidate("corner", (f,))).effects
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
    verdict = asked(drag, {"drag": {"b": 1.0, "n": n}}, linear, square)
    (effect,) = verdict.effects
    assert (effect.name, effect.form) == ("drag", form)
    assert effect.indistinguishable_from == []
    assert verdict.settings["drag"]["n"] == n


@pytest.mark.parametrize(("n", "form"), [(1.0, ""), (1.4, "any power")])
def test_a_form_is_freed_further_only_where_that_pays(n, form):
    plain = Candidate("drag", (B,), fixed={"n": 1.0})
    power = Parameter("n", "1", 0.2, 3.0, (1.0,), Role.SHAPE)
    freed = Candidate("drag", (B, power), "any power", refines="")
    (effect,) = asked(drag, {"drag": {"b": 1.0, "n": n}}, plain, freed).effects
    assert effect.form == form
    if form:
        assert effect.parameters["n"].value == pytest.approx(n, abs=0.1)


def test_a_candidate_may_look_for_itself_and_hold_what_it_found():
    def predict(settings):
        step = settings.get("step", {"height": 0.0, "at": 0.5})
        return step["height"] * (step["at"] < T)

    def seek(left):
        means = [r.cumsum() for r in left.residuals]
        at = int(np.argmax(np.abs(sum(means))))
        yield {"at": float(T[at] + T[at + 1]) / 2, "height": 0.3}

    height = Parameter("height", "N", -2, 2)
    at = Parameter("at", "s", 0, 1, role=Role.HELD)
    step = Candidate("step", (height, at), seek=seek)
    (effect,) = asked(predict, {"step": {"height": -0.4, "at": 0.3712}}, step).effects
    assert effect.parameters["at"].value == pytest.approx(0.3712, abs=2 / 600)
    assert effect.parameters["height"].value == pytest.approx(-0.4, abs=0.03)
    assert not asked(predict, {}, step).effects


def test_what_a_candidate_found_for_itself_is_not_resized_where_it_bends():
    """A detuned line of three times the size asks for more, and is further off then."""

    def predict(settings):
        size = settings.get("detuned", {"size": 0.0})["size"]
        return size * np.sin(2 * np.pi * (8 + 2 * size) * T)

    size = Parameter("size", "N", 0, 5)
    detuned = Candidate("detuned", (size,), seek=lambda left: [{"size": 1.9}])
    (effect,) = asked(predict, {"detuned": {"size": 2.0}}, detuned).effects
    assert effect.parameters["size"].value == pytest.approx(2.0, abs=0.05)


def test_a_candidate_may_find_what_its_range_does_not_allow():
    """Only forth, where the data ask for back: it does not join, and nothing breaks."""

    def predict(settings):
        height = settings.get("hill", {"height": 0.0})["height"]
        # Another way through a simulation ends in other last digits.
        return (height + 1e-12 * ("hill" in settings)) * np.sin(2 * np.pi * 8 * T)

    height = Parameter("height", "N", 0, 5)
    forth = Candidate("hill", (height,), seek=lambda left: [{"height": 1.0}])
    verdict = asked(predict, {"hill": {"height": -0.5}}, forth)
    assert (verdict.verdict, verdict.effects) == ("unexplained", ())


def test_a_response_that_bends_is_looked_at_again_at_its_own_size():
    """Probed at a radian, where the sine has turned back, and hidden at a twentieth."""

    def predict(settings):
        turned = settings.get("turned", {"angle": 0.0})["angle"]
        return np.sin(2 * np.pi * 3 * T + 3 * turned) - np.sin(2 * np.pi * 3 * T)

    angle = Parameter("angle", "rad", -0.4, 0.4, (0.3,))
    (effect,) = asked(
        predict, {"turned": {"angle": 0.01}}, Candidate("turned", (angle,)), seed=3
    ).effects
    low, high = effect.parameters["angle"].ci95
    assert low < 0.01 < high


def test_twins_come_as_each_others_rivals():
    def predict(settings):
        total = sum(settings.get(n, {"b": 0.0})["b"] for n in ("one", "other"))
        return total * np.cos(2 * np.pi * 3 * T)

    (effect,) = asked(
        predict, {"one": {"b": 1.0}}, Candidate("one", (B,)), Candidate("other", (B,))
    ).effects
    assert {effect.name, *effect.indistinguishable_from} == {"one", "other"}
    (settings,) = effect.alternatives.values()
    assert next(iter(settings.values()))["b"] == pytest.approx(1.0, abs=0.05)


def test_an_effect_too_small_to_be_seen_is_below_resolution_and_others_are_not():
    def predict(settings):
        sizes = {n: settings.get(n, {"b": 0.0})["b"] for n in ("faint", "plain")}
        return (1e-4 * sizes["faint"] + sizes["plain"]) * np.cos(2 * np.pi * 3 * T)

    verdict = asked(predict, {}, Candidate("faint", (B,)), Candidate("plain", (B,)))
    (faint,) = verdict.below_resolution
    # 5 units of 1e-4 N over sqrt(600) samples of a cosine's rms.
    expected = 5e-4 * math.sqrt(600) / SIGMA
    assert faint.name == "faint"
    assert faint.expected_sigmas == pytest.approx(expected, rel=0.01)
    assert [r.name for r in verdict.rejected] == ["plain"]


def test_a_value_clearly_out_of_what_is_plausible_speaks_against_an_effect():
    tight = Candidate("drag", (Parameter("b", "N", 0, 5, (0.5,), plausible=(0, 0.2)),),
                      fixed={"n": 1.0})  # fmt: skip

    def predict(settings):
        renamed = dict(settings)
        if "other" in renamed:
            renamed["drag"] = {"b": renamed.pop("other")["b"], "n": 1.0}
        return drag(renamed)

    (effect,) = asked(
        predict, {"drag": {"b": 1.0, "n": 1.0}}, tight, Candidate("other", (B,))
    ).effects
    assert (effect.name, effect.indistinguishable_from) == ("other", [])


class TestPositionSpectrum:
    def test_white_noise_has_the_power_one(self):
        rng = np.random.default_rng(1)
        x, z = 0.2 * rng.random(20_000), rng.standard_normal(20_000)
        _, power = position_spectrum([x], [z], 1e-4)
        assert power.mean() == pytest.approx(1.0, abs=0.1)

    def test_a_line_is_where_its_period_says(self):
        rng = np.random.default_rng(2)
        runs = [np.sort(0.2 * rng.random(5000)) for _ in range(2)]
        seen = [np.sin(2 * np.pi * x / 1.7e-3 + i) for i, x in enumerate(runs)]
        cycles, power = position_spectrum(runs, seen, 5e-4)
        assert 1 / cycles[np.argmax(power)] == pytest.approx(1.7e-3, rel=5e-3)
        assert power.max() == pytest.approx(2 * 5000 / 4, rel=0.1)

    def test_a_way_shorter_than_the_finest_period_has_no_lines(self):
        x = np.linspace(0.0, 2e-5, 50)
        cycles, power = position_spectrum([x], [np.sin(x)], 1e-4)
        assert (len(cycles), len(power)) == (0, 0)


@pytest.mark.parametrize("seed", range(4))
def test_an_effect_that_another_form_makes_superfluous_is_not_named(seed):
    """A cubic about a place of its own is a cubic, a parabola and a slope about any other."""

    def predict(settings):
        cubic = settings.get("cubic", {"c": 0.0, "middle": 0.0})
        powers = (settings.get(f"x{n}", {"s": 0.0})["s"] * PLACE**n for n in EVEN)
        return cubic["c"] * (PLACE - cubic["middle"]) ** 3 + sum(powers)

    c = Parameter("c", "N", -10, 10, (1.0,))
    middle = Parameter("middle", "1", -0.9, 0.9, (0.0,), Role.SHAPE)
    plain = Candidate("cubic", (c,), fixed={"middle": 0.0})
    freed = Candidate("cubic", (c, middle), "middle fitted", refines="")
    powers = [Candidate(f"x{n}", (Parameter("s", "N", -10, 10, (1.0,)),)) for n in EVEN]
    truth = {"cubic": {"c": 1.0, "middle": 0.08}}
    (effect,) = asked(predict, truth, plain, freed, *powers, seed=seed).effects
    assert (effect.name, effect.form) == ("cubic", "middle fitted")
    assert effect.parameters["middle"].value == pytest.approx(0.08, abs=0.02)


@pytest.mark.parametrize("by_itself", [False, True])
def test_a_freed_form_may_come_by_itself_where_the_plain_one_explains_nothing(by_itself):
    """A line at 7 Hz says nothing of one at 11 Hz."""

    def predict(settings):
        line = settings.get("line", {"A": 0.0, "f": 7.0})
        return line["A"] * np.sin(2 * np.pi * line["f"] * T)

    height = Parameter("A", "N", -1, 1, (0.1,))
    hertz = Parameter("f", "Hz", 5.0, 13.0, (7.0, 10.8), Role.SHAPE)
    plain = Candidate("line", (height,), fixed={"f": 7.0})
    freed = Candidate("line", (height, hertz), "any f", refines="", by_itself=by_itself)
    found = asked(predict, {"line": {"A": 0.2, "f": 11.0}}, plain, freed)
    assert [e.form for e in found.effects] == (["any f"] if by_itself else [])


def test_forms_free_more_only_where_the_rest_is_the_same():
    b, n, m = (Parameter(name, "1", 0.0, 3.0, (1.0,)) for name in "bnm")
    plain = Candidate("drag", (b,), fixed={"n": 1.0, "m": 0.0})
    power = Candidate("drag", (b, n), "power", {"m": 0.0}, refines="")
    both = Candidate("drag", (b, n, m), "both", refines="power")
    assert power.frees_more_than(plain)
    assert both.frees_more_than(plain)
    assert both.frees_more_than(power)
    assert not plain.frees_more_than(power)
    assert not plain.frees_more_than(plain)
    elsewhere = Candidate("drag", (b, n), "power, there", {"m": 0.0, "axis": 2.0}, refines="")
    assert not elsewhere.frees_more_than(plain)
    assert not Candidate("lift", (b, n), "power", {"m": 0.0}).frees_more_than(plain)


@pytest.mark.parametrize("beside", [False, True])
def test_one_effect_whose_response_turns_is_not_told_as_several(beside):
    """Of the size that is there it looks like three others, where it is probed like none."""
    shapes = {n: np.sin(2 * np.pi * n * T) for n in (4, 5, 7, 9, 11)}

    def predict(settings):
        size = settings.get("turning", {"a": 0.0})["a"]
        angle = 1.45 * (size - 0.5)
        three = (shapes[5] + shapes[7] + shapes[9]) / math.sqrt(3)
        force = 2 * size * (math.cos(angle) * three + math.sin(angle) * shapes[11])
        lines = (settings.get(f"{n} Hz", {"A": 0.0})["A"] * shapes[n] for n in (4, 5, 7, 9))
        return force + sum(lines)

    turning = Candidate("turning", (Parameter("a", "N", 0, 3, (1.0,)),))
    height = Parameter("A", "N", -3, 3, (0.1,))
    lines = [Candidate(f"{n} Hz", (height,)) for n in (4, 5, 7, 9)]
    truth = {"turning": {"a": 0.5}} | ({"4 Hz": {"A": 0.6}} if beside else {})
    found = asked(predict, truth, turning, *lines)
    assert {e.name for e in found.effects} == set(truth)
    assert found.verdict == "named"


def test_a_rival_whose_response_bends_is_looked_at_where_it_would_stand():
    """Where it is probed it promises 96 of 100 parts, too few for so strong an effect."""
    shapes = [np.sin(2 * np.pi * n * T) for n in (5, 7)]

    def predict(settings):
        size = settings.get("turning", {"a": 0.0})["a"]
        angle = 0.4 * (size - 0.5)
        force = 2 * size * (math.cos(angle) * shapes[0] + math.sin(angle) * shapes[1])
        return force + settings.get("plain", {"A": 0.0})["A"] * shapes[0]

    turning = Candidate("turning", (Parameter("a", "N", 0, 3, (1.0,)),))
    plain = Candidate("plain", (Parameter("A", "N", -3, 3, (0.1,)),))
    (effect,) = asked(predict, {"plain": {"A": 1.0}}, turning, plain).effects
    assert {effect.name, *effect.indistinguishable_from} == {"plain", "turning"}


def test_two_effects_that_hide_each_other_are_found_beside_a_stronger_one():
    """Each takes away less than it leaves, and both leave nothing."""
    shapes = {n: np.sin(2 * np.pi * n * T) for n in (5, 7, 9)}
    apart = math.radians(114)
    shapes[9] = math.cos(apart) * shapes[7] + math.sin(apart) * shapes[9]

    def predict(settings):
        return sum((settings.get(f"{n} Hz", {"A": 0.0})["A"] * shapes[n] for n in shapes), 0.0 * T)

    height = Parameter("A", "N", -9, 9, (0.1,))
    effects = [Candidate(f"{n} Hz", (height,)) for n in shapes]
    truth = {"5 Hz": {"A": 5.0}, "7 Hz": {"A": 3.8}, "9 Hz": {"A": 3.5}}
    found = asked(predict, truth, *effects)
    assert (found.verdict, {e.name for e in found.effects}) == ("named", set(truth))
