"""Pages in a real browser, from disk: what a person sees and does, and what a page never does."""

import json
import re

import numpy as np
import pytest

from helpers.browser import browser
from helpers.commands import run_here
from helpers.paths import PROGRAMS
from helpers.stated import DRIVE, FRICTION_OF_PLACE, drive_folder
from mopro.emulator import Emulator
from mopro.machine import load_machine
from mopro.markup import listing, table
from mopro.program.compile import compile_file
from mopro.recording import MemorySink
from mopro.recording.envelope import Envelopes
from mopro.recording.run import Run
from mopro.viewer.page import document
from mopro.viewer.run import run_page, run_view
from mopro.viewer.view import Mark, Panel, Scale, Trace, Track, View

pytestmark = pytest.mark.browser

XY = """\
; <script>window.hit = 1</script> "quoted" $\\frac{$ &amp; </style>
UU112500/1
UU212500/1
VEL1 20.0
VEL2 10
ACC1 .3
ACC2 .3
:A
MRI1 8.0
MRI2 5.0
WX1
WX2
WT200
MRI1 -8
MRI2 -5
WX1
WX2
JUMP A
"""
PEAK_S, PEAK_M = 1234.5, 0.4567
MOST_BYTES, MOST_OPENING_S = 8e6, 2.0
ODD = [
    "<script>window.hit=1</script>", '"><img src=x onerror="window.hit=1">', "$\\frac{$",
    "</script><script>window.hit=1</script>", "\x1b[31m\u202ex", "'single' & \"double\"",
]  # fmt: skip


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    """The page of two axes, with a stall and a program that loops."""
    folder = tmp_path_factory.mktemp("run")
    done = run_here(folder, "run", "P.CMD", "--emulate", "--for", "4s", "--report", "r.html",
                    text=XY)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / "r.html"


@pytest.fixture(scope="module")
def run_tab(chromium, run_file):
    return chromium.open(f"file://{run_file}")


@pytest.fixture
def page(run_tab):
    """The page of the run as it opens; a test must leave no complaint and no request."""
    run_tab.size(1280, 900)
    run_tab.value(
        "Mopro.state.select(0); Mopro.state.setSystem('inch'); document.activeElement.blur()"
    )
    yield run_tab
    assert run_tab.complaints() == []
    assert run_tab.requests() == []


def shown(page):
    return page.value("Mopro.plots.plots.map(p => [p.plot.scales.x.min, p.plot.scales.x.max])")


def time_of(page):
    return page.value("Mopro.state.time")


def titles(page):
    return page.value("[...document.querySelectorAll('.plot h3')].map(h => h.textContent)")


