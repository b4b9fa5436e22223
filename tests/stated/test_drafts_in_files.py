"""Drafts in a machine file (--with-drafts), and what such a file predicts of an unseen run."""

import json
from types import SimpleNamespace

import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, drive_folder
from mopro.engine.residuals import NOTHING_LEFT
from mopro.engine.verdict import Draft, Estimate, Gap, Verdict
from mopro.experiment.conclusion import drafted_in
from mopro.formula.written import EffectParameter, Written, WrittenEffect

NAME = "friction of |x|, unconfirmed"


@pytest.mark.parametrize("beside", [True, False])
def test_a_draft_that_would_do_in_place_of_the_answer_is_in_no_file(beside):
    draft = Draft("force of x", "force", "x", "2 * x", "N", 9.0, True, None,
                  {"c": Estimate(2.0, "N/m", (1.0, 3.0), at_bound=False)})  # fmt: skip
    gap = Gap("m", 2.0, 1.0, 1.0, None)
    word = "unexplained" if beside else "ambiguous"
    verdict = Verdict(word, (), (), (), (), gap, NOTHING_LEFT, {},
                      drafts=(draft,), without_drafts={} if beside else None)  # fmt: skip
    term = WrittenEffect(
        "force of x", "force", "", Written.of("c * x"), (EffectParameter("c", "N/m"),)
    )
    system = SimpleNamespace(terms={"force of x": term}, beside=lambda source: source.text)
    found = drafted_in(system, verdict)
    assert (found is not None) is beside
    if found is not None:
        assert "c * x" in found[0]
        assert found[1].settings == {"force of x, unconfirmed": {"c": 2.0}}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folders of two runs of a drive with a friction of the place that nobody listed."""
    seen, unseen = (tmp_path_factory.mktemp(name) for name in ("seen", "unseen"))
    drive_folder(seen, DRIVE, of_place=12.0)
    drive_folder(unseen, DRIVE, of_place=12.0, seed=7)
    return seen, unseen


@pytest.fixture(scope="module")
def said(folders):
    """Terminal output of the commands that write plain.toml, and new.toml with drafts."""
    return repaired(folders[0], "plain.toml"), repaired(folders[0], "new.toml", "--with-drafts")


def repaired(folder, out, *options):
    asked = "reconcile", "experiment.toml", "--only", "dry_friction", "--out", out, *options
    done = run_here(folder, *asked)
    assert done.returncode == 1, done.stderr
    return done.stdout


def test_a_draft_is_in_the_file_if_it_is_asked_for_and_says_that_nobody_confirmed_it(folders, said):
    plain, new = ((folders[0] / name).read_text("utf-8") for name in ("plain.toml", "new.toml"))
    assert "unconfirmed" not in plain
    assert "(--with-drafts writes those inside the model)" in said[0]
    assert (
        f'name = "{NAME}"\nenters = "friction"\nformula = "c * abs(x)"\nunconfirmed = true' in new
    )
    assert f'[effects."{NAME}"]' in new
    assert f"The machine file has {NAME}: compare it with a run that it has not seen." in said[1]


@pytest.mark.usefixtures("said")
def test_the_file_with_the_draft_predicts_another_run_to_its_noise(folders):
    seen, unseen = folders
    done = run_here(unseen, "compare", "experiment.toml", "--apply", seen / "new.toml", "--json")
    (gap,) = json.loads(done.stdout)["applied"]
    assert gap["after_rms"] < 1.1 * gap["noise_rms"] < 0.5 * gap["before_rms"]


@pytest.mark.usefixtures("said")
def test_the_file_with_the_draft_is_a_machine_to_begin_another_diagnosis_with(folders, tmp_path):
    seen, unseen = folders
    text = (unseen / "experiment.toml").read_text("utf-8")
    first, _, rest = text.partition("\n")
    assert first.startswith("machine = ")
    (tmp_path / "experiment.toml").write_text(f'machine = "{seen / "new.toml"}"\n{rest}')
    for file in unseen.glob("*.csv"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--only", "dry_friction", "--json")
    assert json.loads(done.stdout)["verdict"] == "none"
