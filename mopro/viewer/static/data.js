// Data of the page: one block of typed arrays, and tracks with their samples.
"use strict";
var Mopro = {};

(function () {
  const TYPES = { f32: Float32Array, f64: Float64Array, i32: Int32Array };

  async function inflated(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  function array(block, reference) {
    if (!reference) return null;
    if ("step" in reference) {
      return Float64Array.from({ length: reference.count },
        (_, i) => reference.start + i * reference.step);
    }
    return new TYPES[reference.type](block, reference.at, reference.count);
  }

  // The last index whose value is not above `value`; -1 if there is none.
  function lastAt(values, value) {
    let low = -1, high = values.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (values[middle] <= value) low = middle; else high = middle;
    }
    return low;
  }

  // Samples (size 1) or buckets of samples, each with its least and greatest value in the order
  // in which they occur.
  class Part {
    constructor(size, start, end, channels) {
      Object.assign(this, { size, start, end, channels });
    }

    static of(block, stated) {
      const channels = {};
      for (const [name, ends] of Object.entries(stated.channels)) {
        const first = array(block, ends.first);
        channels[name] = { first, second: array(block, ends.second) || first };
      }
      const start = array(block, stated.start);
      return new Part(stated.size, start, array(block, stated.end) || start, channels);
    }

    get first() { return this.start[0]; }
    get last() { return this.end[this.end.length - 1]; }
    covers(from, to) { return this.first <= from && to <= this.last; }

    // What a plot joins: of each bucket one extreme at its start, the other at its end.
    times() { return this.size === 1 ? this.start : interleaved(this.start, this.end, 1); }

    values(name, factor) {
      const { first, second } = this.channels[name];
      const values = this.size === 1
        ? Float64Array.from(first, (v) => v * factor) : interleaved(first, second, factor);
      return values.some(Number.isNaN)
        ? Array.from(values, (v) => Number.isNaN(v) ? null : v) : values;
    }

    // The values of a channel around a time: [low, high].
    at(name, time) {
      const ends = this.channels[name];
      const last = this.start.length - 1;
      let index = Math.max(0, lastAt(this.start, time));
      if (this.size === 1 && index < last
          && this.start[index + 1] - time < time - this.start[index]) index += 1;
      const one = ends.first[index], other = ends.second[index];
      return one <= other ? [one, other] : [other, one];
    }

    // The largest size of the values of a channel.
    most(name) {
      const { first, second } = this.channels[name];
      let most = 0;
      for (let i = 0; i < first.length; i++) {
        most = Math.max(most, Math.abs(first[i]) || 0, Math.abs(second[i]) || 0);
      }
      return most;
    }
  }

  function interleaved(first, second, factor) {
    const both = new Float64Array(2 * first.length);
    for (let i = 0; i < first.length; i++) {
      both[2 * i] = first[i] * factor;
      both[2 * i + 1] = second[i] * factor;
    }
    return both;
  }

  // An overview of the whole, and stretches that are there in full.
  class Track {
    constructor(parts) { this.parts = parts; }

    get overview() { return this.parts[0]; }
    has(name) { return name in this.overview.channels; }
    partFor(from, to) {
      return this.parts.slice(1).find((part) => part.covers(from, to)) || this.overview;
    }
    at(name, time) { return this.partFor(time, time).at(name, time); }
  }

  // The source line that runs at each time, and when each line runs.
  class Lines {
    constructor(time, line) { Object.assign(this, { time, line }); }

    at(time) {
      const index = lastAt(this.time, time);
      return index < 0 ? 0 : this.line[index];
    }

    // The first stretch [from, to] of `line` that begins after `time`, or its first of all.
    next(line, time, end) {
      let found = -1;
      for (let i = 0; i < this.line.length; i++) {
        if (this.line[i] !== line) continue;
        if (found < 0) found = i;
        if (this.time[i] > time) { found = i; break; }
      }
      if (found < 0) return null;
      return [this.time[found], found + 1 < this.time.length ? this.time[found + 1] : end];
    }
  }

  async function load(stated) {
    const block = await inflated(stated.block);
    for (const view of stated.views) {
      const tracks = {};
      for (const [name, track] of Object.entries(view.tracks)) {
        tracks[name] = new Track(track.parts.map((part) => Part.of(block, part)));
      }
      view.tracks = tracks;
      view.lines = view.lines
        && new Lines(array(block, view.lines.time), array(block, view.lines.line));
    }
    return stated;
  }

  Object.assign(Mopro, { load, lastAt, Part, Track, Lines });
})();