class TestTheRun:
    def test_a_drag_zooms_all_panels_and_a_double_click_shows_the_whole(self, page):
        whole = shown(page)
        page.drag(".plot .u-over", 0.25, 0.5)
        page.until("Mopro.plots.plots.every(p => p.plot.scales.x.max < 2.1)")
        assert all(one == pytest.approx([1.0, 2.0], abs=0.05) for one in shown(page))
        page.value("document.querySelector('.plot .u-over').dispatchEvent(new Event('dblclick'))")
        page.until("Mopro.plots.plots[5].plot.scales.x.max > 3.9")
        assert shown(page) == whole

    def test_the_cursor_is_in_all_panels_and_marks_the_line_that_runs(self, page):
        page.move(".plot .u-over", 0.5)
        page.until("Mopro.state.time > 1")
        assert time_of(page) == pytest.approx(2.0, abs=0.02)
        lefts = page.value("Mopro.plots.plots.map(p => p.plot.cursor.left)")
        assert max(lefts) - min(lefts) < 1
        running = page.value("document.querySelector('.listing [aria-current] code').textContent")
        line = page.value("Mopro.state.view.lines.at(Mopro.state.time)")
        assert XY.splitlines()[line - 1] == running
        values = page.value("[...document.querySelectorAll('.legend output')].map(o => o.value)")
        assert len(values) == 15
        assert "" not in values

    def test_a_click_on_a_line_goes_there_and_another_to_its_next_time(self, page):
        for turn in range(2):
            page.click("[data-line='15']")
            from_s, to_s = page.value("Mopro.state.shown")
            assert from_s <= time_of(page) < to_s < from_s + 1.5
            assert page.value("Mopro.state.view.lines.at(Mopro.state.time)") == 15
            assert time_of(page) == pytest.approx(0.733 + 1.267 * turn, abs=0.3)

    def test_play_moves_the_forcer_and_turns_the_vector(self, page):
        page.value("Mopro.player.speed.value = 0.5")
        seen = "document.querySelector('.{} figcaption').textContent"
        before = [page.value(seen.format(name)) for name in ("platen", "vector")]
        page.click(".play")
        page.until("Mopro.state.time > 0.1")
        page.click(".play")
        stopped_s = time_of(page)
        assert not page.value("Mopro.state.playing")
        after = [page.value(seen.format(name)) for name in ("platen", "vector")]
        assert before[0] == "axis 1: 0.000 in · axis 2: 0.000 in"
        assert after[0] != before[0]
        assert after[1] != before[1]
        assert stopped_s < 3.9

    def test_units_are_inches_or_si_by_the_switch(self, page):
        assert [re.sub(r".*\((.*)\).*", r"\1", title) for title in titles(page)] == [
            "in", "in/s", "mil = 0.001 in", "lbf", "A", "°C",
        ]  # fmt: skip
        inch = page.value("Mopro.plots.plots[0].plot.scales.y.max")
        page.click(".units")
        assert titles(page)[0] == "Position (m)"
        assert page.value("Mopro.plots.plots[0].plot.scales.y.max") == pytest.approx(0.0254 * inch)
        assert "in/s" not in page.value("document.querySelector('.moves').textContent")
        page.click(".units")
        assert page.value("document.querySelector('.moves').textContent").count("20 in/s") == 4

    def test_values_at_the_cursor_have_the_decimals_of_their_largest(self, page):
        told = page.value("[0, 1e-7, -3e-9, 12.345678].map(v => Mopro.range([v, v], 1, 15))")
        assert told == ["0.000", "0.000", "0.000", "12.346"]
        assert page.value("Mopro.range([1, 2], 1000, 0.5)") == "1000.00 … 2000.00"
        assert page.value("Mopro.range([NaN, NaN], 1, 15)") == "–"

    def test_all_lengths_of_a_column_have_one_unit(self, page):
        page.value("Mopro.state.setSystem('SI')")
        cells = page.value(
            "[...document.querySelectorAll('.moves tbody td:nth-child(4)')].map(c => c.textContent)"
        )
        assert cells == ["0.2032 m", "0.127 m", "-0.2032 m", "-0.127 m"]

    def test_every_panel_has_its_grid_and_room_for_its_numbers(self, page):
        sizes = page.value("Mopro.plots.plots.map(p => p.plot.axes[0]._size)")
        assert [size > 0 for size in sizes] == [True, *[False] * 4, True]
        below = page.value(
            "Mopro.plots.plots.map(p => p.plot.height - (p.plot.bbox.top + p.plot.bbox.height))"
        )
        assert min(below) >= 8

    def test_keys_play_step_zoom_and_switch(self, page):
        page.key("ArrowRight")
        assert time_of(page) == pytest.approx(0.02, abs=1e-3)
        page.key("n")
        assert time_of(page) > 0.1
        page.key("+")
        page.until("Mopro.state.shown[1] - Mopro.state.shown[0] < 2.1")
        page.key("0")
        assert page.value("Mopro.state.shown") == [0, 4]
        page.key("u")
        assert page.value("document.querySelector('.units').textContent") == "SI"
        page.key("u")
        page.key(" ", "Space")
        assert page.value("Mopro.state.playing")
        page.key(" ", "Space")

    def test_moves_are_folded_by_line_and_open_to_each(self, page):
        rows = "[...document.querySelectorAll('.moves tbody tr')].map(r => r.textContent)"
        folded = page.value(rows)
        assert [text.split("trap")[0][:-1] for text in folded] == [
            "line 9 × 4", "line 10 × 4", "line 14 × 3", "line 15 × 3",
        ]  # fmt: skip
        page.click(".moves tbody button")
        starts = [text.split(" s")[0] for text in page.value(rows)[1:5]]
        assert starts[0] == "at 0"
        page.click(".moves tbody tr:nth-child(3) button")
        assert starts[1] == f"at {time_of(page):.8g}"

    def test_what_a_comment_says_is_text(self, page):
        assert page.value("window.hit") is None
        assert (
            page.value("document.querySelector('.listing code').textContent")
            == (XY.splitlines()[0])
        )

    def test_nothing_is_wider_than_a_narrow_window(self, page):
        page.size(360, 800)
        page.until("innerWidth === 360 && Mopro.plots.plots[0].plot.width < 360")
        assert page.value("document.documentElement.scrollWidth") <= 360


