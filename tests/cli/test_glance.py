"""The answer at a glance of both kinds of machines: in the terminal, on the page, in the JSON."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.laboratory import DRAG, laboratory
from helpers.stated import DRIVE, DRIVEN, FRICTION_OF_PLACE, drive_folder, driven, write

ROW = re.compile(r"  (Effects|Gap, RMS|Cannot tell|Next)? +(\S.*)")


def rig(folder, machine=DRIVE, **hidden):
    drive_folder(folder, machine, length_s=2.0, **hidden)


def late(folder):
    """A drive whose force is logged a row, 20 ms, before it acts, in noise of 4 mm."""
    drive_folder(folder, experiment=DRIVEN.replace("0.2", "4.0"))
    columns = driven(4.0, noise=4.0)
    write(folder / "run.csv", {**columns, "force_N": np.append(columns["force_N"][1:], 0.0)})


# What is hidden in the data, the candidates, and what the answer says.
CASES = {
    "motor, nothing": (
        lambda folder: laboratory(folder, {}),
        ["viscous_drag", "hum"],
        ("none", "Nothing is to be repaired."),
    ),
    "motor, a drag": (
        lambda folder: laboratory(folder, DRAG),
        ["viscous_drag", "hum"],
        ("named", "viscous_drag: b = ", "N s/m (95 %: ", "held out within one run"),
    ),
    "motor, a drag in noise": (
        lambda folder: laboratory(folder, DRAG, noise=2e-4),
        ["viscous_drag", "current_loop_lag"],
        ("ambiguous", "current_loop_lag from viscous_drag (ΔEBIC", "Run the program under"),
    ),
    "motor, a bump": (
        lambda folder: laboratory(folder, {}, bump=1e-4),
        ["viscous_drag"],
        ("unexplained", "Not listed: a term of x", "without a repair", "Look for a cause"),
    ),
    "axis, nothing": (
        rig,
        ["dry_friction"],
        ("none", "Nothing is to be added: the machine file (--out) gets the numbers as fitted."),
    ),
    "axis, a friction of place": (
        lambda folder: rig(folder, DRIVE + FRICTION_OF_PLACE, of_place=30.0),
        ["friction of place"],
        ("named", "friction of place: F1 = ", "N/m (95 %: ", "mopro compare UNSEEN.toml"),
    ),
    "axis, a late force": (
        late,
        ["input_delay", "input_lag"],
        ("ambiguous", "(ΔEBIC", "may distinguish them."),
    ),
    "axis, an unlisted friction": (
        lambda folder: rig(folder, of_place=30.0),
        ["dry_friction"],
        ("unexplained", "Not listed: a term of x in the friction", "(--with-drafts --out"),
    ),
}


class Strip(HTMLParser):
    """Title, headings and lines of the strip of a page."""

    def __init__(self, text):
        super().__init__()
        self.title, self.labels, self.lines, self._at = "", [], [], None
        self.feed(text[: text.index("</header>")])

    def handle_starttag(self, tag, attributes):
        self._at = tag if tag in ("h1", "h2", "li") else self._at
        if tag in ("h2", "li"):
            (self.labels if tag == "h2" else self.lines).append("")

    def handle_endtag(self, tag):
        self._at = None if tag == self._at else self._at

    def handle_data(self, text):
        if self._at == "h1":
            self.title += text
        elif self._at:
            (self.labels if self._at == "h2" else self.lines)[-1] += text


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES)
def answered(request, tmp_path_factory):
    """The folder, options and expectation of a case, and its finished command with a page."""
    prepare, candidates, expected = request.param
    folder = tmp_path_factory.mktemp("case")
    prepare(folder)
    only = [word for name in candidates for word in ("--only", name)]
    done = run_here(folder, "reconcile", "experiment.toml", "--report", "why.html", *only)
    assert done.stderr == ""
    return folder, only, expected, done


def test_the_terminal_ends_with_it_and_the_page_begins_with_it(answered):
    folder, _, (verdict, *said), done = answered
    sentence, *lines = done.stdout.split("\n\n")[-1].splitlines()
    assert sentence.startswith(verdict.capitalize())
    assert done.stdout.count(sentence) == 1
    labels, words = zip(*(ROW.fullmatch(line).groups() for line in lines), strict=True)
    for each in said:
        assert any(each in line for line in words), each
    page = (folder / "why.html").read_text("utf-8")
    strip = Strip(page)
    assert strip.title == sentence
    assert strip.labels == list(filter(None, labels))
    assert strip.lines == list(words)
    assert page.count(strip.lines[-1]) == 1, "no fact twice"
    assert f'class="glance {verdict}"' in page


def test_what_was_rejected_is_told_to_those_who_ask(tmp_path):
    laboratory(tmp_path, DRAG)
    only = ("--only", "viscous_drag", "--only", "hum")
    done = run_here(tmp_path, "reconcile", "experiment.toml", *only, "--report", "why.html")
    assert "rejected" not in done.stdout
    assert re.search(r"<details><summary><h2>All candidates", (tmp_path / "why.html").read_text())
    explained = run_here(tmp_path, "reconcile", "experiment.toml", *only, "--explain").stdout
    assert re.search(r"^ *hum +rejected", explained, re.MULTILINE)
    ends = [text.split("\n\n")[-1] for text in (done.stdout, explained)]
    assert ends[0] == ends[1], "the answer stays last"
    answer = run_here(tmp_path, "reconcile", "experiment.toml", *only, "--json").stdout
    glance = json.loads(answer)["glance"]
    assert ends[0].startswith(glance["sentence"])
    for line in (*glance["effects"][0]["sizes"], *glance["beside"], *glance["next"]):
        assert line in ends[0]
