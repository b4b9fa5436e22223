// Units as the person wants them: inches or SI, with a size that suits the values.
"use strict";

(function () {
  // dimension -> system -> units [name, size in SI], the largest first.
  const UNITS = {
    length: {
      inch: [["in", 0.0254], ["mil", 2.54e-5, "mil = 0.001 in"], ["µin", 2.54e-8]],
      SI: [["m", 1], ["mm", 1e-3], ["µm", 1e-6], ["nm", 1e-9]],
    },
    velocity: {
      inch: [["in/s", 0.0254]],
      SI: [["m/s", 1], ["mm/s", 1e-3], ["µm/s", 1e-6]],
    },
    force: { inch: [["lbf", 4.4482216152605]], SI: [["kN", 1e3], ["N", 1], ["mN", 1e-3]] },
  };
  // The largest value is at least this many of its unit.
  const LEAST = { length: 0.2, velocity: 0.2, force: 0.5 };

  // Unit in which values up to `size` (SI) are shown: its name, what explains it, the factor.
  function unitFor(dimension, unit, system, size) {
    const known = UNITS[dimension];
    if (!known) return { name: unit, words: unit, factor: 1 };
    const units = known[system];
    const [name, si, words] = units.find(([, one]) => size >= LEAST[dimension] * one)
      || units[size > 0 ? units.length - 1 : 0];
    return { name, words: words || name, factor: 1 / si };
  }

  function number(value, digits = 5) {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const size = Math.abs(value);
    return size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 2)
      : String(Number(value.toPrecision(digits)));
  }

  // A low and a high value, or the one that both are, in as many decimals as the largest of their
  // kind, `most`, has with these `digits`: so that a value does not jump as it changes.
  function range(ends, factor, most = 0, digits = 5) {
    const [one, other] = ends.map((value) => fixed(value * factor, most * factor, digits));
    return one === other ? one : `${one} … ${other}`;
  }

  function fixed(value, most, digits) {
    if (!Number.isFinite(value)) return "–";
    const decimals = digits - 1 - Math.floor(Math.log10(most));
    if (!(decimals >= 0 && decimals <= 9)) return number(value, digits);
    const text = value.toFixed(decimals);
    return Number(text) === 0 ? (0).toFixed(decimals) : text;
  }

  Object.assign(Mopro, { unitFor, number, range });
})();
