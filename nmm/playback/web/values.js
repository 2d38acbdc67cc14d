// The table of all values at the clock's time, a column a run.
"use strict";
{
  const values = (nmm.values = {});
  const part = document.getElementById("values");
  let [rows, seen] = [[], false];

  // Six digits, without an exponent where one can read it so.
  values.text = (value, run, key) => {
    if (value === null) return "–";
    if (key === "partition") return run.partitions[value] ?? "–";
    const size = Math.abs(value);
    if (size === 0) return "0";
    const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(3) : value.toPrecision(6);
    return text.replace("e-", "e−").replace(/^-/, "−");
  };

  const named = (parent, tag, text, attributes = {}) => {
    const made = parent.appendChild(document.createElement(tag));
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(text);
    return made;
  };

  values.build = () => {
    const table = part.querySelector("table");
    const head = named(table, "thead", "").appendChild(document.createElement("tr"));
    named(head, "th", "quantity", { scope: "col" });
    for (const run of nmm.runs) {
      const cell = named(head, "th", "", { scope: "col" });
      cell.append(nmm.sign("line", run.color, run.dash), run.name || "value");
    }
    const body = named(table, "tbody", "");
    rows = nmm.lanes.map((lane) => {
      const row = named(body, "tr", "", { "data-channel": lane.key });
      const title = named(row, "th", lane.text, { scope: "row", title: nmm.curves.named(lane) });
      if (lane.unit) named(title, "span", ` ${lane.unit}`, { class: "unit" });
      const cells = nmm.runs.map(() => named(row, "td", ""));
      return { lane, cells };
    });
    // Far down or folded it costs nothing.
    new IntersectionObserver(([{ isIntersecting }]) => {
      seen = isIntersecting;
      values.update();
    }).observe(table);
    nmm.runs.listeners.push(() => {
      for (const row of table.rows) nmm.runs.forEach((run, i) => (row.cells[i + 1].hidden = run.hidden));
    });
  };

  values.update = () => {
    if (!seen) return;
    nmm.runs.forEach((run, i) => {
      if (run.hidden) return;
      const at = nmm.at(run, nmm.player.time);
      for (const { lane, cells } of rows) {
        const text = values.text(nmm.value(run, lane.key, at), run, lane.key);
        if (cells[i].textContent !== text) cells[i].textContent = text;
      }
    });
  };
  nmm.runs.listeners.push(values.update);
}
