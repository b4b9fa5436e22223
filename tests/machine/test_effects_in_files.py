"""Effects and options in machine files: read, checked, each fault at its line."""

from importlib import resources

import pytest

from mopro.effects import catalogue
from mopro.effects.resolve import active_effects
from mopro.errors import MOST_SHOWN, ModelError
from mopro.machine.file import read_machine
from mopro.source import Source

TEXT = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()


def active(extra, text=TEXT):
    return active_effects(read_machine(Source("m.toml", text + extra)), catalogue())


def faults(extra, text=TEXT):
    whole = text + extra
    with pytest.raises(ModelError) as caught:
        active(extra, text)
    lines = whole.splitlines()
    return [(d.rule, lines[d.span.line - 1].strip(), d.hint) for d in caught.value.diagnostics]


def test_a_bare_number_has_the_effects_unit():
    (drag,) = active("[effects.viscous_drag]\nb = 9.0\n")
    assert (drag.name, drag.values, drag.axes) == ("viscous_drag", (9.0,), (1, 2))


def test_units_axes_and_defaults():
    extra = (
        "[effects.current_loop_lag]\n"
        'tau = { value = 120, unit = "us", origin = "measured", place = "bench" }\n'
        "axes = [2]\n[effects.coulomb_friction]\nFc = 4\n"
    )
    friction, lag = active(extra)
    assert friction.values == (4.0, 5e-6)
    assert lag.values == pytest.approx((120e-6,))
    assert lag.axes == (2,)


def test_a_full_drive_is_voltage_saturation_at_its_supply():
    text = TEXT.replace("[platen]", 'model = "full"\n\n[platen]')
    (found,) = active("", text)
    assert (found.name, found.values) == ("voltage_saturation", (75.0,))
    assert [a.values for a in active("[effects.voltage_saturation]\nVb = 40\n", text)] == [(40.0,)]


@pytest.mark.parametrize(
    ("extra", "rule", "line", "hint"),
    [
        ("[effects.viscous_darg]\nb = 1\n", "unknown-effect", "[effects.viscous_darg]",
         "did you mean `viscous_drag`?"),
        ("[effects.coulomb_friction]\nfc = 1\n", "unknown-parameter", "fc = 1",
         "did you mean `Fc`?"),
        ("[effects.viscous_drag]\nb = -1\n", "bad-value", "b = -1", "it is drag"),
        ("[effects.viscous_drag]\nb = nan\n", "bad-value", "b = nan", "it is drag"),
        ("[effects.lost_steps]\nn = 1.5\n", "bad-value", "n = 1.5", "it is pitches lost"),
        ('[effects.viscous_drag]\nb = { value = 1, unit = "N", origin = "measured" }\n',
         "wrong-unit", 'b = { value = 1, unit = "N", origin = "measured" }', None),
        ("[effects.viscous_drag]\nb = true\n", "bad-value", "b = true", None),
        ("[effects.viscous_drag]\nb = 1\naxes = [3]\n", "bad-value", "axes = [3]", None),
        ("[effects]\nviscous_drag = 5\n", "bad-value", "viscous_drag = 5", None),
        ("[forcers]\nstrenght_1 = 1\n", "unknown-key", "strenght_1 = 1",
         "did you mean `strength_1`?"),
    ],
)  # fmt: skip
def test_faults_stand_at_their_line(extra, rule, line, hint):
    assert faults(extra) == [(rule, line, hint)]


def test_a_drive_of_another_model_is_refused():
    text = TEXT.replace("[platen]", 'model = "fuller"\n\n[platen]')
    assert [f[:2] for f in faults("", text)] == [("bad-value", 'model = "fuller"')]


def test_names_are_suggested_for_as_many_findings_as_a_report_shows():
    found = faults("".join(f"[effects.viscous_darg{n}]\n" for n in range(MOST_SHOWN + 2)))
    hints = [hint for _, _, hint in found]
    assert hints == ["did you mean `viscous_drag`?"] * MOST_SHOWN + [None] * 2


def test_every_faulty_effect_is_told():
    extra = "[effects]\nviscous_drag = 5\ncoulomb_friction = 6\n"
    assert [(rule, line) for rule, line, _ in faults(extra)] == [
        ("bad-value", "viscous_drag = 5"),
        ("bad-value", "coulomb_friction = 6"),
    ]
