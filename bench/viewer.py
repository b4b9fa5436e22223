"""Size of the page of an hour of TEMP1, how long it takes to open, to zoom and to be drawn.

`python bench/viewer.py` needs the extra `test` and a Chromium. With `--libraries FOLDER`, which
holds packages as `npm pack` gives them (unpacked, each in a folder of its own name), libraries
for plots draw the same series of 2 million points, for comparison.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from helpers.browser import browser  # noqa: E402
from mopro.emulator import Emulator  # noqa: E402
from mopro.machine import load_machine  # noqa: E402
from mopro.program.compile import compile_file  # noqa: E402
from mopro.recording.envelope import Envelopes  # noqa: E402
from mopro.viewer.run import run_page, run_view  # noqa: E402

TIMES = 5
ZOOMED = """(async () => {
    const begun = performance.now();
    Mopro.state.show(1000, 2000);
    await new Promise(requestAnimationFrame);
    return performance.now() - begun;
})()"""
POINTS = """(() => {
    const parts = Object.values(Mopro.state.view.tracks).flatMap((t) => t.parts);
    return parts.reduce((sum, p) => sum
        + p.start.length * Object.keys(p.channels).length * (p.size > 1 ? 2 : 1), 0);
})()"""

# Package -> the script in it, and how it draws `x` and `y` (typed arrays) into `box`.
LIBRARIES = {
    "uplot": (
        "dist/uPlot.iife.min.js",
        "new uPlot({width: 1000, height: 300, scales: {x: {time: false}}, "
        "series: [{}, {stroke: 'blue'}]}, [x, y], box)",
    ),
    "dygraphs": (
        "dist/dygraph.min.js",
        "new Dygraph(box, Array.from(x, (t, i) => [t, y[i]]), {width: 1000, height: 300})",
    ),
    "chart.js": (
        "dist/chart.umd.min.js",
        "new Chart(box.appendChild(document.createElement('canvas')), {type: 'line', "
        "data: {datasets: [{data: Array.from(x, (t, i) => ({x: t, y: y[i]})), pointRadius: 0}]}, "
        "options: {animation: false, parsing: false, scales: {x: {type: 'linear'}}, "
        "plugins: {decimation: {enabled: true, algorithm: 'min-max'}}}})",
    ),
    "echarts": (
        "dist/echarts.min.js",
        "echarts.init(box, null, {width: 1000, height: 300}).setOption({animation: false, "
        "xAxis: {type: 'value'}, yAxis: {}, series: [{type: 'line', sampling: 'minmax', "
        "symbol: 'none', data: Array.from(x, (t, i) => [t, y[i]])}]})",
    ),
    "plotly.js-basic-dist-min": (
        "plotly-basic.min.js",
        "Plotly.newPlot(box, [{x, y, mode: 'lines'}], {width: 1000, height: 300})",
    ),
}
DRAWN = """(async () => {
    const x = Float64Array.from({ length: 2e6 }, (_, i) => i / 2000);
    const y = x.map((t) => Math.sin(t) + Math.sin(1e4 * t * t) / 4);
    const box = document.body.appendChild(document.createElement("div"));
    const begun = performance.now();
    await DRAW;
    await new Promise(requestAnimationFrame);
    await new Promise(requestAnimationFrame);
    return performance.now() - begun;
})()"""


def hour() -> str:
    """The page of an hour of TEMP1."""
    program, machine = compile_file(ROOT / "programs" / "TEMP1.CMD"), load_machine("chow1992")
    emulator, sink = Emulator(machine), Envelopes()
    run = emulator.run(program, sink, 3600.0)
    return run_page(emulator.header(program), run_view(sink, run, program, machine), run, machine)


def measure_page() -> None:
    text = hour()
    with browser() as chromium, tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "hour.html"
        file.write_text(text, encoding="utf-8")
        opened, zoomed = [], []
        for _ in range(TIMES):
            page = chromium.open(f"file://{file}")
            opened.append(page.opened_s)
            points = page.value(POINTS)
            zoomed.append(page.value(ZOOMED))
            page.close()
    print(f"an hour of TEMP1 at 2 kHz: page of {len(text.encode()) / 1e6:.2f} MB, {points} values")
    print(f"opened in {min(opened):.2f} to {max(opened):.2f} s ({TIMES} times)")
    print(f"zoom of all panels in {min(zoomed):.0f} to {max(zoomed):.0f} ms")


def measure_libraries(folder: Path) -> None:
    with browser() as chromium, tempfile.TemporaryDirectory() as pages:
        for name, (script, draw) in LIBRARIES.items():
            text = (folder / name / script).read_text("utf-8")
            file = Path(pages) / f"{name}.html"
            file.write_text(
                "<!doctype html><html><body></body><script>"
                + text.replace("</script>", "<\\/script>")
                + "</script><script>document.documentElement.dataset.ready = 'yes'</script></html>",
                encoding="utf-8",
            )
            drawn = []
            for _ in range(3):
                page = chromium.open(f"file://{file}")
                drawn.append(page.value(DRAWN.replace("DRAW", draw)))
                page.close()
            print(f"{name}: {len(text.encode()) / 1e3:.0f} kB, 2 M points in {min(drawn):.0f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--libraries", type=Path, metavar="FOLDER")
    chosen = parser.parse_args()
    measure_page()
    if chosen.libraries:
        measure_libraries(chosen.libraries)


if __name__ == "__main__":
    main()
