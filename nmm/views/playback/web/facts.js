// The numbers of each run, a column a run, and what happened when: marks on the time axis, and buttons that go there.
"use strict";
{
  const facts = (nmm.facts = { events: [] });
  const part = document.getElementById("facts");
  const [table, list] = ["table", "ol"].map((tag) => part.querySelector(tag));

  nmm.hooks.facts = ({ runs }) => {
    part.hidden = false;
    const head = nmm.element(nmm.element(table, "thead"), "tr");
    nmm.element(head, "th", { scope: "col" }, "number");
    for (const run of nmm.runs) nmm.element(head, "th", { scope: "col" }).append(nmm.sign("line", run.color, run.dash), run.name || "value");
    const body = nmm.element(table, "tbody");
    for (const label of new Set(runs.flatMap((run) => run.facts.map(([label]) => label)))) {
      const row = nmm.element(body, "tr");
      nmm.element(row, "th", { scope: "row" }, label);
      for (const run of runs) {
        nmm.element(row, "td", {}, run.facts.filter(([own]) => own === label).map(([, value]) => value).join("; "));
      }
    }
    runs.forEach(({ events, more }, i) => {
      for (const [time, text] of events) facts.events.push({ time, text, run: nmm.runs[i] });
      if (more) facts.events.push({ time: events[events.length - 1][0], text: `and ${more} more`, run: nmm.runs[i] });
    });
    facts.events.sort((a, b) => a.time - b.time);
    for (const event of facts.events) {
      event.item = nmm.element(list, "li");
      const button = nmm.element(event.item, "button", { type: "button", title: "Go there" });
      button.append(nmm.sign("line", event.run.color, event.run.dash), facts.describe(event));
      button.addEventListener("click", () => nmm.player.seek(event.time));
    }
    list.hidden = facts.events.length === 0;
    nmm.plots.first = nmm.plots.opened();
    nmm.runs.listeners.push(() => {
      for (const row of table.rows) nmm.runs.forEach((run, i) => (row.cells[i + 1].hidden = run.hidden));
      for (const { run, item } of facts.events) item.hidden = run.hidden;
    });
  };

  facts.describe = ({ time, text, run }) =>
    `${nmm.fixed(nmm.stage.start + time, 3)} s ${nmm.runs.length > 1 ? `${run.name}: ` : ""}${text}`;
  facts.shown = () => facts.events.filter(({ run }) => !run.hidden);

  // What happened about a time.
  facts.near = (time, within) => facts.shown().filter((event) => Math.abs(event.time - time) <= within);

  // Triangles below the times, in the runs' colours.
  facts.mark = (pen, x, [from, to], top) => {
    for (const { time, run } of facts.shown()) {
      if (time < from || time > to) continue;
      pen.fillStyle = run.color;
      pen.beginPath();
      pen.moveTo(x(time) - 4, top);
      pen.lineTo(x(time) + 4, top);
      pen.lineTo(x(time), top + 6);
      pen.fill();
    }
  };
}
