// Puts the page together from its data.
"use strict";

(function () {
  const { element } = Mopro;

  function room(name) { return element("section", { class: name }); }

  function build(views, units) {
    const state = new Mopro.State(views, units);
    const rooms = Object.fromEntries(
      ["player", "program", "platen", "vector", "plots", "tables"].map((n) => [n, room(n)]));
    const side = element("aside", {}, rooms.program, rooms.platen, rooms.vector);
    document.getElementById("viewer").append(rooms.player,
      element("div", { class: "columns" }, side, rooms.plots), rooms.tables);
    Mopro.state = state;
    Mopro.plots = new Mopro.Plots(state, rooms.plots);
    Mopro.player = new Mopro.Player(state, rooms.player);
    new Mopro.Program(state, rooms.program);
    new Mopro.Platen(state, rooms.platen);
    new Mopro.Vector(state, rooms.vector);
    new Mopro.Tables(state, rooms.tables);
    const bare = () => {
      side.hidden = rooms.program.hidden && rooms.platen.hidden && rooms.vector.hidden;
    };
    state.on("view", bare);
    bare();
    return state;
  }

  async function begin() {
    const stated = JSON.parse(document.getElementById("page-data").textContent);
    if (stated.live) { Mopro.live = new Mopro.Live(stated.live); return; }
    if (!stated.views.length) return;
    build((await Mopro.load(stated)).views, stated.units);
    document.documentElement.dataset.ready = "yes";
  }

  Object.assign(Mopro, { build });
  begin();
})();
