// How one panel's canvas is drawn: a lane a channel, one over another, all runs in each. A lane of one's own holds
// several channels, in colours of their own, over time or over another channel.
"use strict";
{
  const curves = (nmm.curves = {});
  const { axes } = nmm;
  // Pixels left of the curves and right of them; a lane's height alone in its panel and among others, where its
  // name stands above it; and below a lane.
  Object.assign(curves, { LEFT: 56, RIGHT: 10, GAP: 6 });
  const [ALONE, AMONG, NAME] = [84, 46, 15];
  const ROW = 20;

  curves.height = (lane, count) => {
    if (lane.key === "partition") return ROW * Math.max(1, curves.traces(lane).length) + 6;
    return lane.height ?? (count > 1 ? NAME + AMONG : ALONE);
  };

  // The lines of a lane: of each channel, each run that has it and is shown.
  curves.traces = (lane) =>
    (lane.signals ?? [lane]).flatMap(({ key, color }) =>
      nmm.runs
        .filter((run) => run.columns[key] && (!lane.over || run.columns[lane.over]) && !run.hidden)
        .map((run) => ({ run, key, column: run.columns[key], color: color ?? run.color })),
    );
  // The samples of a run that are seen between two times, and one beyond each.
  const seen = (run, [from, to]) => [
    Math.max(0, nmm.before(run.t, from)),
    Math.min(run.t.length - 1, nmm.before(run.t, to) + 1),
  ];
  curves.seen = seen;
  const seenOf = (traces, range, key) =>
    traces.map(({ run, column }) => {
      const [first, last] = seen(run, range);
      return { column: key ? run.columns[key] : column, first, last };
    });

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
    curves.traces(lane).forEach(({ run }, row) => {
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
    const { right, colors, alone } = about;
    const below = lane.over ? 16 : 0;
    const [top, height] = alone ? [upper, whole - below] : [upper + NAME, whole - NAME];
    pen.font = colors.font;
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    if (lane.key === "partition") return band(pen, lane, upper, about);
    const traces = curves.traces(lane);
    const scale = axes.over(seenOf(traces, about.range), lane.log, lane.zoom);
    const across = lane.over ? axes.over(seenOf(traces, about.range, lane.over), false) : null;
    const nothing = scale.nothing || across?.nothing;
    if (across && !nothing && lane.square && !scale.log && !lane.zoom) square(scale, across, height, right - curves.LEFT);
    const share = ({ low, high, log }, value) => ((log ? (value > 0 ? Math.log10(value) : NaN) : value) - low) / (high - low);
    const y = (value) => top + height * (1 - share(scale, value));
    const x = across ? (value) => curves.LEFT + (right - curves.LEFT) * share(across, value) : about.x;
    Object.assign(lane, { scale: nothing ? null : scale, across, plot: { top, height, x, y } });
    const level = (value, color, width = 1) => {
      pen.fillStyle = color;
      pen.fillRect(curves.LEFT, Math.round(value - 0.5 * width), right - curves.LEFT, width);
    };
    pen.fillStyle = colors.plot;
    pen.fillRect(curves.LEFT, top, right - curves.LEFT, height);
    pen.fillStyle = colors.line;
    if (!across) for (const mark of about.marks) pen.fillRect(Math.round(x(mark)), top, 1, height);
    const away = [];
    if (!nothing) {
      if (across) numbersBelow(pen, lane, x, right, colors);
      for (const { at, text } of axes.ticks(scale, height)) {
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
      for (const [end, upper] of lane.signals ? [] : scale.limits) {
        if (end < scale.low || end > scale.high) away.push(end);
        else limit(pen, y(end), top, height, { upper, right, colors });
      }
      pen.lineJoin = "round";
      pen.lineWidth = 1.7;
      for (const { run, column, color } of traces) {
        pen.strokeStyle = pen.fillStyle = color;
        pen.setLineDash(run.dash);
        if (across) way(pen, run.columns[lane.over].values, column.values, seen(run, about.range), x, y);
        else trace(pen, run, column.values, about.range, x, y);
      }
      pen.restore();
    }
    tell(pen, lane, upper, nothing || limits(away), about);
    return undefined;
  };

  // The line through the points of two channels, broken where either has no value.
  function way(pen, along, values, [first, last], x, y) {
    pen.beginPath();
    let open = false;
    for (let i = first; i <= last; i++) {
      const [left, top] = [x(along[i]), y(values[i])];
      const known = Number.isFinite(left) && Number.isFinite(top);
      if (known && open) pen.lineTo(left, top);
      else if (known) pen.moveTo(left, top);
      open = known;
    }
    pen.stroke();
  }

  // A metre is as long in both directions: the shorter axis reaches farther.
  function square(scale, across, height, width) {
    const [down, along] = [(scale.high - scale.low) / height, (across.high - across.low) / width];
    const [one, factor] = down > along ? [across, down / along] : [scale, along / down];
    const [middle, half] = [0.5 * (one.low + one.high), 0.5 * factor * (one.high - one.low)];
    Object.assign(one, { low: middle - half, high: middle + half });
  }

  function numbersBelow(pen, { across, plot: { top, height } }, x, right, colors) {
    let end = -Infinity;
    for (const { at, text } of axes.ticks(across, 90)) {
      pen.fillStyle = at === 0 ? colors.zero : colors.line;
      pen.fillRect(Math.round(x(at)), top, 1, height);
      const wide = pen.measureText(text).width;
      const left = Math.min(Math.max(x(at) - 0.5 * wide, curves.LEFT), right - wide);
      if (left < end + 6) continue;
      pen.fillStyle = colors.quiet;
      pen.fillText(text, left, top + height + 9);
      end = left + wide;
    }
  }

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
