// The plots beside the scene: panels that fold, one cursor over all of them, press to seek, zoom in time. A pointer
// over a plot has a line of its own through all of them; headers tell each run's value there, else at the cursor.
// Over the numbers of an axis, a wheel zooms it and a drag moves it.
// Curves are drawn once for a size, a zoom, a theme and what is shown; a seek moves the cursor and nothing else.
"use strict";
{
  const get = (id) => document.getElementById(id);
  const plots = (nmm.plots = { panels: [], shown: false, listeners: [] });
  const [stack, cursor, hair, ruler, tip] = ["stack", "cursor", "hair", "ruler", "tip"].map(get);
  const changed = () => plots.listeners.forEach((listener) => listener());
  const TABLES = ["facts", "values"];
  let [width, pointed] = [0, null]; // px; s, where the pointer is

  const range = () => [nmm.player.range.from, nmm.player.range.to];
  const span = () => nmm.player.range.to - nmm.player.range.from || 1;
  const right = () => width - nmm.curves.RIGHT;
  const x = (time) => nmm.curves.LEFT + ((time - nmm.player.range.from) / span()) * (right() - nmm.curves.LEFT);
  const timeAt = (event) => {
    const share = (event.clientX - stack.getBoundingClientRect().left - nmm.curves.LEFT) / (right() - nmm.curves.LEFT);
    return nmm.player.range.from + Math.min(Math.max(share, 0), 1) * span();
  };

  function marks() {
    const step = nmm.axes.step(span(), Math.max(2, width / 70));
    const start = nmm.stage.start;
    const [from, to] = range();
    const found = [];
    for (let k = Math.ceil((start + from) / step - 1e-9); k * step <= start + to + 1e-9 * step; k++) found.push(k * step - start);
    return { at: found, step };
  }

  const colors = () => {
    const of = (name) => nmm.theme.variable(`--${name}`);
    const font = "11px system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";
    return {
      font, ink: of("ink"), quiet: of("quiet"), line: of("grid"), zero: of("zero"), alarm: of("alarm"), plot: of("plot"),
    };
  };

  // A canvas of so many pixels of the screen, empty, and its pen in CSS pixels.
  function fresh(canvas, height) {
    const dense = window.devicePixelRatio || 1;
    Object.assign(canvas, { width: Math.round(width * dense), height: Math.round(height * dense) });
    canvas.style.height = `${height}px`;
    const pen = canvas.getContext("2d");
    pen.scale(dense, dense);
    return pen;
  }

  function drawPanel(panel, about) {
    const heights = panel.lanes.map((lane) => nmm.curves.height(lane, panel.lanes.length));
    const pen = fresh(panel.canvas, heights.reduce((sum, height) => sum + height + nmm.curves.GAP, 0));
    let top = 0;
    panel.lanes.forEach((lane, i) => {
      Object.assign(lane, { top, bottom: top + heights[i] + nmm.curves.GAP });
      if (lane.row) lane.row.style.top = `${panel.canvas.offsetTop + top}px`;
      nmm.curves.draw(pen, lane, top, heights[i], { ...about, alone: panel.lanes.length === 1 });
      top = lane.bottom;
    });
    panel.stale = false;
  }

  function drawRuler({ at, step }, { quiet, font }) {
    const pen = fresh(ruler, nmm.facts.events.length ? 25 : 18);
    Object.assign(pen, { font, fillStyle: quiet, textBaseline: "middle", textAlign: "left" });
    pen.fillText("t [s]", 2, 9);
    // Both ends first, to a hundredth of a step, and of what is between them what has room.
    const taken = [[0, pen.measureText("t [s]").width + 4]];
    range().concat(at).forEach((time, i) => {
      const text = nmm.axes.time(nmm.stage.start + time, i < 2 ? 0.01 * step : step);
      const long = pen.measureText(text).width;
      const left = Math.min(Math.max(x(time) - 0.5 * long, taken[0][1]), width - long);
      if (taken.some(([from, to]) => left < to + 6 && left + long + 6 > from) && i > 1) return;
      pen.fillText(text, left, 9);
      taken.push([left, left + long]);
    });
    nmm.facts.mark(pen, x, range(), 18);
  }

  // Everything that is open and out of date.
  plots.draw = () => {
    width = stack.clientWidth;
    if (!plots.shown || width === 0) return;
    const grid = marks();
    const about = { range: range(), x, right: right(), marks: grid.at, colors: colors() };
    for (const panel of plots.panels) if (panel.part.open && panel.stale) drawPanel(panel, about);
    drawRuler(grid, about.colors);
    plots.update();
    whole();
  };
  plots.redraw = () => {
    for (const panel of plots.panels) panel.stale = true;
    plots.draw();
  };

  plots.update = () => {
    if (!plots.shown) return;
    const at = Math.min(Math.max(x(Math.min(nmm.player.time, nmm.stage.duration)), nmm.curves.LEFT), Math.max(right(), 0));
    cursor.style.transform = `translateX(${at.toFixed(2)}px)`;
    const beyond = nmm.player.beyond();
    const told = nmm.axes.time(nmm.stage.start + nmm.player.time, 0.01);
    cursor.className = ["before", "", "after"][beyond + 1];
    cursor.firstChild.textContent = ["", `◀ ${told} s`, `${told} s ▶`][beyond ? 1 + (beyond > 0) : 0];
    tell();
  };

  // In each header, the value of each run where the pointer is, or else at the cursor.
  function tell() {
    const time = pointed ?? nmm.player.time;
    const places = nmm.runs.map((run) => nmm.at(run, time));
    for (const { part, lanes } of plots.panels) {
      if (!part.open) continue;
      for (const { values, told } of lanes) {
        told.forEach(({ run, key }, i) => {
          const shown = !run.hidden && run.columns[key] !== undefined;
          if (values[i].hidden === shown) values[i].hidden = !shown;
          const text = shown ? nmm.values.text(nmm.value(run, key, places[nmm.runs.indexOf(run)]), run, key, 4) : "";
          if (values[i].lastChild.data !== text) values[i].lastChild.data = text;
        });
      }
    }
    plots.told?.(time);
  }
  function point(time) {
    pointed = time;
    hair.hidden = time === null;
    if (time !== null) {
      hair.style.transform = `translateX(${x(time).toFixed(2)}px)`;
      hair.firstChild.textContent = `${(nmm.stage.start + time).toFixed(3)} s`;
    }
    tell();
  }

  plots.show = (on) => {
    plots.shown = on && plots.panels.length > 0;
    document.body.classList.toggle("plots", plots.shown);
    get("curves").setAttribute("aria-pressed", String(plots.shown));
    nmm.resize();
    plots.redraw();
    changed();
  };
  plots.open = (ids) => {
    for (const panel of plots.panels) if (!panel.own) panel.part.open = ids.includes(panel.id);
    for (const id of TABLES) get(id).open = ids.includes(id);
  };
  plots.ids = () => [...plots.panels.filter(({ own }) => !own).map((panel) => panel.id), ...TABLES.filter((id) => !get(id).hidden)];
  plots.opened = () => plots.ids().filter((id) => (plots.panels.find((panel) => panel.id === id)?.part ?? get(id)).open);

  function thinned() {
    const [drawn, all] = ["t", "samples"].map((key) => nmm.runs.map((run) => (key === "t" ? run.t.length : run.samples)));
    if (drawn.every((count, i) => count === all[i])) return;
    const told = (counts) => [...new Set([Math.min(...counts), Math.max(...counts)])].map((count) => count.toLocaleString("en")).join(" to ");
    get("thinned").textContent = `Drawn from ${told(drawn)} of ${told(all)} samples, extremes and events among them.`;
  }

  plots.build = (panels) => {
    for (const { id, title, open } of panels) {
      const lanes = nmm.lanes.filter((lane) => lane.panel === id);
      const [only, another] = lanes;
      const symbol = another || id === "partition" ? "" : `, ${nmm.curves.named(only)}`;
      const panel = plots.add({ id, lanes, open, title: `${title}${symbol}`, group: title });
      const about = `${title} over time: ${lanes.map((lane) => lane.text).join(", ")}. The values are in the table.`;
      panel.canvas.setAttribute("aria-label", about);
      for (const lane of lanes) {
        if (another) {
          lane.row = nmm.element(panel.part, "div", { class: "row", "aria-hidden": "true" });
          nmm.element(lane.row, "span", { class: "name" }, lane.text);
          if (lane.unit) nmm.element(lane.row, "span", {}, `[${lane.unit}]`);
          lane.aside = nmm.element(lane.row, "span", { class: "aside" });
        }
        lane.now = nmm.element(lane.row || panel.summary, "span", { class: "now", "aria-hidden": "true" });
        plots.head(lane, nmm.runs.map((run) => ({ run, key: lane.key, color: run.color })));
      }
    }
    plots.first = plots.opened();
    for (const id of TABLES) get(id).addEventListener("toggle", changed);
    thinned();
  };

  // A panel at the end of the others; its lanes have no header yet.
  plots.add = ({ id, title, open, ...rest }) => {
    const part = nmm.element(get("panels"), "details", { class: "panel", "data-panel": id });
    part.open = open;
    const summary = nmm.element(part, "summary", {}, title);
    const canvas = nmm.element(part, "canvas", { role: "img" });
    const panel = { id, part, summary, canvas, stale: true, ...rest };
    plots.panels.push(panel);
    part.addEventListener("toggle", () => {
      plots.draw();
      changed();
    });
    listen(panel);
    return panel;
  };

  // A place for the value of each line, with its sign where there are several.
  plots.head = (lane, lines) => {
    lane.now.replaceChildren();
    lane.told = lines;
    lane.values = lines.map(({ run, color }) => {
      const value = nmm.element(lane.now, "span", { hidden: "" }, " ");
      if (lines.length > 1) value.prepend(nmm.sign("line", color, run.dash));
      return value;
    });
  };

  // Press and drag seek; a pointer that only passes over asks for the values there. Over the numbers of an axis, a
  // drag moves it, a wheel zooms it about the pointer, and a double click has all of it seen again.
  function listen(panel) {
    const { canvas } = panel;
    const at = (event) => panel.timeAt?.(event) ?? timeAt(event);
    const seek = (event) => nmm.player.seek(at(event));
    let dragged = null; // {lane, y} of an axis
    const axisAt = (event) => {
      if (event.offsetX >= nmm.curves.LEFT) return null;
      return panel.lanes.find((lane) => lane.scale && event.offsetY >= lane.top && event.offsetY < lane.bottom) ?? null;
    };
    const set = (lane, low, high) => {
      if (!nmm.axes.told(low, high, lane.scale.log)) return;
      lane.zoom = { low, high };
      panel.stale = true;
      plots.draw();
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      point(null);
      const lane = axisAt(event);
      dragged = lane && { lane, y: event.clientY };
      if (!lane) seek(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (dragged) {
        const { low, high } = dragged.lane.scale;
        const by = ((event.clientY - dragged.y) / dragged.lane.plot.height) * (high - low);
        dragged.y = event.clientY;
        return set(dragged.lane, low + by, high + by);
      }
      if (canvas.hasPointerCapture(event.pointerId)) return seek(event);
      const lane = axisAt(event);
      canvas.style.cursor = lane ? "ns-resize" : "";
      canvas.title = lane ? "Wheel: zoom this axis. Drag: move it. Double click: all of it" : "";
      return point(lane ? null : at(event));
    });
    canvas.addEventListener("pointerup", () => (dragged = null));
    canvas.addEventListener("pointercancel", () => (dragged = null));
    canvas.addEventListener("pointerleave", () => point(null));
    canvas.addEventListener("wheel", (event) => {
      const lane = axisAt(event);
      if (!lane || event.deltaY === 0) return;
      event.preventDefault();
      event.stopPropagation();
      const { low, high } = lane.scale;
      const here = high - Math.min(Math.max((event.offsetY - lane.plot.top) / lane.plot.height, 0), 1) * (high - low);
      const factor = 1.25 ** Math.min(Math.max(event.deltaY / 100, -1), 1); // a trackpad's events are many and small
      set(lane, here + factor * (low - here), here + factor * (high - here));
    }, { passive: false });
    canvas.addEventListener("dblclick", (event) => {
      const lane = axisAt(event);
      if (!lane) return;
      lane.zoom = null;
      panel.stale = true;
      plots.draw();
    });
  }

  // Beside the plots, or above them where they are below the scene: it covers none.
  function place(event) {
    const [box, dock] = [tip, get("plots")].map((part) => part.getBoundingClientRect());
    const beside = dock.left > box.width + 12;
    const left = beside ? dock.left - 8 - box.width : Math.min(event.clientX, window.innerWidth - 8 - box.width);
    const top = beside ? Math.min(event.clientY - 8, window.innerHeight - 8 - box.height) : dock.top - 8 - box.height;
    Object.assign(tip.style, { left: `${Math.max(left, 4)}px`, top: `${Math.max(top, 4)}px` });
  }

  // Zoom: a drag along the ruler, a wheel with Ctrl or Shift, buttons and keys.
  let drag = null;
  ruler.addEventListener("pointerdown", (event) => {
    ruler.setPointerCapture(event.pointerId);
    drag = { from: timeAt(event), x: event.clientX };
  });
  ruler.addEventListener("pointerleave", () => (tip.hidden = true));
  ruler.addEventListener("pointermove", (event) => {
    const near = drag ? [] : nmm.facts.near(timeAt(event), (6 * span()) / (right() - nmm.curves.LEFT));
    tip.hidden = near.length === 0;
    if (near.length) {
      tip.replaceChildren(...near.map((one) => Object.assign(document.createElement("div"), { textContent: nmm.facts.describe(one) })));
      place(event);
    }
    if (!drag) return;
    const [from, to] = [drag.from, timeAt(event)].sort((a, b) => a - b);
    Object.assign(get("chosen").style, { left: `${x(from)}px`, width: `${x(to) - x(from)}px` });
    get("chosen").hidden = Math.abs(event.clientX - drag.x) < 5;
  });
  ruler.addEventListener("pointerup", (event) => {
    const [from, to] = [drag.from, timeAt(event)].sort((a, b) => a - b);
    if (get("chosen").hidden) nmm.player.seek(to);
    else plots.zoom(from, to);
    get("chosen").hidden = true;
    drag = null;
  });
  ruler.addEventListener("dblclick", () => plots.whole());
  stack.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    plots.closer((event.deltaY || event.deltaX) < 0 ? 0.8 : 1.25, timeAt(event));
  }, { passive: false });

  plots.zoom = (from, to) => {
    nmm.player.setRange(from, to);
    plots.redraw();
    changed();
  };
  // Whether there is more to see than is seen.
  function whole() {
    const { from, to } = nmm.player.range;
    get("wider").disabled = from === 0 && to === nmm.stage.duration;
    get("whole").disabled = get("wider").disabled && !plots.panels.some(({ lanes }) => lanes.some(({ zoom }) => zoom));
  }
  plots.whole = () => {
    for (const { lanes } of plots.panels) for (const lane of lanes) lane.zoom = null;
    plots.zoom(0, nmm.stage.duration);
  };
  plots.closer = (factor, at = nmm.player.time) => {
    const length = Math.min(span() * factor, nmm.stage.duration);
    const share = (Math.min(at, nmm.stage.duration) - nmm.player.range.from) / span();
    const from = Math.min(Math.max(at - share * length, 0), nmm.stage.duration - length);
    plots.zoom(from, from + length);
  };
  get("whole").addEventListener("click", plots.whole);
  get("closer").addEventListener("click", () => plots.closer(0.5));
  get("wider").addEventListener("click", () => plots.closer(2));

  nmm.runs.listeners.push(plots.redraw);
  nmm.theme.listeners.push(plots.redraw);
  new ResizeObserver(() => stack.clientWidth !== width && plots.redraw()).observe(stack);
  // Another screen may have other pixels.
  window.addEventListener("resize", plots.redraw);
}
