// The runs: which are shown, and what each of their channels is at a time. `nmm.seek` and `nmm.state` are a
// contract, for tests and for pages that embed this one.
"use strict";
nmm.runs = [];
nmm.lanes = [];
{
  const listeners = (nmm.runs.listeners = []);

  // The last sample that is not after a time; -1 before the first.
  nmm.before = (times, time) => {
    let [low, high] = [0, times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  };

  // A channel at a time since the page's first one: between two samples on the straight line, a partition as
  // it was; null where there is none.
  nmm.value = (run, key, time) => {
    const column = run.columns[key];
    if (column === undefined) return null;
    const last = run.t.length - 1;
    // Times of the page's clock are sums and roundings of these.
    const near = Math.abs(time - run.t[last]) < 1e-6 ? run.t[last] : Math.abs(time - run.t[0]) < 1e-6 ? run.t[0] : time;
    const i = nmm.before(run.t, near);
    if (i < 0 || (i === last && near > run.t[last])) return null;
    const here = column.values[i];
    let value = here;
    if (key !== "partition" && i < last && near > run.t[i]) {
      value = here + ((near - run.t[i]) / (run.t[i + 1] - run.t[i])) * (column.values[i + 1] - here);
    }
    return Number.isFinite(value) ? value : null;
  };

  nmm.seek = (t) => nmm.player.seek(t - nmm.stage.start);
  nmm.state = () => ({
    t: nmm.stage.start + nmm.player.time,
    runs: nmm.runs.map((run) => ({
      name: run.name,
      hidden: run.hidden,
      values: Object.fromEntries(Object.keys(run.columns).map((key) => [key, nmm.value(run, key, nmm.player.time)])),
    })),
  });

  // In the scene, the plots, the table and the legend together.
  nmm.hide = (run, hidden) => {
    run.hidden = hidden;
    if (run.path) nmm.node(run.path).visible = !hidden;
    if (run.button) run.button.setAttribute("aria-pressed", String(!hidden));
    for (const listener of listeners) listener();
    nmm.viewer.set_dirty();
  };

  // What an address calls a run.
  const short = (name, i) => name.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || `run-${i + 1}`;

  nmm.hooks.curves = ({ panels, lanes, runs }) => {
    runs.forEach((run, i) => {
      const { path } = nmm.motions[i];
      nmm.runs.push({ ...run, id: short(run.name, i), path, hidden: false, button: nmm.motions[i].button });
    });
    nmm.lanes.push(...lanes);
    nmm.plots.build(panels);
    nmm.values.build();
  };
}
