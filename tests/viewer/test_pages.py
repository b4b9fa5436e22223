"""Parts of pages: the plotting library as it was published, scripts, data, tables."""

import base64
import hashlib
import json
import re
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.commands import run_here
from helpers.stated import DRIVE, FRICTION_OF_PLACE, drive_folder
from mopro.experiment.glance import Chain, Found, Glance, Step
from mopro.markup import table
from mopro.recording.moves import MoveReport
from mopro.viewer.glance import strip
from mopro.viewer.page import FOLDER, PLOTTER, SCRIPTS, data_block, document
from mopro.viewer.run import moves_json
from mopro.viewer.view import Lines, Pack, Scale

WRITES_MARKUP = re.compile(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(")


def test_the_plotting_library_is_the_published_one():
    stated = (PLOTTER / "VERSION").read_text("utf-8")
    assert stated.startswith("uPlot 1.6.32, MIT licence, https://registry.npmjs.org/uplot/")
    digests = dict(re.findall(r"sha256 (\w{64}) (\S+)", stated))
    assert set(digests.values()) == {"uPlot.iife.min.js", "uPlot.min.css"}
    for digest, name in digests.items():
        assert hashlib.sha256((PLOTTER / name).read_bytes()).hexdigest() == digest


def test_every_script_and_style_of_a_page_is_allowed_by_its_digest_and_no_other():
    page = document("title", [], [], [])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    found = re.findall(r"<(?:script|style)>(.*?)</(?:script|style)>", page, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(t.encode()).digest()).decode() for t in found]
    assert re.findall(r"sha256-([^&\s]+)&#x27;", policy) == [*digests[2:], *digests[:2]]
    assert "unsafe" not in policy
    assert "default-src &#x27;none&#x27;" in policy
    assert "connect-src &#x27;none&#x27;" in policy
    assert "Copyright (c) 2022 Leon Sorokin" in found[2], "the licence goes with the library"


@pytest.mark.parametrize("name", SCRIPTS)
def test_no_script_makes_markup_of_text(name):
    text = (FOLDER / name).read_text("utf-8")
    assert not WRITES_MARKUP.search(text)
    assert max(map(len, text.splitlines())) <= 100


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_no_text_ends_the_element_that_holds_the_data(text):
    block = data_block("d", {"a": text})
    inside = block.removeprefix('<script type="application/json" id="d">')
    inside = inside.removesuffix("</script>")
    assert "<" not in inside
    assert json.loads(inside) == {"a": text}


def test_columns_of_numbers_stand_to_the_right_and_words_to_the_left():
    text = table(["run", "size", "held"], [["a", "-3.1 mm", ""], ["b", "unknown", "–"]])
    rows = re.findall(r"<tr>(.*?)</tr>", text)
    assert rows[1] == '<td>a</td><td class="number">-3.1 mm</td><td></td>'
    assert rows[2] == '<td>b</td><td class="number">unknown</td><td>–</td>'
    assert '<th scope="row">seed</th><td>7</td>' in table((), [["seed", "7"]])


def test_a_page_tells_where_it_comes_from_in_words(tmp_path):
    done = run_here(tmp_path, "run", "P.CMD", "--emulate", "--report", "r.html",
                    text="UU012500/1\nVEL1 8\nACC1 .2\nMRI1 1\nWX1\n")  # fmt: skip
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "r.html").read_text("utf-8")
    assert '<th scope="row">effects</th><td>none</td>' in text
    assert re.search(r'<th scope="row">versions</th><td>python [\d.]+, mopro [\d.]+, numpy', text)
    assert "<h1>P.CMD on chow1992</h1>\n<p>1 move in" in text


def unpacked(pack, reference):
    if "step" in reference:
        return reference["start"] + reference["step"] * np.arange(reference["count"])
    block = zlib.decompress(base64.b64decode(pack.text()))
    kind = {"f32": "<f4", "f64": "<f8", "i32": "<i4"}[reference["type"]]
    assert reference["at"] % 8 == 0
    return np.frombuffer(block, kind, reference["count"], reference["at"])


def test_arrays_come_out_as_they_went_in():
    pack = Pack()
    arrays = [
        (np.array([1.5, np.nan, -2.0]), "f32"),
        (np.arange(5), "i32"),
        (np.pi * np.arange(7), "f64"),
    ]
    references = [pack.put(values, kind) for values, kind in arrays]
    for (values, _), reference in zip(arrays, references, strict=True):
        np.testing.assert_array_equal(unpacked(pack, reference), values)


