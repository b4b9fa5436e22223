"""Fixes pass their checks and keep every byte that is not theirs."""

import pytest

import mopro
from helpers.paths import ROOT
from mopro.language import source_from_bytes
from mopro.lint import Settings, check
from mopro.lint import lint as findings_of
from mopro.lint.check import applied, fixed, subject_of
from mopro.lint.rules import RULES
from mopro.motion import plan
from mopro.source import Source

READY = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"


def fix(text, **settings):
    return fixed(Source("x.CMD", text), Settings(**settings)).text


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("VELO 1.0\r\nacco 2.0", "VEL0 1.0\r\nacc0 2.0"),
        (":B1 ; keep\nWT1\n", " ; keep\nWT1\n"),
        (READY + "MRI1 8.0 ; a\nMRI1 -8.0 ; b\nWX1\n",
         READY + "MRI1 8.0 ; a\nWX1\nMRI1 -8.0 ; b\nWX1\n"),
        (READY + "MRI1 15.0", READY + "MRI1 15.0\nWX1"),
        (READY + "MR1 8.0\r\nMR2 4.0\r\nGO\r\nMRI2 1.0\r\nWX0\r\n",
         READY + "MR1 8.0\r\nMR2 4.0\r\nGO\r\nWX2\r\nMRI2 1.0\r\nWX0\r\n"),
        (READY + "MRI1 0.0001\nWX1\n", READY + "MRI1 0.00008\nWX1\n"),
    ],
)  # fmt: skip
def test_each_fix(before, after):
    assert fix(before) == after
    assert fix(after) == after


def test_a_fix_that_would_fail_its_check_is_left_out():
    """The places 1.25, 2.5 and 3.75 round to 1, 2 and 4: three single microsteps end at 3."""
    text = READY + "MRI1 0.0001\nWX1\n" * 3
    before, after = mopro.compile(text), mopro.compile(fix(text))
    assert before != after
    assert len(findings_of(Source("x", fix(text)))) > 0
    strokes = [[m.strokes for m in plan(p).moves] for p in (before, after)]
    assert strokes[0] == strokes[1]


def checks_of(monkeypatch, text, **bounds):
    """The fixed text, and how many programs were compiled to check fixes."""
    compiled = []
    for name, value in bounds.items():
        monkeypatch.setattr(check, name, value)
    monkeypatch.setattr(check, "subject_of", lambda *a: compiled.append(a) or subject_of(*a))
    return fix(text), len(compiled)


# Each pair returns to where it began; the three moves after them are those of the test above.
ONE_FAILS = READY + "MRI1 0.0001\nWX1\nMRI1 -0.0001\nWX1\n" * 32 + "MRI1 0.0001\nWX1\n" * 3


def test_fixes_that_fail_together_are_bisected(monkeypatch):
    better, compiled = checks_of(monkeypatch, ONE_FAILS)
    assert better.count("0.00008") > 60
    strokes = [[m.strokes for m in plan(mopro.compile(t)).moves] for t in (ONE_FAILS, better)]
    assert strokes[0] == strokes[1]
    assert compiled < 67  # fixes; one by one each took two


def test_the_work_on_failing_fixes_is_bounded(monkeypatch):
    assert checks_of(monkeypatch, ONE_FAILS, _MOST_CHECKED=1) == (ONE_FAILS, 2)


def test_every_rule_with_a_fix_check_has_a_fix_in_its_example():
    for rule in RULES.values():
        if rule.fix_check:
            assert fix(rule.bad) != rule.bad


def test_fix_keeps_code_page_and_ctrl_z(lint, tmp_path):
    path = tmp_path / "old.CMD"
    path.write_bytes(b";\xc9\xcd\xbb\r\nVELO 1.0 ;\x80\r\n\x1ajunk\xff")
    done = lint("--fix", path)
    assert (done.returncode, done.stdout.count(b"[text-after-end]")) == (1, 1)
    assert path.read_bytes() == b";\xc9\xcd\xbb\r\nVEL0 1.0 ;\x80\r\n\x1ajunk\xff"


def test_diff_shows_and_changes_nothing(lint, tmp_path):
    path = tmp_path / "old.CMD"
    path.write_bytes(b"VELO 1.0\r\n")
    done = lint("--diff", path)
    assert done.returncode == 1
    assert b"-VELO 1.0" in done.stdout
    assert b"+VEL0 1.0" in done.stdout
    assert path.read_bytes() == b"VELO 1.0\r\n"


def test_fix_of_standard_input_goes_to_standard_output(lint):
    done = lint("--fix", "-", stdin=b"VELO 1.0\n")
    assert (done.returncode, done.stdout) == (0, b"VEL0 1.0\n")


def test_fixed_listing_means_the_same():
    data = (ROOT / "programs" / "TEMP2.CMD").read_bytes()
    source = source_from_bytes(data, "TEMP2.CMD")
    better = fixed(source, Settings())
    assert better.text == source.text.replace("VELO", "VEL0").replace("ACCO", "ACC0")
    assert mopro.compile(better.text) == mopro.compile(source.text)
    assert findings_of(better) == []


def test_applied_puts_line_ends_of_the_file():
    source = Source("x", READY.replace("\n", "\r\n") + "MRI1 15.0\r\n")
    assert applied(source, findings_of(source)).text.endswith("MRI1 15.0\r\nWX1\r\n")
