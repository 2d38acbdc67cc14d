// The table: a page of the rollouts that the filters leave, sorted by one column.
const PAGE = 50;
const table = { sort: "index", down: false, page: 0, rows: [] };

function tableColumns() {
  return differing.filter((column) => column.name !== "message").concat(differing.filter((one) => one.name === "message"));
}

function makeHead() {
  const head = document.createElement("tr"), fields = document.createElement("tr");
  for (const column of tableColumns()) {
    const cell = document.createElement("th");
    cell.className = isText(column) ? "text" : "";
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = titled(column);
    button.title = column.about;
    button.addEventListener("click", () => {
      table.down = table.sort === column.name && !table.down;
      table.sort = column.name;
      drawTable();
    });
    cell.append(button);
    head.append(cell);
    const field = document.createElement("input");
    field.dataset.column = column.name;
    field.setAttribute("aria-label", `Filter of ${column.name}`);
    field.addEventListener("input", () => {
      const filter = parsedFilter(column, field.value);
      field.setAttribute("aria-invalid", String(filter === undefined));
      if (filter !== undefined) setFilter(column.name, filter);
    });
    const below = document.createElement("th");
    below.className = cell.className;
    below.append(field);
    fields.append(below);
  }
  $("rows").tHead.replaceChildren(head, fields);
}

function drawTable() {
  const column = byName.get(table.sort), sign = table.down ? -1 : 1;
  table.rows = [...Array(N).keys()].filter((row) => kept[row]);
  table.rows.sort((a, b) => {
    const [one, other] = [valueOf(column, a), valueOf(column, b)];
    if (one === null || other === null) return (one === null) - (other === null); // not known: last
    return sign * (one < other ? -1 : one > other ? 1 : 0) || a - b;
  });
  const pages = Math.max(1, Math.ceil(table.rows.length / PAGE));
  table.page = Math.min(table.page, pages - 1);
  const columns = tableColumns();
  const body = table.rows.slice(table.page * PAGE, (table.page + 1) * PAGE).map((row) => {
    const line = document.createElement("tr");
    line.className = row === chosen ? "chosen" : "";
    for (const one of columns) {
      const cell = document.createElement("td");
      cell.className = isText(one) ? "text" : "";
      cell.textContent = written(valueOf(one, row), one);
      line.append(cell);
    }
    line.addEventListener("click", () => choose(row));
    return line;
  });
  $("rows").tBodies[0].replaceChildren(...body);
  $("page").textContent = `${table.page + 1} of ${pages}`;
  $("before").disabled = table.page === 0;
  $("after").disabled = table.page >= pages - 1;
  for (const field of document.querySelectorAll("thead input")) {
    const filter = filters.get(field.dataset.column);
    if (document.activeElement !== field) field.value = filter ? filter.text : "";
  }
}

$("before").addEventListener("click", () => { table.page--; drawTable(); });
$("after").addEventListener("click", () => { table.page++; drawTable(); });
$("clear").addEventListener("click", () => { filters.clear(); showOutcomes(); filtered(); });
