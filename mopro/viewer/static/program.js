// The program's listing: a click on a line goes to the time at which it runs.
"use strict";

(function () {
  const { element } = Mopro;

  class Program {
    constructor(state, root) {
      Object.assign(this, { state, root });
      state.on("view", () => this.build());
      state.on("time", () => this.markRunning());
      state.on("data", () => { this.markRan(); this.markRunning(); });
      this.build();
    }

    build() {
      const { view } = this.state;
      this.running = null;
      this.known = 0;
      this.items = view.program.map((text, i) => this.item(i + 1, text));
      this.markRan();
      this.root.replaceChildren(
        element("h2", {}, "Program"), element("ol", { class: "listing" }, ...this.items));
      this.root.hidden = !view.program.length;
      this.markRunning();
    }

    // Lines that have run since this was last asked.
    markRan() {
      const line = this.state.view.lines ? this.state.view.lines.line : [];
      for (; this.known < line.length; this.known++) {
        const item = this.items[line[this.known] - 1];
        if (item) item.classList.add("ran");
      }
    }

    item(number, text) {
      const marks = this.state.view.marks.filter((mark) => mark.line === number);
      const kinds = [...new Set(marks.map((mark) => mark.kind))];
      const signs = kinds.map((kind) => element("span", { class: kind }, Mopro.SIGNS[kind]));
      const words = marks.slice(0, 5).map((mark) => mark.text).join("\n");
      return element("li", {}, element("button",
        { type: "button", title: words || null, "data-line": number,
          onclick: () => this.state.goToLine(number) },
        element("span", { class: "number" }, String(number)),
        element("span", { class: "signs" }, ...signs), element("code", {}, text || " ")));
    }

    markRunning() {
      const { view, time } = this.state;
      const line = view.lines ? view.lines.at(time) : 0;
      const item = this.items[line - 1];
      if (item === this.running) return;
      if (this.running) this.running.removeAttribute("aria-current");
      this.running = item;
      if (!item) return;
      item.setAttribute("aria-current", "true");
      const list = item.parentElement;
      const above = item.offsetTop, below = above + item.offsetHeight;
      if (above < list.scrollTop || below > list.scrollTop + list.clientHeight) {
        list.scrollTop = above - list.clientHeight / 2;
      }
    }
  }

  Object.assign(Mopro, { Program });
})();
