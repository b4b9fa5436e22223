"""The example of the docs prints what the docs show."""

import shutil

from helpers.paths import PROGRAMS, ROOT


def fenced(text, language):
    return text.split(f"```{language}\n")[1].split("```")[0]


def test_the_example_prints_what_the_docs_show(tmp_path, mopro):
    text = (ROOT / "docs" / "experiments.md").read_text()
    shutil.copy(PROGRAMS / "LVDT3.CMD", tmp_path)
    (tmp_path / "experiment.toml").write_text(fenced(text, "toml"))
    done = [mopro(*line.split()[1:]) for line in fenced(text, "sh").splitlines()]
    assert [(d.returncode, d.stderr) for d in done] == [(0, ""), (1, "")]
    printed = "".join(d.stdout for d in done).splitlines()
    assert [line.split() for line in printed if line.strip()] == [
        line.split() for line in fenced(text, "text").splitlines() if line.strip()
    ]
