// What is looked at: the view, the time, the stretch shown, the units; and who is told of it.
"use strict";

(function () {
  class State {
    // `units`: the system that the data are in, unless the person has chosen one.
    constructor(views, units) {
      this.views = views;
      this.system = stored("mopro-units") || units || "inch";
      this.listeners = {};
      this.playing = false;
      this.select(0);
    }

    on(event, listener) { (this.listeners[event] ||= []).push(listener); }
    tell(event) { for (const listener of this.listeners[event] || []) listener(this); }

    select(index) {
      this.view = this.views[index];
      this.playing = false;
      this.measureEnds();
      this.shown = [this.first, this.last];
      this.time = this.first;
      this.tell("view");
      this.tell("time");
    }

    measureEnds() {
      const tracks = Object.values(this.view.tracks);
      this.first = Math.min(...tracks.map((t) => t.overview.first));
      this.last = Math.max(...tracks.map((t) => t.overview.last));
    }

    setTime(time) {
      this.time = Math.min(Math.max(time, this.first), this.last);
      this.tell("time");
    }

    show(from, to) {
      const least = (this.last - this.first) * 1e-7;
      from = Math.max(from, this.first);
      to = Math.min(to, this.last);
      if (!(to - from > least)) return;
      this.shown = [from, to];
      this.tell("shown");
    }

    showAll() { this.show(this.first, this.last); }

    // Zoom about the time of the cursor; a factor below 1 shows less.
    zoom(factor) {
      const [from, to] = this.shown;
      const about = this.time >= from && this.time <= to ? this.time : (from + to) / 2;
      this.show(about - (about - from) * factor, about + (to - about) * factor);
    }

    setSystem(system) {
      this.system = system;
      stored("mopro-units", system);
      this.tell("units");
    }

    goToLine(line) {
      const stretch = this.view.lines && this.view.lines.next(line, this.time, this.last);
      if (stretch) this.goTo(stretch[0], stretch[1]);
    }

    goTo(from, to) {
      const margin = 0.15 * (to - from) || (this.last - this.first) / 100;
      this.show(from - margin, to + margin);
      this.setTime(from);
    }
  }

  // Some browsers refuse storage to pages from disk: the choice is then not kept.
  function stored(key, value) {
    try {
      if (value !== undefined) localStorage.setItem(key, value);
      return localStorage.getItem(key);
    } catch (refused) {
      return value || null;
    }
  }

  // An element with attributes, listeners (`onclick`), and text or elements inside.
  function element(tag, attributes = {}, ...inside) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
      else if (value === true) made.setAttribute(name, "");
      else if (value !== false && value !== null) made.setAttribute(name, value);
    }
    made.append(...inside);
    return made;
  }

  Object.assign(Mopro, { State, element });
})();
