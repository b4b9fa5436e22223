// Panels of traces over time, with one zoom and one cursor for all.
"use strict";

(function () {
  const { element, range, unitFor } = Mopro;
  const COLORS = 6;
  const ROWS = { stall: 1, trip: 1, gap: 1, lint: 2 };
  const SIGNS = { stall: "✕", trip: "■", lint: "▲", gap: "≠" };
  // What was wanted is a broad pale line, and what was seen a thin one over it.
  const WIDTHS = { command: 5, dashed: 1.5 };
  const MOST_BOUNDARIES = 60;
  // All panels together take about this height (px), none less or more than the bounds.
  const HEIGHT = 640, LEAST_HEIGHT = 128, MOST_HEIGHT = 300;
  // What a time axis takes of the height, with and without its label.
  const AXIS_HEIGHT = 42, SHORT_AXIS_HEIGHT = 24;
  // Digits of the values at the cursor: a length is known better than it can be drawn.
  const DIGITS = { length: 6 };

  function theme(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  // A colour of the palette, in the present theme.
  function colorAt(index) { return theme(`--trace-${index % COLORS}`); }

  function colorOf(trace) {
    return trace.style === "command" ? theme("--command") : colorAt(trace.color);
  }

  class Plot {
    constructor(state, panel, first, last) {
      Object.assign(this, { state, panel, first, last });
      this.track = state.view.tracks[panel.track];
      this.legend = element("div", { class: "legend" });
      this.canvas = element("div", { class: "canvas" });
      this.title = element("h3", {});
      this.root = element("section", { class: "plot", "aria-label": panel.title },
        element("div", { class: "plot-head" }, this.title, this.legend), this.canvas);
      this.fillLegend();
    }

    // To be called when the root is in the page, whose width it takes.
    draw() {
      const own = HEIGHT / this.state.view.panels.length;
      const axis = this.last ? AXIS_HEIGHT : this.first ? SHORT_AXIS_HEIGHT : 0;
      const height = Math.min(Math.max(own, LEAST_HEIGHT), MOST_HEIGHT) + axis;
      const size = { width: this.width(), height };
      this.part = this.track.partFor(...this.state.shown);
      this.data = this.values();
      this.plot = new uPlot({ ...size, ...this.options() }, this.data, this.canvas);
      this.plot.over.addEventListener("mousemove", (event) => this.pointed(event));
      this.plot.over.addEventListener("dblclick", () => this.state.showAll());
      this.writeValues();
    }

    width() { return Math.max(200, this.canvas.clientWidth || 600); }

    values() {
      this.size = Math.max(...this.panel.traces.filter((t) => t.shown)
        .map((t) => this.track.overview.most(t.channel)), 0);
      this.unit = unitFor(this.panel.dimension, this.panel.unit, this.state.system, this.size);
      const note = this.panel.note ? ` · ${this.panel.note}` : "";
      this.title.textContent = `${this.panel.title} (${this.unit.words})${note}`;
      return [this.part.times(),
        ...this.panel.traces.map((t) => this.part.values(t.channel, this.unit.factor))];
    }

    options() {
      const axis = { stroke: theme("--text"), grid: { stroke: theme("--grid"), width: 1 },
        ticks: { stroke: theme("--grid"), width: 1 } };
      const { rows } = this.state.view;
      return {
        legend: { show: false },
        padding: [8, 20, this.last ? 0 : 8, 0],
        cursor: {
          y: false, drag: { x: !rows, y: false, setScale: false },
          points: { size: 6 },
        },
        scales: {
          x: { time: false, range: () => this.xRange() },
          y: { range: (_, low, high) => this.yRange(low, high) },
        },
        axes: [
          this.timeAxis(axis, rows),
          { ...axis, size: 64, space: 22 },
        ],
        series: [{}, ...this.panel.traces.map((trace) => this.series(trace))],
        hooks: {
          drawClear: [(u) => this.drawBand(u)],
          drawSeries: [(u, index) => this.drawArea(u, index)],
          draw: [(u) => this.drawMarks(u)],
          setSelect: [(u) => this.zoomed(u)],
        },
      };
    }

    // Numbers are at the top of the first panel and below the last; the grid is in all.
    timeAxis(axis, rows) {
      const values = (_, ticks) => ticks.map((t) => rows && t % 1 ? "" : Mopro.number(t, 9));
      if (this.last) {
        return { ...axis, size: AXIS_HEIGHT, label: rows ? "row" : "time (s)", labelSize: 18,
          values };
      }
      if (this.first) return { ...axis, side: 0, size: SHORT_AXIS_HEIGHT, values };
      return { ...axis, size: 0, ticks: { show: false }, values: () => [] };
    }

    xRange() {
      if (!this.state.view.rows) return this.state.shown;
      return [this.state.first - 0.6, this.state.last + 0.6];
    }

    yRange(low, high) {
      if (low === null || low === undefined) return [-1, 1];
      if (this.panel.traces.some((trace) => trace.style === "bars")) {
        [low, high] = [Math.min(low, 0), Math.max(high, 0)];
      }
      const margin = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1;
      return [low - margin, high + margin];
    }

    series(trace) {
      const color = colorOf(trace);
      const common = { label: trace.label, stroke: color, show: trace.shown, spanGaps: false };
      if (trace.style === "points") {
        return { ...common, paths: () => null, points: { show: true, size: 9, fill: color } };
      }
      if (trace.style === "bars") {
        return { ...common, fill: `${color}80`, paths: uPlot.paths.bars({ size: [0.6, 60] }),
          points: { show: false } };
      }
      const line = uPlot.paths.linear();
      return { ...common, width: WIDTHS[trace.style] || 1.25, points: { show: false },
        dash: trace.style === "dashed" ? [6, 4] : undefined,
        paths: (u, ...which) => this.isArea(u, trace) ? null : line(u, ...which) };
    }

    isArea(u, trace) {
      return Mopro.isArea(u, this.part, trace.channel, this.unit.factor);
    }

    drawArea(u, index) {
      const trace = this.panel.traces[index - 1];
      if (!trace || !trace.shown || trace.style === "points" || trace.style === "bars") return;
      if (!this.isArea(u, trace)) return;
      Mopro.drawArea(u, this.part, trace.channel, this.unit.factor, colorOf(trace));
    }

    fillLegend() {
      for (const trace of this.panel.traces) {
        const swatch = element("span", { class: `swatch ${trace.style}` });
        swatch.style.borderColor = colorOf(trace);
        const value = element("output", {});
        const button = element("button",
          { type: "button", "aria-pressed": String(trace.shown), title: "show or hide",
            onclick: () => this.toggle(trace, button) }, swatch, trace.label, " ", value);
        trace.value = value;
        this.legend.append(button);
      }
      if (this.panel.band !== null) {
        this.legend.append(element("span", { class: "band-key" },
          element("span", { class: "swatch band" }), "±2 σ of the sensor"));
      }
    }

    toggle(trace, button) {
      trace.shown = !trace.shown;
      button.setAttribute("aria-pressed", String(trace.shown));
      this.refresh();
      this.plot.setSeries(this.panel.traces.indexOf(trace) + 1, { show: trace.shown });
    }

    // The stretch, the units or the data have changed.
    refresh() {
      this.part = this.track.partFor(...this.state.shown);
      this.data = this.values();
      this.plot.setData(this.data, true);
      this.moveCursor();
      this.writeValues();
    }

    reshow() {
      if (this.track.partFor(...this.state.shown) !== this.part) this.refresh();
      else {
        this.plot.setScale("x", { min: this.state.shown[0], max: this.state.shown[1] });
        this.moveCursor();
      }
    }

    resize() {
      this.plot.setSize({ width: this.width(), height: this.plot.height });
      this.moveCursor();
    }

    zoomed(u) {
      if (!(u.select.width > 2)) return;
      const from = u.posToVal(u.select.left, "x");
      const to = u.posToVal(u.select.left + u.select.width, "x");
      u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      this.state.show(from, to);
    }

    pointed(event) {
      if (this.state.playing) return;
      const left = event.clientX - this.plot.over.getBoundingClientRect().left;
      this.state.setTime(this.plot.posToVal(left, "x"));
    }

    moveCursor() {
      // A change of the scale takes effect at the end of the present task.
      queueMicrotask(() => this.plot.setCursor(
        { left: this.plot.valToPos(this.state.time, "x"), top: 0 }, false));
    }

    writeValues() {
      for (const trace of this.panel.traces) {
        const at = this.track.at(trace.channel, this.state.time);
        trace.value.textContent =
          range(at, this.unit.factor, this.size, DIGITS[this.panel.dimension]);
      }
    }

    drawBand(u) {
      if (this.panel.band === null) return;
      const reach = 2 * this.panel.band * this.unit.factor;
      const { left, top, width, height } = u.bbox;
      const high = Math.max(top, u.valToPos(reach, "y", true));
      const low = Math.min(top + height, u.valToPos(-reach, "y", true));
      u.ctx.save();
      u.ctx.fillStyle = theme("--band");
      u.ctx.fillRect(left, high, width, Math.max(0, low - high));
      u.ctx.restore();
    }

    drawMarks(u) {
      const { view, shown } = this.state;
      const scale = devicePixelRatio;
      const { top, height } = u.bbox;
      const x = (time) => Math.round(u.valToPos(time, "x", true));
      const line = (time, color) => {
        u.ctx.strokeStyle = color;
        u.ctx.beginPath();
        u.ctx.moveTo(x(time), top);
        u.ctx.lineTo(x(time), top + height);
        u.ctx.stroke();
      };
      const words = (text, time, color, row) => {
        u.ctx.fillStyle = color;
        u.ctx.fillText(text, x(time) + 3 * scale, top + (10 + 12 * row) * scale);
      };
      u.ctx.save();
      u.ctx.font = `${10 * scale}px system-ui, sans-serif`;
      u.ctx.textAlign = "left";
      u.ctx.textBaseline = "alphabetic";
      u.ctx.lineWidth = scale;
      u.ctx.setLineDash([]);
      const right = u.bbox.left + u.bbox.width - 12 * scale;
      let free = -Infinity;
      for (const [time, number] of boundaries(view.lines, shown)) {
        line(time, theme("--boundary"));
        if (!this.first || number < 1 || x(time) < free || x(time) > right) continue;
        words(String(number), time, theme("--faint"), 0);
        free = x(time) + 22 * scale;
      }
      for (const mark of timedMarks(view)) {
        if (!(mark.time >= shown[0] && mark.time <= shown[1])) continue;
        const color = theme(`--${mark.kind}`);
        if (mark.kind === "stall" || mark.kind === "trip") line(mark.time, color);
        if (this.first) words(SIGNS[mark.kind], mark.time, color, ROWS[mark.kind]);
      }
      u.ctx.restore();
    }
  }

  // Changes of the source line in the stretch shown, unless there are too many to tell apart.
  function boundaries(lines, [from, to]) {
    if (!lines) return [];
    const first = Math.max(0, Mopro.lastAt(lines.time, from));
    const last = Mopro.lastAt(lines.time, to);
    if (last - first >= MOST_BOUNDARIES) return [];
    const found = [];
    for (let i = first; i <= last; i++) {
      found.push([Math.max(from, lines.time[i]), lines.line[i]]);
    }
    return found;
  }

  // Marks with a time; one without stands where its line runs first.
  function timedMarks(view) {
    return view.marks.map((mark) => {
      if (mark.time !== null) return mark;
      const stretch = view.lines && view.lines.next(mark.line, -Infinity, 0);
      return { ...mark, time: stretch ? stretch[0] : NaN };
    });
  }

  // All panels of the view.
  class Plots {
    constructor(state, root) {
      Object.assign(this, { state, root });
      this.plots = [];
      state.on("view", () => this.build());
      state.on("shown", () => this.plots.forEach((plot) => plot.reshow()));
      state.on("units", () => this.plots.forEach((plot) => plot.refresh()));
      state.on("data", () => this.plots.forEach((plot) => plot.refresh()));
      state.on("time", () => this.plots.forEach((plot) => {
        plot.moveCursor();
        plot.writeValues();
      }));
      new ResizeObserver(() => this.plots.forEach((plot) => plot.resize())).observe(root);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.build());
      this.build();
    }

    build() {
      this.plots.forEach((plot) => plot.plot.destroy());
      const { panels } = this.state.view;
      const last = panels.length - 1;
      this.plots = panels.map((panel, i) => new Plot(this.state, panel, i === 0, i === last));
      this.root.replaceChildren(...this.plots.map((plot) => plot.root));
      this.plots.forEach((plot) => plot.draw());
      this.plots.forEach((plot) => plot.moveCursor());
    }
  }

  Object.assign(Mopro, { Plots, theme, timedMarks, colorAt, SIGNS });
})();
