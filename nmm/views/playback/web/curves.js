// How one panel's canvas is drawn: a lane a channel, one over another, all runs in each.
"use strict";
{
  const curves = (nmm.curves = {});
  // Pixels left of the curves and right of them; a lane's height alone in its panel and among others, where its
  // name stands above it; and below a lane.
  Object.assign(curves, { LEFT: 56, RIGHT: 10, GAP: 6 });
  const [ALONE, AMONG, NAME] = [84, 46, 15];
  const ROW = 20;
  const TINY = 1e-13;

  curves.height = (lane, count) =>
    lane.key === "partition" ? ROW * Math.max(1, having(lane).length) + 6 : count > 1 ? NAME + AMONG : ALONE;

  const having = (lane) => nmm.runs.filter((run) => run.columns[lane.key] && !run.hidden);

  // 1, 2 or 5 times a power of ten, of which at most about `count` fit into a width.
  curves.step = (width, count) => {
    const raw = width / count;
    const power = 10 ** Math.floor(Math.log10(raw));
    return power * ([1, 2, 5].find((factor) => factor * power >= raw) || 10);
  };
  curves.number = (value, step) => {
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
  curves.time = (value, step) => String(Number(value.toFixed(Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))))).replace("-", "−");

  // The samples of a run that are seen between two times, and one beyond each.
  const seen = (run, [from, to]) => [
    Math.max(0, nmm.before(run.t, from)),
    Math.min(run.t.length - 1, nmm.before(run.t, to) + 1),
  ];

  // What a lane's axis reaches over: the curves seen, and their limits where these are not far away.
  curves.scale = (lane, range) => {
    let [low, high, positive] = [Infinity, -Infinity, Infinity];
    const limits = new Map(); // each with whether it is an upper one
    for (const run of having(lane)) {
      const column = run.columns[lane.key];
      const [first, last] = seen(run, range);
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
    if (lane.log && high <= TINY) return { nothing: high === 0 ? "0 throughout" : "0 throughout, but for rounding" };
    if (lane.log && low >= 0) {
      let [least, most] = [Math.log10(Math.max(positive, 1e-10 * high)), Math.log10(high)];
      if (most - least < 0.3) [least, most] = [least - 0.15, most + 0.15];
      const room = 0.06 * (most - least);
      return { log: true, low: least - room, high: most + room, limits: [] };
    }
    const span = high - low;
    for (const end of limits.keys()) {
      const wide = Math.max(high, end) - Math.min(low, end);
      if (wide <= Math.max(2.5 * span, 1e-12)) [low, high] = [Math.min(low, end), Math.max(high, end)];
    }
    // A value that hardly moves is not shown as noise, nor with numbers that have no room.
    const most = Math.max(Math.abs(low), Math.abs(high));
    const half = most < 1e-12 ? 1 : 2.5e-4 * most;
    if (high - low < 2 * half) [low, high] = [low - half, high + half];
    const room = 0.08 * (high - low);
    return { log: false, low: low - room, high: high + room, limits: [...limits] };
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

  function ticks({ log, low, high }, height) {
    const most = height > 70 ? 5 : 3;
    const step = log ? Math.max(1, Math.ceil((high - low) / most)) : between(low, high, most);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      found.push({ at: k * step, text: log ? raised(k * step) : curves.number(k * step, step) });
    }
    if (!log || found.length > 1) return found;
    // Within one decade a logarithmic axis has its 2 and 5, too, or says where it ends.
    for (let k = Math.floor(low); k < high; k++) {
      for (const factor of [2, 5]) {
        const at = k + Math.log10(factor);
        if (at > low && at < high) found.push({ at, text: `${factor}·${raised(k)}` });
      }
    }
    const few = (value) => String(Number((10 ** value).toPrecision(3)));
    return found.length > 1 ? found : [low, high].map((at) => ({ at, text: few(at) }));
  }

  // The line through a run's samples; of many in one column of pixels the extremes.
  function trace(pen, run, values, range, x, y) {
    const [first, last] = seen(run, range);
    let [open, column, low, high, final] = [false, NaN, 0, 0, 0];
    const flush = () => {
      if (Number.isNaN(column)) return;
      if (low !== high) {
        pen.lineTo(column, low);
        pen.lineTo(column, high);
      }
      pen.lineTo(column, final);
    };
    pen.beginPath();
    const dense = last - first > 2 * pen.canvas.clientWidth;
    for (let i = first; i <= last; i++) {
      const at = y(values[i]);
      if (!Number.isFinite(at)) {
        if (open) flush();
        [open, column] = [false, NaN];
        continue;
      }
      const px = dense ? Math.round(x(run.t[i])) : x(run.t[i]);
      if (!open) pen.moveTo(px, at);
      if (open && px !== column) flush();
      if (!open || px !== column) [column, low, high] = [px, at, at];
      low = Math.min(low, at);
      high = Math.max(high, at);
      final = at;
      open = true;
    }
    if (open) flush();
    pen.stroke();
    if (first === last && run.t.length === 1) {
      pen.beginPath();
      pen.arc(x(run.t[0]), y(values[0]), 3, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  const fit = (pen, text, width) => {
    if (pen.measureText(text).width <= width) return text;
    let short = text;
    while (short.length > 1 && pen.measureText(`${short}…`).width > width) short = short.slice(0, -1);
    return `${short}…`;
  };

  function band(pen, lane, top, { range, x, right, colors }) {
    having(lane).forEach((run, row) => {
      const values = run.columns[lane.key].values;
      const [y, height] = [top + 3 + row * ROW, ROW - 3];
      let [from, end] = seen(run, range);
      for (let i = from; i <= end; i++) {
        if (i < end && values[i + 1] === values[from]) continue;
        const [x0, x1] = [Math.max(x(run.t[from]), curves.LEFT), Math.min(x(run.t[Math.min(i + 1, end)]), right)];
        pen.globalAlpha = values[from] % 2 ? 0.42 : 0.2;
        pen.fillStyle = run.color;
        pen.fillRect(x0, y, Math.max(x1 - x0, 1), height);
        pen.globalAlpha = 1;
        pen.fillStyle = colors.ink;
        // The switch itself.
        if (from > 0 && x(run.t[from]) > curves.LEFT) pen.fillRect(x0 - 0.75, y - 2, 1.5, height + 4);
        const text = run.partitions[values[from]] ?? "";
        if (pen.measureText(text).width < x1 - x0 - 8) pen.fillText(text, x0 + 5, y + 0.5 * height);
        from = i + 1;
      }
      pen.fillStyle = run.color;
      pen.textAlign = "right";
      pen.fillText(fit(pen, run.name, curves.LEFT - 8), curves.LEFT - 6, y + 0.5 * height);
      pen.textAlign = "left";
    });
  }

  // about: {range, x: time -> px, right: px, marks: times of the grid, alone: whether no other lane is in the
  // panel, colors}
  curves.draw = (pen, lane, upper, whole, about) => {
    const { x, right, colors, alone } = about;
    const [top, height] = alone ? [upper, whole] : [upper + NAME, whole - NAME];
    pen.font = colors.font;
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    if (lane.key === "partition") return band(pen, lane, upper, about);
    const scale = curves.scale(lane, about.range);
    const y = (value) =>
      top + height * (1 - ((scale.log ? (value > 0 ? Math.log10(value) : NaN) : value) - scale.low) / (scale.high - scale.low));
    const level = (value, color, width = 1) => {
      pen.fillStyle = color;
      pen.fillRect(curves.LEFT, Math.round(value - 0.5 * width), right - curves.LEFT, width);
    };
    pen.fillStyle = colors.plot;
    pen.fillRect(curves.LEFT, top, right - curves.LEFT, height);
    pen.fillStyle = colors.line;
    for (const mark of about.marks) pen.fillRect(Math.round(x(mark)), top, 1, height);
    const away = [];
    if (!scale.nothing) {
      for (const { at, text } of ticks(scale, height)) {
        const px = top + height * (1 - (at - scale.low) / (scale.high - scale.low));
        level(px, at === 0 && !scale.log ? colors.zero : colors.line);
        pen.fillStyle = colors.quiet;
        pen.textAlign = "right";
        pen.fillText(text, curves.LEFT - 5, Math.min(Math.max(px, top + 5), top + height - 5));
        pen.textAlign = "left";
      }
      pen.save();
      pen.beginPath();
      pen.rect(curves.LEFT, top, right - curves.LEFT, height);
      pen.clip();
      for (const [end, upper] of scale.limits) {
        if (end < scale.low || end > scale.high) away.push(end);
        else limit(pen, y(end), top, height, { upper, right, colors });
      }
      pen.lineJoin = "round";
      pen.lineWidth = 1.7;
      for (const run of having(lane)) {
        pen.strokeStyle = pen.fillStyle = run.color;
        pen.setLineDash(run.dash);
        trace(pen, run, run.columns[lane.key].values, about.range, x, y);
      }
      pen.restore();
    }
    tell(pen, lane, upper, scale.nothing || limits(away), about);
    return undefined;
  };

  // Limits that are out of the picture.
  function limits(ends) {
    const [low, ...rest] = ends.sort((a, b) => a - b).map((end) => String(Number(end.toPrecision(3))).replace("-", "−"));
    if (low === undefined) return "";
    if (rest.length === 0) return `limit ${low}`;
    return rest.length === 1 && low === `−${rest[0]}` ? `limits ±${rest[0]}` : `limits ${[low, ...rest].join(", ")}`;
  }

  function limit(pen, at, top, height, { upper, right, colors }) {
    pen.fillStyle = colors.alarm;
    pen.globalAlpha = 0.1;
    pen.fillRect(curves.LEFT, upper ? top : at, right - curves.LEFT, upper ? at - top : top + height - at);
    pen.globalAlpha = 1;
    pen.strokeStyle = colors.alarm;
    pen.lineWidth = 1;
    pen.setLineDash([4, 3]);
    pen.beginPath();
    pen.moveTo(curves.LEFT, at);
    pen.lineTo(right, at);
    pen.stroke();
    pen.setLineDash([]);
  }

  curves.named = (lane) => (lane.unit ? `${lane.text} [${lane.unit}]` : lane.text);

  // Where its limits are, if out of the picture, or that there is nothing to see: within a curve that is alone in its
  // panel, else beside its name.
  function tell(pen, lane, top, aside, { right, alone, colors }) {
    if (!alone) return (lane.aside.textContent = aside);
    Object.assign(pen, { textAlign: "right", lineWidth: 4, lineJoin: "round", strokeStyle: colors.plot, fillStyle: colors.quiet });
    pen.strokeText(aside, right - 6, top + 10);
    pen.fillText(aside, right - 6, top + 10);
    pen.textAlign = "left";
    return undefined;
  }
}