@pytest.fixture(scope="module")
def hour():
    """The page of an hour of TEMP1 at 2 kHz: one minute again and again, with one peak."""
    program = compile_file(PROGRAMS / "TEMP1.CMD")
    machine, memory = load_machine("chow1992"), MemorySink()
    emulator = Emulator(machine)
    run = emulator.run(program, memory, 60.0)
    recording = memory.recording(emulator.header(program))
    sink = Envelopes()
    noise = np.random.default_rng(1)
    for minute in range(60):
        columns = {name: values[:-1].copy() for name, values in recording.columns.items()}
        columns["time_s"] += 60 * minute
        # No two minutes are alike, so that the page is no smaller than one of a measured run.
        columns["velocity_2_m_s"] += noise.normal(0, 1e-4, len(columns["time_s"]))
        if minute == PEAK_S // 60:
            columns["position_2_m"][int(2000 * (PEAK_S % 60))] = PEAK_M
        sink.write(columns)
    whole = Run("TEMP1.CMD", run.machine, 3600.0, True, False, run.moves * 60)
    view = run_view(sink, whole, program, machine)
    return run_page(emulator.header(program), view, whole, machine)


@pytest.fixture(scope="module")
def hour_page(hour, chromium, tmp_path_factory):
    file = tmp_path_factory.mktemp("hour") / "hour.html"
    file.write_text(hour)
    page = chromium.open(f"file://{file}")
    for _ in range(2):
        # A computer that is busy with other tests may be slow, but not each time.
        if page.opened_s > MOST_OPENING_S:
            page.close()
            page = chromium.open(f"file://{file}")
    yield page
    assert page.complaints() == []
    page.close()


def test_an_hour_is_small_opens_at_once_and_keeps_its_peak(hour, hour_page):
    assert len(hour.encode()) < MOST_BYTES
    assert hour_page.opened_s < MOST_OPENING_S
    assert hour_page.value("Mopro.state.shown")[1] == pytest.approx(3600, abs=0.01)
    colours = hour_page.value(f"""(() => {{
        const {{ plot, unit }} = Mopro.plots.plots[0];
        const x = Math.round(plot.valToPos({PEAK_S}, "x", true));
        const y = Math.round(plot.valToPos({PEAK_M} * unit.factor * 0.98, "y", true));
        return [...plot.ctx.getImageData(x - 20, y, 41, 1).data];
    }})()""")
    painted = [
        at for at, (red, _, blue, opaque) in enumerate(zip(*[iter(colours)] * 4, strict=True))
        if opaque and red > 150 and blue < 100
    ]  # fmt: skip
    assert 1 <= len(painted) <= 5, "the orange of axis 2, and nothing beside the peak"
    assert all(abs(at - 20) <= 2 for at in painted)
    hour_page.value(f"Mopro.state.setTime({PEAK_S})")
    told = hour_page.value("document.querySelectorAll('.plot output')[1].value")
    assert float(told.split(" … ")[-1]) == pytest.approx(PEAK_M / 0.0254, rel=1e-4)
    moves = hour_page.value("document.querySelector('.moves tbody').textContent")
    assert moves.startswith("line 16 × 1680")
    assert "line 19 × 1680" in moves
    size = "Mopro.plots.plots[0].part.size"
    hour_page.value("Mopro.state.show(1, 2)")
    assert hour_page.value(size) == 1, "the beginning is there in full"
    hour_page.value("Mopro.state.show(2000, 2010)")
    assert hour_page.value(size) > 1
    hour_page.value("Mopro.state.showAll()")


