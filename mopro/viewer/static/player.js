// The bar that plays a run, sets the speed, the units and the zoom; and the keys for it.
"use strict";

(function () {
  const { element } = Mopro;
  const SPEEDS = [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2, 5, 10, 60, 600];
  // A run is played in about this time (s) unless told otherwise.
  const PLAYED_S = 30;
  const STEPS = 10000;
  const KEYS = [
    ["Space", "play, pause"], ["← →", "a step of the time (with Shift a large one)"],
    ["+ −", "zoom about the cursor"], ["0", "the whole run"], ["N P", "next, previous line"],
    ["U", "inches or SI"], ["?", "these keys"],
  ];

  class Player {
    constructor(state, root) {
      Object.assign(this, { state, root });
      this.build();
      state.on("view", () => this.reset());
      state.on("time", () => this.write());
      state.on("data", () => this.write());
      state.on("units", () => this.write());
      document.addEventListener("keydown", (event) => this.key(event));
      this.reset();
    }

    build() {
      const { state } = this;
      this.views = element("select",
        { "aria-label": "run", onchange: () => state.select(this.views.selectedIndex) },
        ...state.views.map((view) => element("option", {}, view.name)));
      this.views.hidden = state.views.length < 2;
      this.play = element("button",
        { type: "button", class: "play", onclick: () => this.toggle() });
      this.slider = element("input", { type: "range", min: 0, max: STEPS, step: 1,
        "aria-label": "time", oninput: () => this.slid() });
      this.clock = element("output", { class: "clock" });
      this.speed = element("select", { "aria-label": "speed" },
        ...SPEEDS.map((speed) => element("option", { value: speed }, `${speed} ×`)));
      this.units = element("button", { type: "button", class: "units",
        title: "units: inches or SI", onclick: () => this.switchUnits() });
      this.help = element("div", { class: "keys", hidden: true }, element("dl", {},
        ...KEYS.flatMap(([key, what]) => [element("dt", {}, key), element("dd", {}, what)])));
      const zoom = (text, title, act) =>
        element("button", { type: "button", title, "aria-label": title, onclick: act }, text);
      this.moving = element("span", { class: "moving" },
        this.play, this.slider, this.clock, this.speed,
        zoom("−", "show more", () => state.zoom(2)),
        zoom("+", "show less", () => state.zoom(0.5)),
        zoom("⤢", "show the whole run", () => state.showAll()));
      this.root.replaceChildren(this.views, this.moving, this.units,
        zoom("?", "keys", () => { this.help.hidden = !this.help.hidden; }), this.help);
    }

    reset() {
      const { state } = this;
      const wanted = (state.last - state.first) / PLAYED_S;
      this.speed.value = SPEEDS.find((speed) => speed >= Math.min(wanted, 1)) || 1;
      if (wanted > 1) this.speed.value = SPEEDS.find((speed) => speed >= wanted) || SPEEDS.at(-1);
      this.moving.hidden = state.view.rows;
      this.units.hidden = !state.view.platen && !state.view.panels.some((p) => p.dimension);
      this.write();
    }

    write() {
      const { state } = this;
      this.play.textContent = state.playing ? "❚❚" : "▶";
      this.play.setAttribute("aria-label", state.playing ? "pause" : "play");
      this.slider.value = STEPS * (state.time - state.first) / (state.last - state.first || 1);
      const line = state.view.lines ? state.view.lines.at(state.time) : 0;
      this.clock.textContent = `${state.time.toFixed(4)} s${line > 0 ? ` · line ${line}` : ""}`;
      this.units.textContent = state.system === "inch" ? "inches" : "SI";
    }

    slid() {
      const { state } = this;
      state.setTime(state.first + this.slider.value / STEPS * (state.last - state.first));
      this.follow();
    }

    // Keep the cursor within what is shown.
    follow() {
      const { state } = this;
      const [from, to] = state.shown;
      if (state.time >= from && state.time <= to) return;
      const start = Math.min(state.time - 0.05 * (to - from), state.last - (to - from));
      state.show(start, start + (to - from));
    }

    toggle() {
      const { state } = this;
      state.playing = !state.playing;
      if (state.playing && state.time >= state.last) state.setTime(state.first);
      this.write();
      if (state.playing) {
        this.before = performance.now();
        requestAnimationFrame((now) => this.tick(now));
      }
    }

    tick(now) {
      const { state } = this;
      if (!state.playing) return;
      state.setTime(state.time + Math.max(0, now - this.before) / 1000 * this.speed.value);
      this.before = now;
      this.follow();
      if (state.time >= state.last) this.toggle();
      else requestAnimationFrame((later) => this.tick(later));
    }

    switchUnits() { this.state.setSystem(this.state.system === "inch" ? "SI" : "inch"); }

    step(sign, large) {
      const [from, to] = this.state.shown;
      this.state.setTime(this.state.time + sign * (to - from) * (large ? 0.1 : 0.005));
      this.follow();
    }

    nextLine(sign) {
      const { state } = this;
      if (!state.view.lines) return;
      const { time } = state.view.lines;
      const at = Mopro.lastAt(time, state.time) + sign;
      if (at >= 0 && at < time.length) { state.setTime(time[at]); this.follow(); }
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.matches("input, select, textarea")) return;
      if (event.key === " " && event.target.matches("button, summary")) return;
      const acts = {
        " ": () => this.toggle(), ArrowLeft: () => this.step(-1, event.shiftKey),
        ArrowRight: () => this.step(1, event.shiftKey), "+": () => this.state.zoom(0.5),
        "=": () => this.state.zoom(0.5), "-": () => this.state.zoom(2),
        0: () => this.state.showAll(), n: () => this.nextLine(1), p: () => this.nextLine(-1),
        u: () => this.switchUnits(), "?": () => { this.help.hidden = !this.help.hidden; },
      };
      const act = acts[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    }
  }

  Object.assign(Mopro, { Player });
})();
