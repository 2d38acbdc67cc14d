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

  // Where a time is among a run's samples: after the one numbered i, by a share of the way to the next; null
  // before the first and after the last. Times of the page's clock are sums and roundings of theirs.
  nmm.at = ({ t }, time) => {
    const last = t.length - 1;
    if (Math.abs(time - t[last]) < 1e-6) return { i: last, share: 0 };
    const i = nmm.before(t, time + 1e-9);
    if (i < 0 || i === last) return null;
    return { i, share: Math.max(time - t[i], 0) / (t[i + 1] - t[i]) };
  };

  // A channel there: between two samples on the straight line, a partition as it was; null where there is none.
  nmm.value = (run, key, at) => {
    if (at === null || run.columns[key] === undefined) return null;
    const { values } = run.columns[key];
    const here = values[at.i];
    const value = key === "partition" || at.share === 0 ? here : here + at.share * (values[at.i + 1] - here);
    return Number.isFinite(value) ? value : null;
  };

  // Before there is a scene there is nothing to seek, and no run.
  nmm.seek = (t) => nmm.stage && nmm.player.seek(t - nmm.stage.start);
  nmm.state = () => ({
    t: (nmm.stage ? nmm.stage.start : 0) + (nmm.player ? nmm.player.time : 0),
    runs: nmm.runs.map((run) => {
      const at = nmm.at(run, nmm.player.time);
      const values = Object.keys(run.columns).map((key) => [key, nmm.value(run, key, at)]);
      return { name: run.name, hidden: run.hidden, values: Object.fromEntries(values) };
    }),
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
