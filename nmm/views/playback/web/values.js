// The table of all values at the clock's time, a column a run.
"use strict";
{
  const values = (nmm.values = {});
  const part = document.getElementById("values");
  let [rows, seen] = [[], false];

  // So many digits, without an exponent where one can read it so.
  values.text = (value, run, key, digits = 6) => {
    if (value === null) return "–";
    if (key === "partition") return run.partitions[value] ?? "–";
    const size = Math.abs(value);
    if (size === 0) return "0";
    const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(Math.min(3, digits - 2)) : value.toPrecision(digits);
    return text.replace("e-", "e−").replace(/^-/, "−");
  };

  values.build = () => {
    const table = part.querySelector("table");
    const head = nmm.element(table, "thead").appendChild(document.createElement("tr"));
    nmm.element(head, "th", { scope: "col" }, "quantity");
    for (const run of nmm.runs) {
      const cell = nmm.element(head, "th", { scope: "col" });
      cell.append(nmm.sign("line", run.color, run.dash), run.name || "value");
    }
    const body = nmm.element(table, "tbody");
    rows = nmm.lanes.map((lane) => {
      const row = nmm.element(body, "tr", { "data-channel": lane.key });
      const title = nmm.element(row, "th", { scope: "row", title: nmm.curves.named(lane) }, lane.text);
      if (lane.unit) nmm.element(title, "span", { class: "unit" }, ` ${lane.unit}`);
      const cells = nmm.runs.map(() => nmm.element(row, "td"));
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
