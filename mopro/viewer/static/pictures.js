// The platen from above with the forcer, and the phase currents as a turning vector.
"use strict";

(function () {
  const { element, theme, unitFor, number } = Mopro;
  const MOST_POINTS = 4000;

  // A canvas that is drawn anew when the time, the view or the stretch changes.
  class Picture {
    constructor(state, root, title, ratio) {
      Object.assign(this, { state, root, ratio });
      this.canvas = element("canvas", { role: "img", "aria-label": title });
      this.caption = element("figcaption", {});
      root.replaceChildren(element("h2", {}, title),
        element("figure", {}, this.canvas, this.caption));
      for (const event of ["view", "time", "shown", "units", "data"]) {
        state.on(event, () => this.draw());
      }
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
      new ResizeObserver(() => this.draw()).observe(root);
    }

    draw() {
      this.root.hidden = !this.wanted();
      if (this.root.hidden) return;
      const width = this.canvas.clientWidth, height = width * this.ratio;
      if (!width) return;
      const scale = devicePixelRatio;
      this.canvas.width = width * scale;
      this.canvas.height = height * scale;
      this.canvas.style.height = `${height}px`;
      const pen = this.canvas.getContext("2d");
      pen.scale(scale, scale);
      pen.font = "11px system-ui, sans-serif";
      pen.lineWidth = 1;
      this.paint(pen, width, height);
    }
  }

  class Platen extends Picture {
    constructor(state, root) { super(state, root, "Platen from above", 0.66); this.draw(); }

    wanted() { return Boolean(this.state.view.platen); }

    // Position of an axis at a time, [low, high]; at its start where it is not recorded.
    place(axis, time) {
      const { platen, tracks } = this.state.view;
      const seen = platen.position[axis];
      return seen && tracks[seen.track].has(seen.channel)
        ? tracks[seen.track].at(seen.channel, time) : [0, 0];
    }

    paint(pen, width, height) {
      const { platen } = this.state.view;
      const centre = [1, 2].map((n) => middle(platen.travel[n]));
      const room = 20;
      const scale = Math.min(
        (width - 2 * room) / platen.length, (height - 2 * room) / platen.width);
      const x = (metres) => width / 2 + (metres - centre[0]) * scale;
      const y = (metres) => height / 2 - (metres - centre[1]) * scale;
      const box = (x0, x1, y0, y1) => [x(x0), y(y1), (x1 - x0) * scale, (y1 - y0) * scale];
      const around = (axis, size) => [centre[axis - 1] - size / 2, centre[axis - 1] + size / 2];
      pen.fillStyle = theme("--platen");
      pen.fillRect(...box(...around(1, platen.length), ...around(2, platen.width)));
      pen.setLineDash([5, 4]);
      pen.strokeStyle = theme("--trip");
      pen.strokeRect(...box(...platen.travel[1], ...platen.travel[2]));
      pen.setLineDash([]);
      this.paintPath(pen, x, y);
      this.paintForcer(pen, box, x, y);
      pen.fillStyle = theme("--text");
      pen.fillText("axis 1 →", width / 2 - 20, height - 6);
      pen.save();
      pen.translate(12, height / 2 + 20);
      pen.rotate(-Math.PI / 2);
      pen.fillText("axis 2 →", 0, 0);
      pen.restore();
      pen.fillStyle = theme("--trip");
      pen.fillText("limit switches", x(platen.travel[1][0]) + 4, y(platen.travel[2][1]) + 13);
    }

    // The way in the stretch shown, at the times of the first axis that is recorded.
    paintPath(pen, x, y) {
      const { platen, tracks } = this.state.view;
      const seen = Object.values(platen.position).find((s) => tracks[s.track].has(s.channel));
      if (!seen) return;
      const [from, to] = this.state.shown;
      const { start } = tracks[seen.track].partFor(from, to);
      const first = Math.max(0, Mopro.lastAt(start, from));
      const last = Math.max(first, Mopro.lastAt(start, to));
      const stride = Math.max(1, Math.ceil((last - first) / MOST_POINTS));
      pen.strokeStyle = Mopro.colorAt(1);
      pen.beginPath();
      for (let i = first; i <= last; i += stride) {
        const [one, two] = [1, 2].map((n) => middle(this.place(n, start[i])));
        pen.lineTo(x(one), y(two));
      }
      pen.stroke();
    }

    paintForcer(pen, box, x, y) {
      const { platen } = this.state.view;
      const { time, system } = this.state;
      const [one, two] = [1, 2].map((n) => this.place(n, time));
      const half = platen.side / 2;
      pen.fillStyle = `${Mopro.colorAt(0)}40`;
      pen.fillRect(...box(one[0] - half, one[1] + half, two[0] - half, two[1] + half));
      const [a, b] = [middle(one), middle(two)];
      pen.strokeStyle = pen.fillStyle = Mopro.colorAt(0);
      pen.lineWidth = 2;
      pen.strokeRect(...box(a - half, a + half, b - half, b + half));
      pen.beginPath();
      pen.arc(x(a), y(b), 3, 0, 2 * Math.PI);
      pen.fill();
      const unit = unitFor("length", "m", system, 0.1);
      const told = (ends) => `${Mopro.range(ends, unit.factor, platen.length)} ${unit.name}`;
      this.caption.textContent = [one, two].map((ends, i) => `axis ${i + 1}: ${told(ends)}`)
        .join(" · ");
    }
  }

  class Vector extends Picture {
    constructor(state, root) { super(state, root, "Phase currents", 0.42); this.draw(); }

    axes() { return Object.entries(this.state.view.phases); }

    wanted() { return this.axes().length > 0; }

    paint(pen, width, height) {
      const axes = this.axes();
      const said = axes.map(([axis, names], i) =>
        this.paintAxis(pen, axis, names, width * (i + 0.5) / axes.length, height / 2,
          Math.min(width / axes.length, height) / 2 - 22));
      this.caption.textContent = said.join("\n");
    }

    // Phase A to the right, phase B upward: one turn is one pitch of the teeth.
    paintAxis(pen, axis, names, x, y, radius) {
      const track = this.state.view.tracks[Object.keys(this.state.view.tracks)[0]];
      const [a, b] = names.map((name) => track.at(name, this.state.time));
      const most = Math.max(...names.map((name) => track.overview.most(name))) || 1;
      const scale = radius / most;
      pen.strokeStyle = theme("--grid");
      pen.lineWidth = 1;
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.moveTo(x - radius, y);
      pen.lineTo(x + radius, y);
      pen.moveTo(x, y - radius);
      pen.lineTo(x, y + radius);
      pen.stroke();
      pen.fillStyle = theme("--text");
      pen.fillText("A", x + radius + 4, y + 4);
      pen.fillText("B", x - 4, y - radius - 4);
      const color = Mopro.colorAt(2 * (Number(axis) - 1));
      if (a[0] === a[1] && b[0] === b[1]) {
        arrow(pen, x, y, x + a[0] * scale, y - b[0] * scale, color);
      } else {
        pen.fillStyle = `${color}40`;
        pen.fillRect(x + a[0] * scale, y - b[1] * scale,
          (a[1] - a[0]) * scale, (b[1] - b[0]) * scale);
      }
      return `axis ${axis}: A ${Mopro.range(a, 1, most)}, B ${Mopro.range(b, 1, most)} A`
        + ` (circle ${number(most, 3)} A)`;
    }
  }

  function middle([low, high]) { return (low + high) / 2; }

  function arrow(pen, x0, y0, x1, y1, color) {
    const angle = Math.atan2(y1 - y0, x1 - x0);
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = 2.5;
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
    pen.stroke();
    pen.beginPath();
    pen.moveTo(x1, y1);
    for (const turn of [2.7, -2.7]) {
      pen.lineTo(x1 + 9 * Math.cos(angle + turn), y1 + 9 * Math.sin(angle + turn));
    }
    pen.fill();
  }

  Object.assign(Mopro, { Picture, Platen, Vector });
})();
