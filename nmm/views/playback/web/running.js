// A run that is shown while it is computed: pictures and samples come from the program, at the run's own time.
// Once all of it has been shown the page comes again, as the one that plays it.
"use strict";
{
  const THREE = MeshCat.THREE;
  const REDRAW = 100; // ms between two drawings of the curves
  const running = (nmm.running = { drawn: 0, dropped: 0, picture: 0 });
  const status = document.getElementById("status");
  const lines = [];
  let [keys, shown, redrawn] = [[], 0, 0];

  nmm.hooks.running = ({ duration, frame, desired, color }) => {
    document.body.classList.add("running");
    // The clock is the program's: nobody seeks.
    nmm.player.seek = () => {};
    nmm.plots.zoom = () => {};
    for (const key of [" ", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "+", "-", "0", "l", "g"]) delete nmm.keys[key];
    const run = nmm.runs[0];
    keys = Object.keys(run.columns);
    run.t = [];
    for (const key of keys) run.columns[key].values = [];
    nmm.stage.duration = duration;
    nmm.player.range = { from: 0, to: duration };
    if (frame !== null) lines.push(line("driven", color, `path of ${frame}`));
    if (desired) lines.push(line("desired", [0.16, 0.18, 0.22], "desired path"));
    nmm.scenery.paths = lines.map(({ object }) => object);
    nmm.plots.show(true);
    nmm.camera.reset();
    requestAnimationFrame(answer);
  };

  // A line that grows, with room for twice as many points whenever it is full.
  function line(name, color, text) {
    const object = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
    const themed = () => object.material.color.copy(nmm.color(nmm.theme.paint(color)));
    themed();
    nmm.theme.listeners.push(themed);
    object.frustumCulled = false;
    const path = `/nmm/running ${name}`;
    nmm.viewer.set_object(nmm.split(path), object);
    nmm.legend({ kind: "thin", color, text, path, aside: true });
    return { object, room: 0, points: [] };
  }
  function extend(line) {
    const count = line.points.length / 3;
    const { geometry } = line.object;
    if (count > line.room) {
      line.room = Math.max(1024, 2 * count);
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * line.room), 3));
      line.filled = 0;
    }
    const { position } = geometry.attributes;
    position.array.set(line.points.slice(3 * line.filled), 3 * line.filled);
    line.filled = count;
    position.needsUpdate = true;
    geometry.setDrawRange(0, count);
  }

  function remember(t, values) {
    const run = nmm.runs[0];
    const paths = keys.length + 3 * lines.length;
    const width = paths + nmm.sights.width();
    for (let i = 0; i < t.length; i++) {
      run.t.push(t[i]);
      keys.forEach((key, k) => run.columns[key].values.push(values[i * width + k]));
      lines.forEach(({ points }, k) => {
        const first = i * width + keys.length + 3 * k;
        points.push(...values.subarray(first, first + 3));
      });
    }
    run.samples = run.t.length;
    if (t.length) lines.forEach(extend);
    nmm.sights.take(t, (i, k) => values[i * width + paths + k]);
  }

  // A panel that had nothing to say at first opens once it has.
  const news = new Set(["scale", "partition"]);
  function speak() {
    const run = nmm.runs[0];
    const last = (key) => run.columns[key].values[run.t.length - 1];
    const says = {
      scale: () => keys.some((key) => key.startsWith("scale_") && last(key) < 1),
      partition: () => run.partitions.length > 1,
    };
    for (const id of [...news]) {
      const panel = nmm.plots.panels.find((one) => one.id === id);
      if (panel && !says[id]()) continue;
      news.delete(id);
      if (panel) panel.part.open = true;
    }
  }

  // What has been computed to its end need not be waited for.
  const all = nmm.element(document.getElementById("tools"), "button", { id: "all", title: "All of the run now, to be played and looked through" }, "Whole run");
  all.addEventListener("click", () => nmm.send({ type: "all" }));
  all.hidden = true;

  nmm.hooks.run = ({ picture, t, values, partitions, told, dropped, whole }) => {
    all.hidden = !whole;
    const run = nmm.runs[0];
    run.partitions = partitions;
    remember(t, values);
    Object.assign(running, { picture, dropped });
    if (run.t.length) nmm.player.time = run.t[run.t.length - 1];
    nmm.sights.update();
    const parts = [`${nmm.player.time.toFixed(2)} of ${Number(nmm.stage.duration.toPrecision(6))} s`];
    if (told) parts.push(told);
    if (dropped) parts.push(`${dropped} ${dropped === 1 ? "picture" : "pictures"} dropped`);
    status.textContent = parts.join(", ");
    const now = performance.now();
    if (now - redrawn < REDRAW) return;
    redrawn = now;
    if (run.t.length) speak();
    nmm.plots.redraw();
    nmm.values.update();
  };

  // Once a picture is drawn the program is told: it sends no more than this page draws.
  function answer() {
    requestAnimationFrame(answer);
    if (running.picture === shown) return;
    shown = running.picture;
    running.drawn += 1;
    nmm.send({ type: "drawn", picture: shown, drawn: running.drawn });
  }

  // As it is now: the time, the plots that are open, where one looks from.
  nmm.hooks.whole = () => {
    if (!document.body.classList.contains("running")) return;
    // To follow is how a run is shown; with a camera that somebody has moved it is what he sees.
    if (!nmm.camera.moved) nmm.camera.following = false;
    history.replaceState(null, "", nmm.address.text());
    location.reload();
  };
}
