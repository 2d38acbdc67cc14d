// Parallel coordinates: an axis a column, a line a rollout, brushes that filter.
const parallel = { canvas: $("parallel"), names: [], axes: [], drag: null };
const EDGE = { top: 50, bottom: 26, side: 62 };

function drawParallel() {
  const { context, width, height } = fitted(parallel.canvas);
  const hue = colouring(byName.get($("colour").value));
  const low = height - EDGE.bottom, high = EDGE.top;
  parallel.axes = parallel.names.map((name, k) => {
    const column = byName.get(name), count = parallel.names.length;
    const x = EDGE.side + (count > 1 ? (k * (width - 2 * EDGE.side)) / (count - 1) : 0);
    const log = logarithmic(column), known = isText(column) ? column.codes : numbersOf(column);
    const values = log ? known.map((value) => (value === null ? null : Math.log10(value))) : known;
    const [least, most] = isText(column) ? [-0.5, column.levels.length - 0.5] : extent(values);
    const place = (value) => low + ((value - least) / (most - least)) * (high - low);
    return { column, x, values, least, most, place, value: (share) => (log ? 10 ** share : share), log };
  });
  context.clearRect(0, 0, width, height);
  for (const wanted of [0, 1]) {
    context.globalAlpha = wanted ? Math.max(0.12, Math.min(0.8, 250 / N)) : 1;
    context.lineWidth = 1;
    for (const row of hue.order) {
      if (kept[row] !== wanted) continue;
      context.strokeStyle = wanted ? hue.of(row) : style("--faint");
      trace(context, row);
    }
  }
  context.globalAlpha = 1;
  if (chosen >= 0) {
    context.strokeStyle = style("--ink");
    context.lineWidth = 2.5;
    trace(context, chosen);
  }
  context.lineWidth = 1.5;
  context.textAlign = "center";
  const label = (text, x, y) => { // readable over the lines
    context.strokeStyle = style("--paper");
    context.lineWidth = 4;
    context.strokeText(text, x, y);
    context.fillText(text, x, y);
    context.lineWidth = 1.5;
  };
  parallel.axes.forEach(({ column, x, least, most, place, value, log }, k) => {
    context.strokeStyle = context.fillStyle = style("--ink");
    line(context, [[x, low], [x, high]]);
    label(titled(column) + (log ? " (log)" : ""), x, k % 2 ? 27 : 12);
    if (isText(column)) column.levels.forEach((name, level) => label(name, x, place(level) + 4));
    else {
      label(written(value(least)), x, low + 16);
      label(written(value(most)), x, high - 6);
    }
    const brush = filters.get(column.name);
    if (brush && brush.place) {
      context.fillStyle = style("--accent");
      context.globalAlpha = 0.35;
      context.fillRect(x - 7, brush.place[0], 14, brush.place[1] - brush.place[0]);
      context.globalAlpha = 1;
    }
  });
}

// What is measured and spans decades.
function logarithmic(column) {
  if (isText(column) || column.varied) return false;
  const known = numbersOf(column).filter((value) => value !== null);
  const [least, most] = extent(known);
  return known.length > 0 && least > 0 && most > 100 * least;
}

// A line, broken where a value is not known.
function trace(context, row) {
  context.beginPath();
  let pen = false;
  for (const { x, values, place } of parallel.axes) {
    const value = values[row];
    if (value === null || value < -1e300) pen = false;
    else {
      if (pen) context.lineTo(x, place(value));
      else context.moveTo(x, place(value));
      pen = true;
    }
  }
  context.stroke();
}

function brushed(axis, from, to) {
  const low = parallel.canvas.clientHeight - EDGE.bottom;
  const clamp = (y) => Math.min(Math.max(y, EDGE.top), low);
  const [top, bottom] = [clamp(Math.min(from, to)), clamp(Math.max(from, to))];
  if (bottom - top < 4) return null;
  const share = (y) => axis.least + ((low - y) / (low - EDGE.top)) * (axis.most - axis.least);
  const [least, most] = [share(bottom), share(top)];
  if (isText(axis.column)) {
    const names = new Set(axis.column.levels.filter((_, level) => level >= least && level <= most));
    return { text: [...names].join("|"), place: [top, bottom], test: (name) => names.has(name) };
  }
  // at the ends of an axis rounding must not leave out the ends
  const slack = 1e-9 * (axis.most - axis.least);
  return { ...ranged(axis.value(least - slack), axis.value(most + slack)), place: [top, bottom] };
}

parallel.canvas.addEventListener("pointerdown", (event) => {
  const axis = parallel.axes.find((one) => Math.abs(one.x - event.offsetX) < 22);
  if (!axis) return;
  parallel.drag = { axis, from: event.offsetY };
  parallel.canvas.setPointerCapture(event.pointerId);
  event.preventDefault();
});
parallel.canvas.addEventListener("pointermove", (event) => {
  if (!parallel.drag) return;
  const { axis, from } = parallel.drag;
  setFilter(axis.column.name, brushed(axis, from, event.offsetY));
});
parallel.canvas.addEventListener("pointerup", (event) => {
  if (!parallel.drag) return;
  const { axis, from } = parallel.drag;
  parallel.drag = null;
  setFilter(axis.column.name, brushed(axis, from, event.offsetY));
});