def test_even_times_are_told_by_their_step_and_others_in_full():
    even, uneven = np.arange(1000) / 2000, np.array([0.0, 0.1, 0.3])
    pack = Pack()
    stated = pack.put_times(even)
    assert stated == {"start": 0.0, "step": pytest.approx(0.0005), "count": 1000}
    np.testing.assert_allclose(unpacked(pack, stated), even, atol=1e-12)
    np.testing.assert_array_equal(unpacked(pack, pack.put_times(uneven)), uneven)


def move(line, start_s, margin, lost=0):
    return MoveReport(
        line=line, axes=[1], profile="smooth", distance=2.0, unit="in", set_velocity=4.0,
        peak_velocity=4.0, acceleration=5.0, start_s=start_s, duration_s=1.0, max_lag=margin,
        stall_margin=margin, lost_pitches=lost, slipped=bool(lost), complete=True,
    )  # fmt: skip


def test_moves_of_a_line_are_one_row_with_the_worst_of_them():
    one, other = moves_json(
        [move(16, 0.0, 0.5), move(19, 1.0, None), move(16, 2.0, 0.2, -3), move(16, 3.0, 0.4)]
    )
    assert (one["line"], one["count"], one["margin"], one["lag"]) == (16, 3, 0.2, 0.5)
    assert (one["lost"], one["slipped"], one["metres"]) == (-3, 1, pytest.approx(0.0254))
    assert [each[0] for each in one["each"]] == [0.0, 2.0, 3.0]
    assert (other["line"], other["margin"]) == (19, None)


def test_the_line_that_runs_is_told_where_it_changes():
    lines = Lines.of(np.arange(6) / 10, np.array([4, 4, 7, 7, 7, 4]))
    assert lines.time_s.tolist() == [0.0, 0.2, 0.5]
    assert lines.line.tolist() == [4, 7, 4]


@pytest.mark.parametrize(
    ("unit", "scale"),
    [
        ("in", ("m", "length", 0.0254)), ("um", ("m", "length", 1e-6)), ("C", ("°C", "", 1.0)),
        ("V", ("V", "", 1.0)), ("no unit", ("no unit", "", 1.0)),
    ],
)  # fmt: skip
def test_units_that_a_person_switches_are_made_si(unit, scale):
    found = Scale.of(unit)
    assert (found.unit, found.dimension, found.factor) == pytest.approx(scale)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    drive_folder(folder, DRIVE + FRICTION_OF_PLACE, of_place=30.0, length_s=2.0)
    return folder


def test_compare_makes_a_page_with_both_machines(drive):
    done = run_here(drive, "compare", "experiment.toml", "--apply", "machine.toml", "--report",
                    "c.html")  # fmt: skip
    assert done.returncode == 1, done.stderr
    text = (drive / "c.html").read_text("utf-8")
    data = json.loads(re.search(r'id="page-data">(.*?)</script>', text)[1])
    (view,) = data["views"]
    labels = [[trace["label"] for trace in panel["traces"]] for panel in view["panels"]]
    assert labels == [["measured", "simulated before", "simulated after"], ["before", "after"]]
    assert "The gap" in text


def test_a_page_that_cannot_be_written_costs_compare_no_answer(drive):
    (drive / "full.html").symlink_to("/dev/full")
    done = run_here(drive, "compare", "experiment.toml", "--report", "full.html", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["verdict"] == "disagreement"
    assert "full.html: not drawn" in done.stderr


def test_compare_does_not_write_its_page_over_what_it_reads(drive):
    (drive / "data.html").write_text("time_s,position_mm\n")
    stated = (drive / "experiment.toml").read_text().replace("run.csv", "data.html")
    (drive / "of-page.toml").write_text(stated)
    done = run_here(drive, "compare", "of-page.toml", "--report", "data.html")
    assert done.returncode == 2
    assert "--report would overwrite" in done.stderr


def test_names_from_outside_are_text_in_the_answer_on_top():
    odd = "<script>1</script>&\x1b"
    answer = Glance(
        "named", odd, (Found(odd, (odd, odd)),), (odd,), (Chain(odd, (Step(odd, odd),)),), (odd,),
        (odd,),
    )  # fmt: skip
    shown = strip(answer)
    assert "<script" not in shown
    assert shown.count("&lt;script&gt;1&lt;/script&gt;&amp;\\x1b") == 9
