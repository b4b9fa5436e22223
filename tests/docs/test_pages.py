"""Every command, snippet and file of the docs, executed as it stands there."""

import numpy as np
import pytest

from helpers.pages import Reader, blocks_of
from helpers.paths import ROOT
from helpers.site import module_of_docs
from helpers.stated import driven, write

EXPANDED = module_of_docs("generated").expanded
PAGES = {
    path.relative_to(ROOT).as_posix(): blocks_of(path, EXPANDED)
    for path in [
        ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "examples" / "README.md",
        ROOT / "editors" / "vscode" / "README.md", *sorted((ROOT / "docs").glob("*.md")),
    ]
}  # fmt: skip
# Examples of `lint --explain`, which tests/lint/test_rules.py runs, and the help of commands.
ELSEWHERE = {"docs/lint.md", "docs/commands.md"}
# The two blocks that CI runs itself, before there is a mopro to be called.
OF_CI = {"README.md": 2}
# Blocks that are shown only, each with its reason in the fence.
MARKS = {
    "CONTRIBUTING.md": 1, "docs/blind.md": 1, "docs/cookbook.md": 1, "docs/diagnosis.md": 1,
    "docs/index.md": 1,
    "docs/link.md": 2, "docs/viewer.md": 2, "editors/vscode/README.md": 1, "examples/README.md": 1,
}  # fmt: skip


def executed(name):
    return PAGES[name][OF_CI.get(name, 0) :]


def write_drive(folder):
    """The measurements that docs/machines.md speaks of."""
    write(folder / "run.csv", driven(of_place=12.0))
    write(folder / "unseen.csv", driven(of_place=12.0, seed=5))
    (experiment,) = (b for b in PAGES["docs/machines.md"] if "experiment" in str(b.options))
    (folder / "unseen.toml").write_text(experiment.text.replace("run.csv", "unseen.csv"), "utf-8")


def write_log(folder):
    """The log that docs/logs.md speaks of: a servo that stands, moves and stands."""
    times = np.arange(3000) / 100.0
    target = np.clip(2.0 * (times - 10.0), 0.0, 20.0)
    measured = target + 0.02 * np.random.default_rng(1).standard_normal(len(times))
    write(folder / "log.csv", {"time_s": times, "target_mm": target, "pos_mm": measured})


PREPARED = {"docs/machines.md": write_drive, "docs/logs.md": write_log}


@pytest.mark.parametrize(
    "name",
    [name for name in PAGES if name not in ELSEWHERE and any(not b.marked for b in executed(name))],
)
def test_what_a_page_shows_happens(name, tmp_path):
    reader = Reader(tmp_path)
    PREPARED.get(name, lambda folder: None)(tmp_path)
    reader.follow(executed(name))
    assert reader.executed == sum(not block.marked for block in executed(name))


def test_marks_are_few_counted_and_have_a_reason():
    marked = {
        name: [block.options["not-run"] for block in executed(name) if block.marked]
        for name in PAGES.keys() - ELSEWHERE
    }
    assert {name: len(reasons) for name, reasons in marked.items() if reasons} == MARKS
    assert all(len(reason) > 5 for reasons in marked.values() for reason in reasons)


class TestReader:
    """The mechanism itself: what is wrong on a page fails."""

    @pytest.mark.parametrize(
        "text",
        [
            "```sh\nmopro nonsense\n```\n",
            "```sh exit=1\nmopro --version\n```\n",
            "```sh\nrm -rf x\n```\n",
            "```sh\ncd ..\n```\n",
            "```sh\nmopro --version\n```\n```text\nmopro, version nine\n```\n",
            "```python\nassert 1 == 2\n```\n",
            "```python\nprint('b'); print('a')\n```\n```text\na\nb\n```\n",
            "```cobol\nSTOP RUN.\n```\n",
        ],
    )
    def test_it_fails(self, text, tmp_path):
        page = tmp_path / "page.md"
        page.write_text(text)
        with pytest.raises(AssertionError):
            Reader(tmp_path / "folder").follow(blocks_of(page))

    def test_it_passes(self, tmp_path):
        page = tmp_path / "page.md"
        page.write_text(
            "```CMD file=p.CMD\nUU012500/1\nGO\n```\n```sh exit=0,2\nmopro compile p.CMD  # good\n"
            "mopro compile absent.CMD\n```\n```text\n 0  line 1  set_units ...\nabsent.CMD:1:1: "
            "cannot be read: ...\n```\n"
            "```python\nx = 2\n```\n```python\nprint(f'x is {x}')\n```\n```text\nx is 2\n```\n"
        )
        reader = Reader(tmp_path / "folder")
        reader.follow(blocks_of(page))
        assert reader.executed == 6