# Opacity (0 to 255) of a panel at times and values (SI).
OPACITY = """
async (panel, places) => {
    await new Promise(requestAnimationFrame);
    const { plot, unit } = Mopro.plots.plots[panel], { canvas } = plot.ctx;
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const pen = copy.getContext("2d", { willReadFrequently: true });
    pen.drawImage(canvas, 0, 0);
    return places.map(([time, value]) => {
        const x = Math.round(plot.valToPos(time, "x", true));
        const y = Math.round(plot.valToPos(value * unit.factor, "y", true));
        return pen.getImageData(x, y, 1, 1).data[3];
    });
}"""


def opacity(page, panel, places):
    return page.value(f"({OPACITY})({panel}, {places})")


def test_where_values_stay_an_hour_is_darker_than_where_they_pass(hour_page):
    times = [1111.5 + 7 * i for i in range(20)]
    stay = opacity(hour_page, 3, [[t, 0.8] for t in times])
    passed = opacity(hour_page, 3, [[t, 15.0] for t in times])
    assert 0 < np.median(passed) < 0.5 * np.median(stay), "the force stays about zero"
    strokes = opacity(hour_page, 0, [[t, 0.21] for t in times])
    assert 0 < np.median(strokes) < 0.6 * 255, "and the strokes are no solid block"


def test_between_the_extremes_of_what_is_not_there_in_full_no_line_is_made_up(hour_page):
    hour_page.value("Mopro.state.show(2000, 2001)")
    places = hour_page.value("""(() => {
        const { part } = Mopro.plots.plots[3];
        const { first, second } = part.channels.force_2_N;
        const from = Mopro.lastAt(part.start, 2000.1), to = Mopro.lastAt(part.start, 2000.9);
        return Array.from({ length: to - from }, (_, i) => from + i).map((at) =>
            [(part.start[at] + part.start[at + 1]) / 2, first[at], second[at]]);
    })()""")
    tall = [(time, *ends) for time, *ends in places if abs(ends[0] - ends[1]) > 6]
    assert len(tall) > 1
    near = opacity(hour_page, 3, [[t, 0.95 * max(a, b) + 0.05 * min(a, b)] for t, a, b in tall])
    assert all(0 < alpha < 150 for alpha in near), "pale up to the extremes, without a line"
    hour_page.value("Mopro.state.showAll()")


@pytest.fixture(scope="module")
def why_page(chromium, tmp_path_factory):
    """A reconciliation of a machine of another kind than the motor."""
    folder = tmp_path_factory.mktemp("rig")
    drive_folder(folder, DRIVE + FRICTION_OF_PLACE, of_place=30.0, length_s=2.0)
    done = run_here(folder, "reconcile", "experiment.toml", "--only", "friction of place",
                    "--report", "why.html")  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    page = chromium.open(f"file://{folder / 'why.html'}")
    yield page
    assert page.complaints() == []
    assert page.requests() == []
    page.close()


