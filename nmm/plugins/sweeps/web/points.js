// Points: any column against any other, with cells where both are listed, and the Pareto front of least and least.
const points = { canvas: $("points"), places: null };

function axisOf(column, log, from, to) {
  if (isText(column)) {
    const levels = "same" in column ? [column.same] : column.levels;
    const place = (k) => from + (to - from) * ((k + 0.5) / levels.length);
    return {
      // spread a little, by the row's number, so that points of one name do not hide one another
      of: (row) => place(column.codes ? column.codes[row] : 0) + (((row * 0.618034) % 1) - 0.5) * 0.6 * (to - from) / levels.length,
      marks: levels.map((name, k) => [place(k), name]),
    };
  }
  const values = numbersOf(column);
  const usable = log ? values.filter((value) => value !== null && value > 0).map(Math.log10) : values;
  let [low, high] = extent(usable);
  const cells = cellsOf(column, log);
  const pad = cells ? (high - low) / (cells - 1) / 2 : 0.03 * (high - low);
  low -= pad;
  high += pad;
  const place = (value) => from + ((value - low) / (high - low)) * (to - from);
  const few = Math.max(2, Math.floor(Math.abs(to - from) / 75));
  return {
    cell: cells ? Math.abs(to - from) / cells : 0,
    of: (row) => {
      const value = values[row];
      if (value === null || (log && value <= 0)) return NaN;
      return place(log ? Math.log10(value) : value);
    },
    marks: (log ? decades(low, high, few) : ticks(low, high, few))
      .map((mark) => Number(mark.toPrecision(12)))
      .map((mark) => [place(log ? Math.log10(mark) : mark), written(mark)]),
  };
}

// Round numbers between two powers of ten: powers of ten, also 2 and 5 times those, or equal steps within one of them.
function decades(low, high, few) {
  if (high - low < 0.8) return ticks(10 ** low, 10 ** high, few);
  const every = Math.max(1, Math.ceil((high - low) / few));
  const found = [];
  for (let k = Math.floor(low / every) * every; k <= high; k += every) {
    for (const factor of high - low < 0.4 * few ? [1, 2, 5] : [1]) found.push(k + Math.log10(factor));
  }
  return found.filter((mark) => mark >= low && mark <= high).map((mark) => 10 ** mark);
}

// How many values a listed column has, where they are at equal distances.
function cellsOf(column, log) {
  if (!column.listed || log || "same" in column) return 0;
  const values = [...new Set(numbersOf(column))].sort((a, b) => a - b);
  const step = (values[values.length - 1] - values[0]) / (values.length - 1);
  return values.every((value, k) => Math.abs(value - values[0] - k * step) < 1e-6 * step) ? values.length : 0;
}

// Whether the box asks for it, which it cannot where a logarithmic axis would leave out what is negative.
function logOf(id, column) {
  const box = $(id);
  box.disabled = isText(column) || numbersOf(column).some((value) => value !== null && value < 0);
  return box.checked && !box.disabled;
}

