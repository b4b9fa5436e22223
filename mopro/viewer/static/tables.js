// Tables of moves, folded by source line, and of marks; rows lead to their time.
"use strict";

(function () {
  const { element, number, unitFor } = Mopro;
  const MOST_SINGLE = 400;
  const HEADS = ["line", "axes", "profile", "distance", "peak / set velocity", "duration (s)",
    "largest lag", "worst margin", "lost pitches"];
  // Columns of words; all others are of numbers, which stand to the right.
  const WORDS = new Set(["line", "axes", "profile", "kind", ""]);

  class Tables {
    constructor(state, root) {
      Object.assign(this, { state, root });
      this.open = new Set();
      for (const event of ["view", "units", "moves"]) state.on(event, () => this.build());
      this.build();
    }

    build() {
      const { view } = this.state;
      const parts = [];
      if (view.moves.length) parts.push(this.moves(view.moves));
      if (view.marks.length) parts.push(this.marks(view.marks));
      this.root.replaceChildren(...parts);
    }

    moves(moves) {
      const rows = moves.flatMap((move) => [this.row(move), ...this.singles(move)]);
      return folded("Moves", "moves", HEADS, rows);
    }

    // A length of the move (its `kind`: distance, peak, set, lag) in the units of the switch, of
    // one size for the whole column; user units stay what they are.
    length(value, move, kind) {
      const speed = kind === "peak" || kind === "set";
      if (value === null) return "–";
      if (move.metres === null) return `${number(value)} ${move.unit}${speed ? "/s" : ""}`;
      const { system, view } = this.state;
      const size = Math.max(...view.moves.map((m) => Math.abs(m[kind] * m.metres)));
      const unit = unitFor(speed ? "velocity" : "length", "m", system, size);
      return `${number(value * move.metres * unit.factor)} ${unit.name}`;
    }

    row(move) {
      const { state } = this;
      const many = move.count > 1 ? ` × ${move.count}` : "";
      const fold = element("button", { type: "button", "aria-expanded": this.open.has(move.line),
        title: move.each.length > 1 ? "show each move" : "go there",
        onclick: () => this.clicked(move) }, `line ${move.line}${many}`);
      const cells = [move.axes.join("+"), move.profile + cutWords(move),
        this.length(move.distance, move, "distance"),
        `${this.length(move.peak, move, "peak")} / ${this.length(move.set, move, "set")}`,
        move.duration.toFixed(6), this.length(move.lag, move, "lag"), percent(move.margin),
        move.slipped ? signed(move.lost) : "0"];
      const row = element("tr", { class: move.slipped ? "stall" : null },
        element("th", { scope: "row" }, fold), ...valueCells(cells));
      row.addEventListener("click", (event) => {
        if (!event.target.closest("button")) state.goToLine(move.line);
      });
      return row;
    }

    clicked(move) {
      if (move.each.length < 2) { this.state.goToLine(move.line); return; }
      if (!this.open.delete(move.line)) this.open.add(move.line);
      this.build();
    }

    singles(move) {
      if (!this.open.has(move.line)) return [];
      const rows = move.each.slice(0, MOST_SINGLE).map((each) => this.single(move, each));
      const more = move.each.length - MOST_SINGLE;
      if (more > 0) {
        rows.push(element("tr", { class: "single" }, element("td", { colspan: HEADS.length },
          `and ${more} more`)));
      }
      return rows;
    }

    single(move, [start, duration, distance, margin, lag, lost]) {
      const row = element("tr", { class: "single" },
        element("th", { scope: "row" }, element("button", { type: "button",
          onclick: () => this.state.goTo(start, start + duration) }, `at ${number(start, 8)} s`)),
        ...valueCells(["", "", this.length(distance, move, "distance"), "", duration.toFixed(6),
          this.length(lag, move, "lag"), percent(margin), signed(lost)]));
      return row;
    }

    marks(marks) {
      const timed = Mopro.timedMarks(this.state.view);
      const rows = timed.map((mark) => element("tr", {},
        element("td", {}, element("span", { class: mark.kind }, Mopro.SIGNS[mark.kind]),
          ` ${mark.kind}`),
        element("td", {}, element("button", { type: "button", onclick: () => this.toMark(mark) },
          mark.line > 0 ? `line ${mark.line}` : "there")),
        cellOf("from (s)", Number.isNaN(mark.time) ? "takes no time" : number(mark.time, 8)),
        element("td", {}, mark.text)));
      const found = folded("Marks", "marks", ["kind", "line", "from (s)", ""], rows);
      // Places that disagree have a table of their own.
      found.open = marks.some((mark) => mark.kind !== "gap");
      return found;
    }

    toMark(mark) {
      if (Number.isNaN(mark.time)) return;
      this.state.setTime(mark.time - 1e-9);
      if (mark.line > 0 && mark.kind !== "trip") this.state.goToLine(mark.line);
      else this.state.goTo(mark.time, mark.time);
    }
  }

  function folded(title, name, heads, rows) {
    return element("details", { open: true, class: name },
      element("summary", {}, element("h2", {}, title)),
      element("div", { class: "table" }, element("table", {},
        element("thead", {}, element("tr", {},
          ...heads.map((head) => element("th",
            { scope: "col", class: WORDS.has(head) ? null : "number" }, head)))),
        element("tbody", {}, ...rows))));
  }

  // What stands beside the line of a move.
  function valueCells(cells) { return cells.map((cell, i) => cellOf(HEADS[i + 1], cell)); }

  function cellOf(head, text) {
    return element("td", { class: WORDS.has(head) ? null : "number" }, text);
  }

  function cutWords({ cut, count }) {
    if (!cut) return "";
    return count > 1 ? ` (${cut} cut short)` : " (cut short)";
  }

  function percent(margin) { return margin === null ? "–" : `${Math.round(100 * margin)} %`; }

  function signed(count) { return count > 0 ? `+${count}` : String(count); }

  Object.assign(Mopro, { Tables });
})();
