"""Settings come from the nearest file; what cannot be used is told at its place."""

import pytest

from mopro.errors import ModelError
from mopro.lint.config import find_settings

PAYLOAD = "UU012500/1\nVEL1 40.0\nPARA1+\nACC1 0.6\nMRI1 15.0\nWX1\n"


def test_the_nearest_file_wins_and_mopro_toml_needs_no_header(tmp_path):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text('[tool.mopro]\npayload = "5lb"\n')
    assert find_settings(inner).payload_kg == pytest.approx(2.26796)
    (tmp_path / "a" / "pyproject.toml").write_text("[tool.other]\nx = 1\n")
    assert find_settings(inner).payload_kg == pytest.approx(2.26796)
    (tmp_path / "a" / "mopro.toml").write_text('payload = 1.5\nmachine = "mine.toml"\n')
    settings = find_settings(inner)
    assert (settings.payload_kg, settings.machine) == (1.5, str(tmp_path / "a" / "mine.toml"))
    (inner / "mopro.toml").write_text(
        '[tool.mopro]\nselect = ["stall"]\nlow-margin = "30 %"\n'
        'start = { 1 = "-5 in" }\ntravel = { 2 = "20 in" }\n'
    )
    settings = find_settings(inner)
    assert settings.select == {"stall"}
    assert settings.low_margin == pytest.approx(0.3)
    assert (settings.start_m, settings.travel_m) == ({1: pytest.approx(-0.127)}, {2: 0.508})


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("payload = 1\nmashine = 'x'\n", "2:1", "unknown key"),
        ("payload = '5 in'\n", "1:1", "mass"),
        ("payload = -1\n", "1:1", "at least 0"),
        ("[tool.mopro]\nselect = ['stal']\n", "2:1", "did you mean stall"),
        ("start = { 3 = '1 in' }\n", "1:1", "each axis"),
        ("grammar = 'x'\n", "1:1", "attested"),
        ("ignore = 'stall'\n", "1:1", "list"),
        ("machine = 1\n", "1:1", "string"),
        ("= 1\n", "1:1", "cannot be read"),
    ],
)
def test_unusable_settings_are_told_at_their_place(tmp_path, text, place, words):
    (tmp_path / "mopro.toml").write_text(text)
    with pytest.raises(ModelError) as caught:
        find_settings(tmp_path)
    (found,) = caught.value.diagnostics
    assert (str(found.span), found.rule) == (place, "bad-settings")
    assert words in found.message


def test_payload_of_the_file_and_of_the_command_line(lint, tmp_path):
    path = tmp_path / "p.CMD"
    path.write_text(PAYLOAD)
    assert lint(path).returncode == 0
    (tmp_path / "mopro.toml").write_text('payload = "5lb"\n')
    assert b"[low-margin]" in lint(path).stdout
    assert lint("--payload", "0kg", path).returncode == 0
    assert lint("--ignore", "low-margin", path).returncode == 0
    (tmp_path / "mopro.toml").write_text("payload = 'much'\n")
    done = lint(path)
    assert done.returncode == 2
    assert b"[bad-settings]" in done.stderr


def test_start_and_travel_move_the_limits(lint, tmp_path):
    path = tmp_path / "p.CMD"
    path.write_text("UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 15.0\nWX1\n")
    assert lint(path).returncode == 0
    (tmp_path / "mopro.toml").write_text('start = { 1 = "10 in" }\n')
    assert b"[limit-switch]" in lint(path).stdout
    (tmp_path / "mopro.toml").write_text('travel = { 1 = "14 in" }\n')
    assert b"[off-travel]" in lint(path).stdout


def test_all_findings_of_the_settings_come_at_once(tmp_path):
    (tmp_path / "mopro.toml").write_text("mashine = 'x'\npayload = -1\nselect = ['stal']\n")
    with pytest.raises(ModelError) as caught:
        find_settings(tmp_path)
    assert [d.span.line for d in caught.value.diagnostics] == [1, 2, 3]
    assert "did you mean `machine`?" in str(caught.value)
