// A page that is fed as a run goes: new samples, a stop button, faults by click.
"use strict";

(function () {
  const { element, Part } = Mopro;
  const MOST_BUCKETS = 20000;
  const REDRAWN_MS = 100;
  const WINDOWS = [["last 5 s", 5], ["last 20 s", 20], ["last 2 min", 120], ["all", Infinity]];

  // A part to which buckets are added; beyond a bound, neighbours are joined.
  class GrowingPart extends Part {
    static from(part) {
      const channels = {};
      for (const [name, ends] of Object.entries(part.channels)) {
        channels[name] = { first: Array.from(ends.first), second: Array.from(ends.second) };
      }
      return new GrowingPart(part.size, Array.from(part.start), Array.from(part.end), channels);
    }

    add(told) {
      if (told.start.some((time, i) => time !== told.end[i])) this.size = 2;
      this.start.push(...told.start);
      this.end.push(...told.end);
      for (const [name, [first, second]] of Object.entries(told.channels)) {
        const own = this.channels[name];
        if (!own) continue;
        own.first.push(...first.map(number));
        own.second.push(...second.map(number));
      }
      if (this.start.length > MOST_BUCKETS) this.halve();
    }

    halve() {
      this.size = 2;
      const half = Math.floor(this.start.length / 2);
      for (const ends of Object.values(this.channels)) joinNeighbours(ends, half);
      for (let i = 0; i < half; i++) {
        this.start[i] = this.start[2 * i];
        this.end[i] = this.end[2 * i + 1];
      }
      this.start.length = this.end.length = half;
    }
  }

  // Least and greatest of each two buckets, in the order in which they occur.
  function joinNeighbours({ first, second }, half) {
    for (let i = 0; i < half; i++) {
      const four = [first[2 * i], second[2 * i], first[2 * i + 1], second[2 * i + 1]];
      const known = four.filter((value) => !Number.isNaN(value));
      const low = Math.min(...known), high = Math.max(...known);
      const rising = four.indexOf(low) <= four.indexOf(high);
      first[i] = known.length ? (rising ? low : high) : NaN;
      second[i] = known.length ? (rising ? high : low) : NaN;
    }
    first.length = second.length = half;
  }

  function number(value) { return value === null ? NaN : value; }

  class Live {
    constructor(options) {
      this.options = options;
      this.following = true;
      this.bar = element("section", { class: "live", "aria-label": "live" });
      this.build();
      document.getElementById("viewer").before(this.bar);
      this.connect();
    }

    build() {
      const { options } = this;
      this.status = element("output", { class: "live-status", role: "status" }, "waiting");
      this.window = element("select", { "aria-label": "stretch that is followed",
        onchange: () => this.follow(true) },
        ...WINDOWS.map(([words, seconds]) => element("option", { value: seconds }, words)));
      this.window.selectedIndex = 1;
      this.followed = element("button", { type: "button", "aria-pressed": "true",
        onclick: () => this.follow(!this.following) }, "follow");
      this.bar.append(this.status, this.followed, this.window);
      if (options.stop) {
        this.bar.append(element("button", { type: "button", class: "stop",
          onclick: () => this.act("stop") }, options.stop));
      }
      if (options.faults) {
        this.bar.append(element("fieldset", { class: "faults" },
          element("legend", {}, "Faults by click"),
          ...options.faults.map((name) => element("button", { type: "button",
            "data-fault": name, onclick: () => this.act("fault", name) }, name))));
      }
    }

    connect() {
      this.source = new EventSource(this.options.feed);
      const on = (event, act) => this.source.addEventListener(event,
        (message) => act(JSON.parse(message.data)));
      on("snapshot", (told) => this.snapshot(told));
      on("samples", (told) => this.samples(told));
      on("status", (words) => this.say(words));
      on("end", (words) => this.end(words));
      this.source.addEventListener("error", () => {
        if (this.source.readyState === EventSource.CLOSED) this.lost();
        else this.say("the connection is lost; trying again");
      });
    }

    async snapshot(told) {
      if (!told.views.length) { document.documentElement.dataset.ready = "yes"; return; }
      const early = this.early = [];
      const { views: [view] } = await Mopro.load(told);
      for (const track of Object.values(view.tracks)) {
        track.parts = [GrowingPart.from(track.overview)];
      }
      const { time, line } = view.lines || { time: [], line: [] };
      view.lines = new Mopro.Lines(Array.from(time), Array.from(line));
      this.show(view);
      this.early = null;
      early.forEach((samples) => this.samples(samples));
      document.documentElement.dataset.ready = "yes";
    }

    show(view) {
      if (Mopro.state) {
        Mopro.state.views = [view];
        Mopro.state.select(0);
      } else {
        Mopro.build([view]);
        Mopro.state.on("shown", () => { if (!this.moving) this.follow(false); });
      }
      if (this.status.value === "waiting") this.say("running");
      this.redraw();
    }

    samples(told) {
      if (this.early) { this.early.push(told); return; }
      if (!Mopro.state) return;
      const { view } = Mopro.state;
      view.tracks[told.track].overview.add(told);
      for (const [time, line] of told.lines) {
        view.lines.time.push(time);
        view.lines.line.push(line);
      }
      this.redrawSoon();
    }

    redrawSoon() {
      this.timer ||= setTimeout(() => { this.timer = null; this.redraw(); }, REDRAWN_MS);
    }

    redraw() {
      const { state } = Mopro;
      state.measureEnds();
      if (this.following) {
        this.moving = true;
        const from = state.last - Number(this.window.value);
        state.shown = [Math.max(state.first, from), Math.max(state.last, state.first + 1e-3)];
        state.tell("shown");
        if (!state.playing) state.setTime(state.last);
        this.moving = false;
      }
      state.tell("data");
    }

    follow(wanted) {
      this.following = wanted;
      this.followed.setAttribute("aria-pressed", String(wanted));
      if (wanted && Mopro.state) this.redraw();
    }

    say(words) { if (!this.ended) this.status.value = words; }

    end(words) {
      this.say(words);
      this.over();
    }

    lost() {
      this.say("the connection is lost: this page keeps what it has seen");
      this.over();
    }

    over() {
      this.ended = true;
      this.source.close();
      if (Mopro.player) Mopro.player.reset();
      this.bar.querySelectorAll(".stop, .faults button").forEach((b) => { b.disabled = true; });
    }

    async act(name, body = "") {
      try {
        const answer = await fetch(`${name}?token=${encodeURIComponent(this.options.token)}`,
          { method: "POST", body: JSON.stringify(body) });
        this.say(answer.ok ? `${body || name}: asked for` : `${name}: refused`);
      } catch (error) {
        this.say(`${name}: NOT SENT, the connection is lost: use the machine's own stop button`);
      }
    }
  }

  Object.assign(Mopro, { Live, GrowingPart });
})();
