// The rollouts, and which of them the filters leave. A column has `values` (numbers, null where not known) or
// `levels` and `codes`; what is the same in all rows has `same`.
const DATA = JSON.parse(document.getElementById("data").textContent);
const N = DATA.shown;
const byName = new Map(DATA.columns.map((column) => [column.name, column]));
const $ = (id) => document.getElementById(id);

const isText = (column) => column.kind === "text";
const valueOf = (column, row) => {
  if ("same" in column) return column.same;
  return isText(column) ? (column.codes[row] < 0 ? null : column.levels[column.codes[row]]) : column.values[row];
};
const numbersOf = (column) => ("same" in column ? Array(N).fill(column.same) : column.values);
const numeric = DATA.columns.filter((column) => !isText(column));
const differing = DATA.columns.filter((column) => !("same" in column));

function written(value, column) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "string") return value;
  if (column && column.kind === "count") return String(value);
  const size = Math.abs(value);
  const short = Number(value.toPrecision(4));
  return size !== 0 && (size < 1e-3 || size >= 1e6) ? short.toExponential().replace("e+", "e") : String(short);
}
const measured = (value, column) => [written(value, column), value === null ? "" : column.unit].filter(Boolean).join(" ");
const titled = (column) => (column.unit ? `${column.name} [${column.unit}]` : column.name);

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value === null) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [0, 1];
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

// Filters by column: a function of the value, and the text that made it.
const filters = new Map();
const kept = new Uint8Array(N).fill(1);
const listeners = [];
let chosen = -1;

function filtered() {
  kept.fill(1);
  for (const [name, filter] of filters) {
    const column = byName.get(name);
    for (let row = 0; row < N; row++) if (kept[row] && !filter.test(valueOf(column, row))) kept[row] = 0;
  }
  const count = kept.reduce((sum, one) => sum + one, 0);
  $("count").textContent = `${count} of ${N} rollouts shown`;
  for (const listener of listeners) listener();
}

function setFilter(name, filter) {
  if (filter) filters.set(name, filter);
  else filters.delete(name);
  filtered();
}

// ">0.5", "<=1", "0.1..0.3" for numbers; a part of the text for text; "–" for what is not known.
function parsedFilter(column, text) {
  const trimmed = text.trim();
  if (!trimmed) return null;
  if (trimmed === "–" || trimmed === "-") return { text, test: (value) => value === null };
  if (isText(column)) {
    const part = trimmed.toLowerCase();
    return { text, test: (value) => value !== null && value.toLowerCase().includes(part) };
  }
  const between = trimmed.match(/^(\S+?)\s*\.\.\s*(\S+)$/);
  if (between) return ranged(Number(between[1]), Number(between[2]), text);
  const bound = trimmed.match(/^(<=|>=|<|>|=)?\s*(\S+)$/);
  const limit = bound ? Number(bound[2]) : NaN;
  if (Number.isNaN(limit)) return undefined;
  const tests = {
    "<": (value) => value < limit, "<=": (value) => value <= limit, ">": (value) => value > limit,
    ">=": (value) => value >= limit, "=": (value) => Math.abs(value - limit) <= 1e-3 * Math.abs(limit),
  };
  return { text, test: (value) => value !== null && tests[bound[1] || "="](value) };
}

function ranged(low, high, text) {
  if (Number.isNaN(low) || Number.isNaN(high)) return undefined;
  return {
    text: text || `${written(low)}..${written(high)}`, low, high,
    test: (value) => value !== null && value >= low && value <= high,
  };
}
