"""Effects of installed packages: a package that does not work is named."""

import sys
from importlib.metadata import EntryPoint

import pytest

from mopro.effects.registry import ENTRY_POINTS, catalogue
from mopro.errors import MoproError


def refusal(monkeypatch, value):
    point = EntryPoint("mine", value, ENTRY_POINTS)
    monkeypatch.setattr("mopro.effects.registry.entry_points", lambda group: [point])
    with pytest.raises(MoproError) as caught:
        catalogue.__wrapped__()
    return caught.value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import not_there_at_all\n", "ModuleNotFoundError: No module named 'not_there_at_all'"),
        ("def broken(:\n", "SyntaxError"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("", "AttributeError"),
        ("from mopro.effects.effect import Effect\nclass Mine(Effect):\n    def __init__(self):\n"
         "        raise ValueError('no')\n", "ValueError: no"),
    ],
)  # fmt: skip
def test_a_package_that_cannot_be_loaded_is_named(monkeypatch, tmp_path, text, reason):
    (tmp_path / "their_effects.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "their_effects", raising=False)
    error = refusal(monkeypatch, "their_effects:Mine")
    assert error.rule == "bad-effect"
    assert "mine = their_effects:Mine of a package cannot be loaded" in str(error)
    assert reason in str(error)


def test_what_is_no_effect_is_named(monkeypatch):
    assert "expected a subclass of Effect" in str(refusal(monkeypatch, "json:loads"))