def test_before_and_after_are_on_one_axis_with_the_noise_band(why_page):
    assert titles(why_page)[1].startswith("scale: residual")
    labels = why_page.value("Mopro.state.view.panels[1].traces.map(t => t.label)")
    assert labels == ["before the repair", "after the repair"]
    assert titles(why_page)[2].startswith("scale: signatures of the effects")
    labels = why_page.value("Mopro.state.view.panels[2].traces.map(t => t.label)")
    assert labels == ["residual before the repair", "friction of place"]
    scale, band = why_page.value(
        "(({plot, panel}) => [[plot.scales.y.min, plot.scales.y.max], panel.band])"
        "(Mopro.plots.plots[1])"
    )
    assert band == pytest.approx(0.2e-3)
    low, high = why_page.value(
        "(([x, before, after]) => [Math.min(...before, ...after),"
        " Math.max(...before, ...after)])(Mopro.plots.plots[1].data)"
    )
    assert scale[0] < low < high < scale[1]
    assert why_page.value("document.querySelector('aside').hidden")
    assert "Effects found" in why_page.value("document.body.textContent")


def test_a_page_in_millimetres_opens_where_nobody_has_chosen_units(chromium, why_page):
    why_page.value("localStorage.clear()")
    page = chromium.open(why_page.value("location.href"))
    assert titles(page)[0] == "scale: measured and simulated (mm)"
    page.close()


# Least contrast of the strip's texts against its card (WCAG 2.1, AA asks for 4.5).
CONTRAST = """(() => {
    const light = (colour) => colour.match(/[\\d.]+/g).slice(0, 3).map((c) => c / 255)
        .map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
        .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0.05);
    const card = light(getComputedStyle(document.querySelector(".glance")).backgroundColor);
    return Math.min(...[...document.querySelectorAll(".glance h2, .glance li, .glance strong")]
        .map((e) => light(getComputedStyle(e).color) / card).map((r) => Math.max(r, 1 / r)));
})()"""
ENDS = "[...document.querySelectorAll('#head *')].map(e => e.getBoundingClientRect().right)"


def region(page, name):
    """Headings and whole text of a region, as a screen reader has them; [level, heading]."""
    nodes = {n["nodeId"]: n for n in page.call("Accessibility.getFullAXTree")["nodes"]}

    def below(node):
        for child in map(nodes.get, node.get("childIds", ())):
            if child is not None:
                yield child
                yield from below(child)

    (found,) = (n for n in nodes.values() if n.get("name", {}).get("value") == name)
    assert found["role"]["value"] == "region"
    headings = [n for n in below(found) if n["role"]["value"] == "heading"]
    texts = [n["name"]["value"] for n in below(found) if n["role"]["value"] == "StaticText"]
    levels = [next(p for p in n["properties"] if p["name"] == "level") for n in headings]
    told = [
        [p["value"]["value"], n["name"]["value"]] for p, n in zip(levels, headings, strict=True)
    ]
    return told, "".join(texts)


def test_the_answer_is_a_region_with_headings_above_the_plots(why_page):
    headings, text = region(why_page, "The answer at a glance")
    assert headings == [[2, "Effects"], [2, "Gap, RMS"], [2, "Next"]]
    effect = r"friction of place: F1 = [\d.]+ N/m \(95 %: [\d.]+ to [\d.]+\)"
    assert re.search(effect, text)
    assert re.search(r"before the repair [\d.]+ mm ?→ after the repair .*noise alone 0.2 mm", text)
    bottom, top = why_page.value(
        "[document.querySelector('.glance').getBoundingClientRect().bottom,"
        " document.querySelector('#viewer').getBoundingClientRect().top]"
    )
    assert 0 < bottom < top


@pytest.mark.parametrize("dark", [False, True])
def test_the_answer_has_the_contrast_that_is_asked_of_text(chromium, why_page, dark):
    page = chromium.open(why_page.value("location.href"), dark=dark)
    assert page.value(CONTRAST) > 4.5
    page.close()


def test_nothing_of_a_diagnosis_is_wider_than_a_narrow_window(chromium, why_page):
    page = chromium.open(why_page.value("location.href"), width=360, height=800)
    page.until("innerWidth === 360 && Mopro.plots.plots[0].plot.width < 360")
    assert page.value("document.documentElement.scrollWidth") <= 360
    assert max(page.value(ENDS)) <= 360
    page.close()