function drawPoints() {
  const { context, width, height } = fitted(points.canvas);
  const [xs, ys, hue] = ["x", "y", "colour"].map((id) => byName.get($(id).value));
  const margin = { left: 66, right: 14, top: 12, bottom: 44 };
  const across = axisOf(xs, logOf("log-x", xs), margin.left, width - margin.right);
  const up = axisOf(ys, logOf("log-y", ys), height - margin.bottom, margin.top);
  const colours = colouring(hue);
  context.clearRect(0, 0, width, height);
  context.strokeStyle = style("--line");
  context.fillStyle = style("--soft");
  context.lineWidth = 1;
  context.textAlign = "center";
  for (const [place, text] of across.marks) {
    line(context, [[place, margin.top], [place, height - margin.bottom]]);
    context.fillText(text, place, height - margin.bottom + 16);
  }
  context.fillText(titled(xs), (margin.left + width - margin.right) / 2, height - 8);
  context.textAlign = "right";
  for (const [place, text] of up.marks) {
    line(context, [[margin.left, place], [width - margin.right, place]]);
    context.fillText(text, margin.left - 7, place + 4);
  }
  context.save();
  context.translate(13, (margin.top + height - margin.bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.fillText(titled(ys), 0, 0);
  context.restore();

  const cells = across.cell && up.cell ? [Math.max(across.cell - 1, 1), Math.max(up.cell - 1, 1)] : null;
  const radius = N > 4000 ? 1.6 : N > 800 ? 2.4 : 3.6;
  // Rollouts of one point, with different listed values, are at one place across: they stand side by side there.
  const together = !cells && DATA.combinations > 1 && DATA.combinations <= 5 && sampled(xs);
  showLegend(hue, colours, together);
  const aside = (row) => (together ? ((row % DATA.combinations) - (DATA.combinations - 1) / 2) * 1.7 * radius : 0);
  points.places = Array.from({ length: N }, (_, row) => [across.of(row) + aside(row), up.of(row)]);
  points.reach = cells ? Math.max(...cells) : 14;
  for (const wanted of [0, 1]) {
    for (const row of colours.order) {
      const [x, y] = points.places[row];
      if (kept[row] !== wanted || Number.isNaN(x) || Number.isNaN(y)) continue;
      context.fillStyle = wanted ? colours.of(row) : style("--faint");
      if (cells) context.fillRect(x - cells[0] / 2, y - cells[1] / 2, cells[0], cells[1]);
      else disc(context, x, y, radius);
    }
  }
  if ($("front").checked) drawFront(context, frontOf(numbersOf(xs), numbersOf(ys)), colours, radius);
  if (chosen >= 0 && points.places[chosen].every((place) => !Number.isNaN(place))) {
    context.strokeStyle = style("--ink");
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...points.places[chosen], 8, 0, 2 * Math.PI);
    context.stroke();
  }
}

const sampled = (column) => column.varied && !column.listed;

// The rollouts than which no other has less of both.
function frontOf(xs, ys) {
  const rows = [...Array(N).keys()].filter((row) => kept[row] && xs[row] !== null && ys[row] !== null);
  rows.sort((a, b) => xs[a] - xs[b] || ys[a] - ys[b]);
  let least = Infinity;
  return rows.filter((row) => ys[row] < least && ((least = ys[row]), true));
}

// A line along the front, and a ring around each dot of it, which keeps its colour.
function drawFront(context, rows, colours, radius) {
  const seen = rows.filter((row) => !points.places[row].some(Number.isNaN));
  const places = seen.map((row) => points.places[row]);
  context.strokeStyle = style("--ink");
  context.lineWidth = 1.5;
  line(context, places.flatMap((place, k) => (k ? [[place[0], places[k - 1][1]], place] : [place])));
  seen.forEach((row, k) => {
    context.fillStyle = colours.of(row);
    disc(context, ...places[k], radius);
    context.stroke();
  });
}

function line(context, places) {
  context.beginPath();
  places.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function disc(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function nearest(event) {
  let found = -1, least = points.reach ** 2;
  for (let row = 0; row < N; row++) {
    if (!kept[row]) continue;
    const [x, y] = points.places[row];
    const distance = (x - event.offsetX) ** 2 + (y - event.offsetY) ** 2;
    if (distance < least) [found, least] = [row, distance];
  }
  return found;
}

points.canvas.addEventListener("mousemove", (event) => {
  const row = nearest(event);
  const columns = row < 0 ? [] : [...new Set(["x", "y", "colour"].map((id) => byName.get($(id).value)))];
  const index = row < 0 ? "" : `rollout ${valueOf(byName.get("index"), row)}: `;
  $("told").textContent = index + columns.map((one) => `${one.name} = ${measured(valueOf(one, row), one)}`).join(", ");
});
points.canvas.addEventListener("click", (event) => choose(nearest(event)));
