// Colours: outcomes, resolvers and listed values by name, numbers on viridis; each tells apart in light and dark.
// A resolver's is the one of its runs on all pages and figures.
const OUTCOMES = {
  completed: "#1f8fd0", missed: "#e69f00", singular: "#b05fc9", unstable: "#f0703c", diverged: "#d62f4b",
  failed: "#a5673f", refused: "#8c95a3", error: "#6b6bd6", interrupted: "#8c95a3",
};
const ROWS = [...Array(N).keys()];
const NAMED = ["#1f8fd0", "#e69f00", "#12a37b", "#d62f4b", "#b05fc9", "#7a8b2a", "#f0703c", "#5c9aa8"];
const VIRIDIS = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99],
  [170, 220, 50], [253, 231, 37],
];

function viridis(share) {
  const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
  const k = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const mix = VIRIDIS[k].map((from, i) => Math.round(from + (place - k) * (VIRIDIS[k + 1][i] - from)));
  return `rgb(${mix.join(",")})`;
}

// A function of the row, what the legend shows, and the order to draw in: what is rare comes last, on top.
function colouring(column) {
  if (isText(column) || (column.listed && new Set(numbersOf(column)).size <= NAMED.length)) {
    const names = isText(column)
      ? ("same" in column ? [column.same] : column.levels)
      : [...new Set(numbersOf(column))].sort((a, b) => a - b);
    const fixed = column.name === "resolver.kind" ? DATA.resolvers : OUTCOMES;
    const colours = new Map(names.map((name, i) => [name, fixed[name] || NAMED[i % NAMED.length]]));
    const count = new Map();
    for (let row = 0; row < N; row++) count.set(valueOf(column, row), (count.get(valueOf(column, row)) || 0) + 1);
    const order = [...ROWS].sort((a, b) => count.get(valueOf(column, b)) - count.get(valueOf(column, a)));
    return { of: (row) => colours.get(valueOf(column, row)) || NAMED[6], names: colours, order };
  }
  const known = numbersOf(column).filter((value) => value !== null).sort((a, b) => a - b);
  const at = (share) => known[Math.round(share * (known.length - 1))];
  let low = known.length ? at(0.02) : 0, high = known.length ? at(0.98) : 1; // one outlier is not all colour
  if (low === high) [low, high] = extent(known);
  return {
    low, high, order: ROWS, clipped: known.length > 0 && (known[0] < low || known[known.length - 1] > high),
    of: (row) => {
      const value = valueOf(column, row);
      return value === null ? OUTCOMES.refused : viridis((value - low) / (high - low));
    },
  };
}

function showLegend(column, colours, together) {
  const legend = $("legend");
  legend.replaceChildren();
  const add = (text, background) => {
    const item = document.createElement("span");
    if (background) {
      const swatch = document.createElement("span");
      swatch.className = "swatch";
      swatch.style.background = background;
      item.append(swatch);
    }
    item.append(text);
    legend.append(item);
  };
  add(`${titled(column)}:`);
  if (colours.names) for (const [name, colour] of colours.names) add(String(name), colour);
  else {
    add((colours.clipped ? "≤ " : "") + written(colours.low));
    const ramp = document.createElement("span");
    ramp.className = "ramp";
    ramp.style.background = `linear-gradient(90deg, ${[...Array(9).keys()].map((k) => viridis(k / 8)).join(",")})`;
    legend.append(ramp);
    add((colours.clipped ? "≥ " : "") + written(colours.high));
  }
  if (together) {
    const varied = DATA.columns.filter((one) => one.varied && one.listed && !("same" in one));
    const each = [...Array(DATA.combinations).keys()].map((row) => varied.map((one) => written(valueOf(one, row), one)).join(" and "));
    add(`Dots beside one another, from the left: ${varied.map((one) => one.name).join(" and ")} ${each.join(", ")}`);
  }
}

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A canvas as sharp as the screen, and its size in CSS pixels.
function fitted(canvas) {
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.font = "12px system-ui, sans-serif";
  return { context, width, height };
}

function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= raw);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}
