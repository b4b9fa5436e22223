// Traces of which a line would be a stain: pale where the values passed, darker where they stayed.
"use strict";

(function () {
  // The path of a line, in heights of the plot for each column, beyond which it is a stain.
  const STAIN = 0.3;
  // Pieces that are wider than this (px) are pale, with a line through their middles.
  const WIDE = 2, PALE = 0.35;
  const PALEST = 0.15, DARKEST = 0.8, DARKER = 0.12;

  // The pieces of a part in the stretch shown, in pixels of the canvas: when each begins and ends,
  // and the two values between which the trace was.
  class Pieces {
    constructor(u, part, name, factor) {
      const { min, max } = u.scales.x, { min: low, max: high } = u.scales.y;
      const { first, second } = part.channels[name];
      this.box = u.bbox;
      this.x = (time) => (time - min) / (max - min) * this.box.width;
      this.y = (value) => (high - value * factor) / (high - low) * this.box.height;
      this.part = part;
      this.ends = part.size === 1 ? [first, first.slice(1)] : [first, second];
      const last = part.start.length - (part.size === 1 ? 2 : 1);
      this.from = Math.max(0, Mopro.lastAt(part.start, min));
      this.to = Math.min(last, Mopro.lastAt(part.start, max));
    }

    // Until the next piece begins, unless nothing was measured in between.
    end(index) {
      const { start, end } = this.part;
      const next = start[index + 1];
      const own = end[index] - start[index];
      return next === undefined || (own > 0 && next - end[index] > 3 * own) ? end[index] : next;
    }

    // Path of the trace up and down, in heights of the plot for each column.
    ink() {
      const [one, other] = this.ends;
      let way = 0;
      for (let i = this.from; i <= this.to; i++) {
        way += Math.abs(this.y(one[i]) - this.y(other[i])) || 0;
      }
      return way / this.box.height / this.box.width * devicePixelRatio;
    }

    get width() { return this.box.width / Math.max(1, this.to - this.from + 1); }

    // Call `act` for each piece: its columns [from, to], its rows [top, bottom], the share of a
    // column that it lasts.
    each(act) {
      const width = Math.round(this.box.width), height = Math.round(this.box.height);
      const [one, other] = this.ends;
      for (let i = this.from; i <= this.to; i++) {
        const a = this.y(one[i]), b = this.y(other[i]);
        if (Number.isNaN(a) || Number.isNaN(b)) continue;
        const begin = this.x(this.part.start[i]), end = this.x(this.end(i));
        const from = Math.max(0, Math.floor(begin));
        const to = Math.min(width - 1, Math.max(from, Math.ceil(end) - 1));
        const top = clamped(Math.min(a, b), height), bottom = clamped(Math.max(a, b), height);
        if (from <= to) act(from, to, top, bottom, Math.min(1, Math.max(end - begin, 1e-3)));
      }
    }
  }

  function clamped(y, height) { return Math.min(height - 1, Math.max(0, Math.round(y))); }

  // True if a trace is drawn as an area: buckets always, samples where a line would be a stain.
  function isArea(u, part, name, factor) {
    return part.size > 1 || new Pieces(u, part, name, factor).ink() > STAIN;
  }

  function drawArea(u, part, name, factor, color) {
    const pieces = new Pieces(u, part, name, factor);
    const width = Math.round(u.bbox.width), height = Math.round(u.bbox.height);
    if (!(width > 0 && height > 0)) return;
    const columns = collected(pieces, width, height);
    const wide = pieces.width > WIDE * devicePixelRatio;
    const { ctx } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    ctx.translate(u.bbox.left, u.bbox.top);
    ctx.drawImage(picture(columns, width, height, color, wide), 0, 0);
    ctx.strokeStyle = color;
    ctx.lineJoin = "round";
    ctx.lineWidth = devicePixelRatio;
    if (wide) drawMiddles(ctx, pieces);
    else drawExtremes(ctx, columns);
    ctx.restore();
  }

  // Of each column the least and the greatest row, and for each row how long values stayed there.
  function collected(pieces, width, height) {
    const top = new Int32Array(width).fill(height), bottom = new Int32Array(width).fill(-1);
    const time = new Float64Array(width);
    // Changes of the time spent from one row to the next.
    const change = new Float64Array(width * (height + 1));
    pieces.each((from, to, high, low, share) => {
      const each = share / (low - high + 1);
      for (let x = from; x <= to; x++) {
        top[x] = Math.min(top[x], high);
        bottom[x] = Math.max(bottom[x], low);
        time[x] += share;
        change[x * (height + 1) + high] += each;
        change[x * (height + 1) + low + 1] -= each;
      }
    });
    return { top, bottom, time, change };
  }

  function picture({ top, bottom, time, change }, width, height, color, even) {
    const canvas = document.createElement("canvas");
    canvas.width = width;
    canvas.height = height;
    const pen = canvas.getContext("2d");
    const image = pen.createImageData(width, height);
    const [red, green, blue] = [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16));
    for (let x = 0; x < width; x++) {
      let spent = 0;
      for (let y = top[x]; y <= bottom[x]; y++) {
        spent += change[x * (height + 1) + y];
        // 1 where the values are spread evenly over the whole plot.
        const dense = Math.max(0, spent) / time[x] * height;
        const alpha = even ? PALE : Math.min(DARKEST, PALEST + DARKER * Math.log2(1 + dense));
        image.data.set([red, green, blue, 255 * alpha], 4 * (y * width + x));
      }
    }
    pen.putImageData(image, 0, 0);
    return canvas;
  }

  function drawExtremes(ctx, { top, bottom }) {
    for (const rows of [top, bottom]) {
      ctx.beginPath();
      for (let x = 0; x < rows.length; x++) if (bottom[x] >= 0) ctx.lineTo(x + 0.5, rows[x] + 0.5);
      ctx.stroke();
    }
  }

  function drawMiddles(ctx, pieces) {
    ctx.beginPath();
    pieces.each((from, to, top, bottom) => ctx.lineTo((from + to + 1) / 2, (top + bottom) / 2));
    ctx.stroke();
  }

  Object.assign(Mopro, { isArea, drawArea });
})();