def test_a_printed_page_has_the_answer_and_no_buttons(chromium, why_page):
    page = chromium.open(why_page.value("location.href"), width=700)
    page.call("Emulation.setEmulatedMedia", media="print")
    shown = "getComputedStyle(document.querySelector('{}')).display"
    assert page.value(shown.format(".player")) == "none"
    assert page.value(shown.format(".glance")) == "block"
    assert page.value("document.documentElement.scrollWidth") <= 700
    assert page.value("document.querySelector('.glance').innerText").count("\n") >= 5
    page.close()


ODD_NAME = "<script>window.hit=1</script>'$\\frac{$\u202e\x1b"


@pytest.fixture(scope="module")
def odd_page(chromium, tmp_path_factory):
    """The page of a comparison in which all names are odd: machine, sensor, program, comments."""
    folder = tmp_path_factory.mktemp("odd")
    name = json.dumps(ODD_NAME)
    (folder / "machine.toml").write_text(f'name = {name}\nextends = "chow1992"\n')
    (folder / "e.toml").write_text(
        f'machine = "machine.toml"\n[[sensor]]\nkind = "laser"\nname = {name}\n'
        'axis = 1\ncolumn = "position_1_mm"\nrate_hz = 100.0\n'
        '[[run]]\nprogram = "P.CMD"\ndata = "d.csv"\n'
    )
    rows = (f"{i / 100},{i / 100}" for i in range(60))
    (folder / "d.csv").write_text("\n".join(["time_s,position_1_mm", *rows, ""]))
    program = f"; {ODD_NAME[:-2]}\nUU112500/1\nVEL1 8\nACC1 .2\nMRI1 2\nWX1\n"
    done = run_here(folder, "compare", "e.toml", "--report", "c.html", text=program)
    assert done.returncode == 1, done.stderr
    page = chromium.open(f"file://{folder / 'c.html'}")
    yield page
    assert page.complaints() == []
    assert page.requests() == []
    page.close()


def test_odd_names_are_text_in_a_page_and_do_not_keep_it_from_opening(odd_page):
    assert odd_page.value("window.hit") is None
    shown = ODD_NAME.replace("\u202e", "\\u202e").replace("\x1b", "\\x1b")
    assert titles(odd_page)[0].startswith(f"{shown}: measured and simulated")
    assert shown in odd_page.value("document.querySelector('h1').textContent")
    assert "axis 1: " in odd_page.value("document.querySelector('.platen figcaption').textContent")


def test_texts_from_outside_are_shown_and_do_nothing(chromium, tmp_path):
    times = np.linspace(0, 1, 5)
    views = [
        View(
            name=odd, panels=[Panel(odd, odd, Scale(odd), [Trace(odd, odd)], 1.0, odd)],
            tracks={odd: Track.of(times, {odd: times}, 100)}, program=[odd],
            marks=[Mark("lint", odd, 1, 0.5)],
        )
        for odd in ODD
    ]  # fmt: skip
    text = document(ODD[3], [listing(ODD[1])], views, [table([ODD[2]], [[ODD[3]]], ODD[0])])
    (tmp_path / "odd.html").write_text(text, encoding="utf-8")
    page = chromium.open(f"file://{tmp_path / 'odd.html'}")
    names = page.value("[...document.querySelector('select').options].map(o => o.textContent)")
    assert names[:4] == ODD[:4]
    assert names[4] == "\\x1b[31m\\u202ex"
    for index, name in enumerate(names):
        page.value(f"Mopro.state.select({index})")
        assert page.value("document.querySelector('.listing code').textContent") == name
        assert name in page.value("document.querySelector('.plot').textContent")
        assert name in page.value("document.querySelector('.marks').textContent")
    assert page.value("window.hit") is None
    assert page.value("document.images.length") == 0
    assert page.complaints() == []
    assert page.requests() == []
    page.close()
