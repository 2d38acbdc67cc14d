// The axes of plots: what they reach over, and their ticks.
"use strict";
{
  const axes = (nmm.axes = {});
  // Below this everything is rounding.
  const TINY = 1e-13;
  // Two numbers of an axis are at least so far apart, px.
  const APART = 11;

  // 1, 2 or 5 times a power of ten, of which at most about `count` fit into a width.
  axes.step = (width, count) => {
    const raw = width / count;
    const power = 10 ** Math.floor(Math.log10(raw));
    return power * ([1, 2, 5].find((factor) => factor * power >= raw) || 10);
  };
  axes.number = (value, step) => {
    const size = Math.abs(value);
    if (size < 1e-9 * step) return "0";
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const text = value.toFixed(digits);
    // As many digits as tell one tick from the next.
    const told = Math.max(0, Math.floor(Math.log10(size)) - Math.floor(Math.log10(step) + 1e-9));
    const short = size >= 1e5 || text.length > 8 ? value.toExponential(told) : text;
    return short.replaceAll("-", "−").replace("e+", "e");
  };

  // A time to the digits of a step, without the zeros that say nothing.
  axes.time = (value, step) => String(Number(value.toFixed(Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))))).replace("-", "−");

  // What an axis reaches over: the curves seen, `columns` with the samples [first, last] of each, and their limits
  // where these are not far away; `zoom` {low, high}, if any, instead. A logarithmic one is in powers of ten.
  axes.over = (columns, log, zoom) => {
    let [low, high, positive] = [Infinity, -Infinity, Infinity];
    const limits = new Map(); // each with whether it is an upper one
    for (const { column, first, last } of columns) {
      for (let i = first; i <= last; i++) {
        const value = column.values[i];
        if (!Number.isFinite(value)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
        if (value > TINY && value < positive) positive = value;
      }
      column.limits.forEach((end, i) => end !== null && limits.set(end, i === 1));
    }
    if (low > high) return { nothing: "no values here" };
    if (log && high <= TINY) return { nothing: high === 0 ? "0 throughout" : "0 throughout, but for rounding" };
    if (log && low >= 0) {
      let [least, most] = [Math.log10(Math.max(positive, 1e-10 * high)), Math.log10(high)];
      if (most - least < 0.3) [least, most] = [least - 0.15, most + 0.15];
      const room = 0.06 * (most - least);
      return { log: true, low: least - room, high: most + room, limits: [], ...zoom };
    }
    const span = high - low;
    for (const end of limits.keys()) {
      const wide = Math.max(high, end) - Math.min(low, end);
      if (wide <= Math.max(2.5 * span, 1e-12)) [low, high] = [Math.min(low, end), Math.max(high, end)];
    }
    // A value that hardly moves is not shown as noise, nor with numbers that have no room; 0 of what is never less
    // is at the bottom.
    const most = Math.max(Math.abs(low), Math.abs(high));
    const still = most < 1e-12 ? 1 : 2.5e-4 * most;
    const never = limits.get(0) === false; // is it less
    if (high - low < 2 * still) [low, high] = never && most < 1e-12 ? [0, 1] : [low - still, high + still];
    const room = 0.08 * (high - low);
    return { log: false, low: low - (never && low === 0 ? 0.5 * room : room), high: high + room, limits: [...limits], ...zoom };
  };

  // Whether numbers can tell the ends of an axis, and from each other: those of a logarithmic one are powers.
  axes.told = (low, high, log) => {
    const most = Math.max(Math.abs(low), Math.abs(high));
    return most < (log ? 300 : 1e250) && high - low > Math.max(1e-9 * most, log ? 1e-6 : 1e-80);
  };

  // The least of 1, 2, 4 or 5 times a power of ten of which no more than `most` lie between two values: that
  // leaves at least two of them, for `most` of 3 or more.
  function between(low, high, most) {
    const count = (step) => Math.floor(high / step + 1e-9) - Math.ceil(low / step - 1e-9) + 1;
    for (let power = 10 ** Math.floor(Math.log10((high - low) / most) - 1); ; power *= 10) {
      const factor = [1, 2, 4, 5].find((factor) => count(factor * power) <= most);
      if (factor) return factor * power;
    }
  }

  const raised = (power) => `10${String(power).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]))}`;

  // The numbers on an axis, of a height in px, each with its place: no two collide, and a logarithmic axis has three.
  axes.ticks = ({ log, low, high }, height) => {
    const most = Math.min(height > 70 ? 5 : 3, Math.max(2, Math.floor(height / APART)));
    const place = (at) => (height * (at - low)) / (high - low);
    const step = log ? Math.max(1, Math.ceil((high - low) / most)) : between(low, high, most);
    const found = apart(steps(low, high, step, log ? raised : (at) => axes.number(at, step)), place);
    if (!log || found.length > 2) return found;
    // Of few decades, 2 and 5 of each; within one, round numbers.
    for (let k = Math.floor(low); k < high; k++) {
      for (const factor of [2, 5]) {
        const at = k + Math.log10(factor);
        if (at > low && at < high) found.push({ at, text: `${factor}·${raised(k)}` });
      }
    }
    const few = apart(found, place);
    for (let count = most; few.length < 3 && count < 13; count++) {
      const [least, largest] = [10 ** low, 10 ** high];
      const round = between(least, largest, count);
      const all = steps(least, largest, round, (at) => axes.number(at, round));
      few.splice(0, few.length, ...apart(all.map(({ at, text }) => ({ at: Math.log10(at), text })), place));
    }
    return few;
  };

  function steps(low, high, step, text) {
    const all = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) all.push({ at: k * step, text: text(k * step) });
    return all;
  }

  // The first ones stay.
  const apart = (found, place) =>
    found.filter(({ at }, i) => found.slice(0, i).every((before) => Math.abs(place(before.at) - place(at)) >= APART));
}
