// Parallel coordinates: an axis a column, a line a rollout, brushes that filter.
const parallel = { canvas: $("parallel"), names: [], axes: [], drag: null };
const EDGE = { top: 34, bottom: 26, side: 46 };

function drawParallel() {
  const { context, width, height } = fitted(parallel.canvas);
  const hue = colouring(byName.get($("colour").value));
  const low = height - EDGE.bottom, high = EDGE.top;
  parallel.axes = parallel.names.map((name, k) => {
    const column = byName.get(name), count = parallel.names.length;
    const x = EDGE.side + (count > 1 ? (k * (width - 2 * EDGE.side)) / (count - 1) : 0);
    const values = isText(column) ? column.codes : numbersOf(column);
    const [least, most] = isText(column) ? [-0.5, column.levels.length - 0.5] : extent(values);
    const place = (value) => low + ((value - least) / (most - least)) * (high - low);
    return { column, x, values, least, most, place };
  });
  context.clearRect(0, 0, width, height);
  for (const wanted of [0, 1]) {
    context.globalAlpha = wanted ? Math.max(0.12, Math.min(0.8, 250 / N)) : 1;
    context.lineWidth = 1;
    for (let row = 0; row < N; row++) {
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
  parallel.axes.forEach(({ column, x, least, most, place }, k) => {
    context.strokeStyle = context.fillStyle = style("--soft");
    line(context, [[x, low], [x, high]]);
    context.fillText(titled(column), x, k % 2 ? 24 : 11);
    if (isText(column)) column.levels.forEach((name, level) => context.fillText(name, x, place(level) + 4));
    else {
      context.fillText(written(least), x, low + 16);
      context.fillText(written(most), x, high - (k % 2 ? -14 : 4));
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
  const value = (y) => axis.least + ((low - y) / (low - EDGE.top)) * (axis.most - axis.least);
  const [least, most] = [value(bottom), value(top)];
  if (isText(axis.column)) {
    const names = new Set(axis.column.levels.filter((_, level) => level >= least && level <= most));
    return { text: [...names].join("|"), place: [top, bottom], test: (name) => names.has(name) };
  }
  return { ...ranged(least, most), place: [top, bottom] };
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
