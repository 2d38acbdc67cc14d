// Plots of one's own: several quantities in one, over time or over another quantity. They are in the address, as
// plot=u_v,u_omega, or plot=y~x for y over x; plot=u_v~~log and plot=y~x~log on a logarithmic axis.
"use strict";
{
  const { plots } = nmm;
  const own = (nmm.own = {});
  // Of the quantities in a plot, in turn: told apart by all eyes, and by the light and the dark page (Okabe, Ito 2008).
  const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
  const HIGH = { time: 150, over: 250 }; // px
  const quantity = (key) => nmm.lanes.find((lane) => lane.key === key);
  let made = 0;

  own.add = (keys = [], over = "", logarithmic = false) => {
    const id = `own-${(made += 1)}`;
    const lane = { signals: [], over: "", log: logarithmic, height: HIGH.time };
    const panel = plots.add({ id, title: "", open: true, own: true, lanes: [lane] });
    panel.summary.replaceChildren();
    panel.heading = nmm.element(panel.summary, "span");
    lane.now = nmm.element(panel.summary, "span", { class: "now", "aria-hidden": "true" });
    panel.timeAt = (event) => (lane.over ? nearest(lane, event) : null);
    const row = nmm.element(panel.part, "div", { class: "choices" });
    panel.canvas.before(row);
    const more = choice(row, `${id}-y`, "Another quantity", "add a quantity");
    nmm.element(row, "label", { for: `${id}-x` }, "over");
    const across = choice(row, `${id}-x`, "Over", "time");
    const log = nmm.element(nmm.element(row, "label", {}, "log "), "input", { type: "checkbox" });
    const away = nmm.element(row, "button", { type: "button", title: "Take this plot away", "aria-label": "Take this plot away" }, "×");
    more.addEventListener("change", () => set(panel, [...names(lane), more.value], lane.over));
    across.addEventListener("change", () => set(panel, names(lane), across.value));
    log.checked = logarithmic;
    log.addEventListener("change", () => {
      Object.assign(lane, { log: log.checked, zoom: null });
      draw(panel);
      changed();
    });
    away.addEventListener("click", () => {
      plots.panels.splice(plots.panels.indexOf(panel), 1);
      panel.part.remove();
      plots.draw();
      changed();
    });
    Object.assign(panel, { row, more, across, chips: [], dots: [] });
    set(panel, keys, over);
    return panel;
  };

  function choice(row, id, label, first) {
    const select = nmm.element(row, "select", { id, "aria-label": label });
    nmm.element(select, "option", { value: "" }, first);
    for (const { group, lanes } of plots.panels.filter((panel) => !panel.own && panel.id !== "partition")) {
      const part = nmm.element(select, "optgroup", { label: group });
      for (const lane of lanes) nmm.element(part, "option", { value: lane.key }, nmm.curves.named(lane));
    }
    return select;
  }

  const names = ({ signals }) => signals.map(({ key }) => key);
  const changed = () => plots.listeners.forEach((listener) => listener());

  function set(panel, keys, over) {
    const [lane] = panel.lanes;
    lane.signals = [...new Set(keys)].filter(quantity).map((key, i) => ({ key, color: COLORS[i % COLORS.length] }));
    const across = quantity(over);
    Object.assign(lane, { over: across ? over : "", zoom: null, height: across ? HIGH.over : HIGH.time });
    lane.square = across?.unit === "m" && lane.signals.every(({ key }) => quantity(key).unit === "m");
    panel.heading.textContent = lane.signals.length
      ? `${names(lane).map((key) => nmm.curves.named(quantity(key))).join(", ")}${across ? ` over ${nmm.curves.named(across)}` : ""}`
      : "A plot of your own";
    panel.canvas.setAttribute("aria-label", `${panel.heading.textContent}${across ? "" : " over time"}. The values are in the table.`);
    panel.canvas.classList.toggle("over", Boolean(across));
    [panel.more.value, panel.across.value] = ["", lane.over];
    for (const chip of panel.chips) chip.remove();
    panel.chips = lane.signals.map(({ key, color }) => {
      const chip = document.createElement("button");
      Object.assign(chip, { type: "button", title: "Take it out" });
      chip.append(nmm.sign("line", color), `${quantity(key).text} ×`);
      chip.addEventListener("click", () => set(panel, names(lane).filter((name) => name !== key), lane.over));
      panel.row.insertBefore(chip, panel.more);
      return chip;
    });
    draw(panel);
    changed();
  }

  function draw(panel) {
    const [lane] = panel.lanes;
    const lines = curvesOf(lane);
    plots.head(lane, lines);
    for (const dot of panel.dots) dot.remove();
    panel.dots = lane.over ? lines.map(({ color }) => Object.assign(nmm.element(panel.part, "i", { class: "dot" }), { style: `background: ${color}` })) : [];
    panel.stale = true;
    plots.draw();
  }
  // Also of runs that are hidden now.
  const curvesOf = ({ signals }) => signals.flatMap(({ key, color }) => nmm.runs.map((run) => ({ run, key, color })));

  // A point on each curve over another quantity, at the pointer's or the clock's time.
  plots.told = (time) => {
    for (const { lanes: [lane], dots, canvas } of plots.panels.filter(({ dots }) => dots?.length)) {
      lane.told.forEach(({ run, key }, i) => {
        const at = nmm.at(run, time);
        const [x, y] = [lane.over, key].map((name) => nmm.value(run, name, at));
        const [left, top] = lane.scale && x !== null && y !== null ? [lane.plot.x(x), lane.plot.y(y)] : [NaN, NaN];
        const within = left >= nmm.curves.LEFT - 1 && left <= canvas.clientWidth && top >= lane.plot.top - 1 && top <= lane.plot.top + lane.plot.height + 1;
        dots[i].hidden = run.hidden || !within;
        if (within) dots[i].style.transform = `translate(${left}px, ${canvas.offsetTop + top}px)`;
      });
    }
  };

  // The time of the sample nearest to the pointer.
  function nearest(lane, event) {
    let [least, time] = [Infinity, nmm.player.time];
    const { from, to } = nmm.player.range;
    for (const { run, column } of lane.scale ? nmm.curves.traces(lane) : []) {
      const [first, last] = nmm.curves.seen(run, [from, to]);
      for (let i = first; i <= last; i++) {
        const far = Math.hypot(lane.plot.x(run.columns[lane.over].values[i]) - event.offsetX, lane.plot.y(column.values[i]) - event.offsetY);
        if (far < least) [least, time] = [far, run.t[i]];
      }
    }
    return Math.min(Math.max(time, from), to);
  }

  own.text = () =>
    plots.panels
      .filter((panel) => panel.own && panel.lanes[0].signals.length)
      .map(({ lanes: [{ signals, over, log }] }) => [signals.map(({ key }) => encodeURIComponent(key)).join(","), encodeURIComponent(over), log ? "log" : ""])
      .map((parts) => `plot=${parts.join("~").replace(/~+$/, "")}`);

  // Those that an address names take the place of those that there are.
  own.read = (texts) => {
    for (const panel of plots.panels.filter((panel) => panel.own)) panel.part.remove();
    plots.panels = plots.panels.filter((panel) => !panel.own);
    for (const text of texts) {
      const [keys, over = "", log = ""] = text.split("~");
      if (keys.split(",").some(quantity)) own.add(keys.split(","), over, log === "log");
    }
  };

  document.getElementById("another").addEventListener("click", () => own.add().more.focus());
}
