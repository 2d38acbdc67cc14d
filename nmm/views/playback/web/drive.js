// A robot that follows what one drags: targets, what one chooses, and the program's answers on one clock.
"use strict";
{
  const THREE = MeshCat.THREE;
  const TRAIL = [0, 0.447, 0.698];
  const [WINDOW, KEPT, SEEN, REDRAW, PATIENCE] = [20, 30, 5, 100, 5000]; // s, s, s, ms, ms
  const drive = (nmm.drive = { targets: [], active: 0, time: 0, paused: false, plan: false, tree: false, grown: true, followed: 0 });
  const panel = document.createElement("div");
  const parts = {};
  let [drawn, axes] = [0, []];
  panel.id = "drive";
  document.getElementById("plots").prepend(panel);
  document.body.classList.add("drive");

  // The clock is the program's: nobody seeks.
  nmm.player.seek = () => {};
  nmm.plots.zoom = () => {};

  const send = (message) => nmm.send && nmm.send(message);
  const order = (what) => (!nmm.silent || what === "restart") && send({ type: "order", what });

  // A program that sends no picture does not hear either, for now; only to begin again may wait for it. What counts
  // are a timer's turns without a picture: a page that is busy itself is late for both. What is aimed at within two
  // seconds a slow program still hears; later it would only be a surprise.
  const [TICK, SILENCE, DEAF] = [100, 7, 20]; // ms, turns, turns
  let [heard, turns] = [0, 0];
  function hear() {
    heard = performance.now();
    if (turns >= SILENCE) grey(false);
    turns = 0;
    nmm.silent = false;
  }
  function tick() {
    turns += 1;
    if (nmm.ended || turns < SILENCE) return;
    if (turns === SILENCE) grey(true);
    nmm.silent = turns >= DEAF;
    const told = `The robot does not answer, since ${Math.round((performance.now() - heard) / 1000)} s`;
    if (parts.told.textContent !== told) parts.told.textContent = told;
    parts.told.classList.add("bad");
  }
  function grey(dead) {
    for (const part of panel.querySelectorAll("#pause, #plan, fieldset, #choices")) part.inert = dead;
  }

  // What is aimed at goes out at once, but for what follows within a few ms: that goes with the next picture.
  const SOON = 4;
  const aimed = new Set();
  let [told, count] = [0, Math.floor(Math.random() * 2 ** 52)]; // no two pages count alike
  function tell() {
    for (const { number: task, value, awaited: number } of aimed) send({ type: "aim", task, value, number });
    aimed.clear();
    told = performance.now();
  }
  function aim(target, value) {
    if (nmm.ended || nmm.silent) return;
    target.value = value;
    target.since = performance.now();
    target.awaited = ++count;
    aimed.add(target);
    if (target.since - told >= SOON) tell();
    show(target);
  }
  function flush() {
    requestAnimationFrame(flush);
    if (aimed.size) tell();
    nmm.border.update(drive.targets);
  }
  requestAnimationFrame(flush);

  function row(target, k, { name, unit }) {
    const line = nmm.element(target.part, "label", { class: "aim" });
    nmm.element(line, "span", {}, `${name} [${unit}]`);
    const [least, most] = unit === "rad" ? [-Math.PI, Math.PI] : [target.value[k] - target.reach, target.value[k] + target.reach];
    const words = `${target.name}: ${name} in ${unit}`;
    const slider = nmm.element(line, "input", { type: "range", min: least, max: most, step: "any", "aria-label": words });
    const box = nmm.element(line, "input", { type: "number", step: "0.01", "aria-label": `${words}, as a number` });
    const chosen = (text) => {
      const x = Number(text);
      if (text === "" || !Number.isFinite(x)) return;
      drive.active = target.number;
      aim(target, target.value.map((old, i) => (i === k ? x : old)));
    };
    slider.addEventListener("input", () => chosen(slider.value));
    box.addEventListener("change", () => {
      // Farther away the program does not listen.
      box.setCustomValidity(Math.abs(Number(box.value)) > drive.far ? `from −${drive.far} to ${drive.far}` : "");
      if (box.reportValidity()) chosen(box.value);
    });
    return { slider, box };
  }

  function show(target) {
    target.inputs.forEach(({ slider, box }, k) => {
      // What moves by itself, or is dragged far, takes its slider's ends along.
      const beyond = target.value[k] < Number(slider.min) || target.value[k] > Number(slider.max);
      if (beyond) Object.assign(slider, { min: target.value[k] - target.reach, max: target.value[k] + target.reach });
      if (document.activeElement !== slider) slider.value = target.value[k];
      if (document.activeElement !== box) box.value = target.value[k].toFixed(3);
    });
    place(target);
  }
  function place(target) {
    if (!target.gizmo) return;
    const at = Object.fromEntries(["x", "y", "z"].map((axis, i) => [axis, target.axes[axis] === undefined ? target.at[i] : target.value[target.axes[axis]]]));
    const rotation = target.rotation.length ? nmm.gizmos.quaternion(target.rotation.map((k) => target.value[k])) : undefined;
    nmm.gizmos.put(target.gizmo, at, rotation);
  }

  nmm.hooks.targets = ({ targets, values, at, goals, reach, far }) => {
    drive.far = far;
    const head = nmm.element(panel, "div", { class: "head" });
    nmm.element(head, "h2", {}, "Drive");
    parts.pause = nmm.element(head, "button", { id: "pause", title: "Pause or go on (space)" }, "Pause");
    parts.pause.addEventListener("click", () => order(drive.paused ? "go" : "pause"));
    parts.plan = nmm.element(head, "button", { id: "plan", "aria-pressed": "false", title: "Plan the way to the target, round what is in the way, and follow it (N)" }, "Plan");
    parts.plan.addEventListener("click", () => order(drive.plans ? "react" : "plan"));
    const again = nmm.element(head, "button", { id: "again", title: "Robot and targets back where they began (Home)" }, "Begin again");
    again.addEventListener("click", () => order("restart"));
    parts.told = nmm.element(panel, "p", { id: "told", role: "status" });
    targets.forEach((one, number) => {
      const target = { ...one, number, value: values[number], at: at[number], reach, inputs: [] };
      target.part = nmm.element(panel, "fieldset");
      nmm.element(target.part, "legend", {}, one.heading);
      target.inputs = one.rows.map((_, k) => row(target, k, one.rows[k]));
      const ways = Object.keys(one.axes);
      if (ways.length || one.rotation.length) {
        target.gizmo = nmm.gizmos.add(number, { axes: ways, turns: one.rotation.length > 0 }, 0.2 * reach, (point, rotation) => {
          drive.active = number;
          const value = [...target.value];
          for (const axis of ways) value[one.axes[axis]] = point[axis];
          nmm.gizmos.vector(rotation).forEach((x, i) => one.rotation.length && (value[one.rotation[i]] = x));
          aim(target, value);
        });
        if (one.frame !== null) target.trail = trail(number, one.frame);
      }
      drive.targets.push(target);
      show(target);
    });
    drive.active = Math.max(0, drive.targets.findIndex((target) => Object.keys(target.axes).length));
    nmm.element(panel, "div", { id: "choices" });
    const ways = [
      [drive.targets.some((target) => Object.keys(target.axes).length), "Drag the red ball (Shift: up and down) or an arrow; or arrow keys, Page Up and Page Down."],
      [drive.targets.some((target) => target.rotation.length), "Drag a ring to turn."],
      [true, "T brings the targets to where the robot is."],
      [goals.some((some) => some.length), "Drag a cross in the camera's picture."],
      [true, "N plans the way round what is between."],
    ];
    nmm.element(panel, "p", { class: "quiet" }, ways.filter(([has]) => has).map(([, words]) => words).join(" "));
    const run = nmm.runs[0];
    axes = Object.keys(run.columns);
    empty(run);
    const upright = ([x, y, z]) => new THREE.Vector3(x, z, -y);
    // A goal in a camera's picture is dragged there.
    nmm.sights.drag = (camera, point, spot) => {
      const goal = goals[camera].find((one) => one.point === point);
      const target = drive.targets[goal.target];
      const [fx, fy, cx, cy] = goal.intrinsics;
      const value = [...target.value];
      [value[goal.rows[0]], value[goal.rows[1]]] = [fx * spot[0] + cx, fy * spot[1] + cy];
      drive.active = goal.target;
      aim(target, value);
    };
    const seen = nmm.camera.also;
    nmm.camera.also = () => [...seen(), ...drive.targets.filter((target) => target.gizmo).map((target) => upright(target.gizmo.place.toArray()))];
    hear();
    setInterval(tick, TICK);
    if (!nmm.camera.following) nmm.actions.follow();
    nmm.plots.show(true);
    nmm.camera.reset();
  };

  // Where a task's frame has been in the last seconds.
  function trail(number, frame) {
    const geometry = new THREE.BufferGeometry();
    const most = 30 * KEPT;
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * most), 3));
    geometry.setDrawRange(0, 0);
    const line = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: nmm.color(TRAIL) }));
    line.frustumCulled = false;
    const path = `/nmm/trail ${number}`;
    nmm.viewer.set_object(nmm.split(path), line);
    nmm.legend({ kind: "line", color: TRAIL, text: `the last ${KEPT} s of ${frame}`, path, aside: true });
    return { geometry, points: [], most };
  }
  function extend({ trail: line, at }) {
    line.points.push(at);
    if (line.points.length > line.most) line.points.shift();
    const { position } = line.geometry.attributes;
    line.points.forEach((point, i) => position.setXYZ(i, ...point));
    position.needsUpdate = true;
    line.geometry.setDrawRange(0, line.points.length);
  }

  function empty(run) {
    run.t = [];
    run.samples = 0;
    for (const key of axes) run.columns[key].values = [];
    for (const target of drive.targets) if (target.trail) target.trail.points = [];
  }

  function remember(samples) {
    const run = nmm.runs[0];
    for (const [t, ...values] of samples) {
      if (run.t.length && t < run.t[run.t.length - 1]) empty(run);
      run.t.push(t);
      axes.forEach((key, i) => run.columns[key].values.push(values[i] ?? NaN));
    }
    nmm.sights.take(samples.map(([t]) => t), (i, k) => samples[i][1 + axes.length + k], SEEN);
    const old = nmm.before(run.t, run.t[run.t.length - 1] - KEPT);
    if (old > 0) {
      run.t.splice(0, old);
      for (const key of axes) run.columns[key].values.splice(0, old);
    }
    run.samples = run.t.length;
  }

  // What the search has grown: from pair to pair of points. The legend's button shows and hides it.
  const GROWN = [0.47, 0.62, 0.72];
  function grow(points) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    const material = new THREE.LineBasicMaterial({ color: nmm.color(GROWN), transparent: true, opacity: 0.7 });
    const tree = new THREE.LineSegments(geometry, material);
    tree.visible = drive.grown;
    nmm.viewer.set_object(nmm.split("/nmm/plan/tree"), tree);
    nmm.scenery.paths = (nmm.scenery.paths || []).concat(tree);
    if (parts.grown) return;
    const act = (on) => {
      drive.grown = on;
      if (drive.tree) nmm.node("/nmm/plan/tree").visible = on;
    };
    parts.grown = nmm.legend({ kind: "line", color: GROWN, text: "search tree", act, aside: true });
  }

  // The plan that it follows: its ways, dashed, the tree it comes of, and copies of the robot along it.
  nmm.hooks.plan = ({ lines, tree, ghosts }) => {
    const before = nmm.node("/nmm/plan");
    const stays = (one) => {
      for (let part = one; part; part = part.parent) if (part === before) return false;
      return true;
    };
    for (const kind of ["paths", "desired"]) nmm.scenery[kind] = (nmm.scenery[kind] || []).filter(stays);
    nmm.ghosts = (nmm.ghosts || []).filter(stays);
    nmm.viewer.delete_path(nmm.split("/nmm/plan"));
    lines.forEach((line, i) => nmm.hooks.path({ ...line, path: `/nmm/plan/${i}`, text: "plan" }));
    drive.tree = tree !== null && tree.length > 0;
    if (drive.tree) grow(tree);
    if (ghosts !== null) nmm.hooks.ghosts(ghosts);
    drive.plan = lines.length > 0;
    if (drive.plan) drive.followed += 1;
  };

  nmm.hooks.drive = ({ t, targets, heard: known, at, samples, paused, plans, jogs, told, wrong }) => {
    hear();
    remember(samples);
    Object.assign(drive, { plans, jogs });
    parts.plan.setAttribute("aria-pressed", String(plans));
    drive.time = t;
    drive.paused = paused;
    nmm.stage.duration = Math.max(t, 1e-3);
    Object.assign(nmm.player, { time: t, range: { from: Math.max(0, t - WINDOW), to: Math.max(t, 1) } });
    drive.targets.forEach((target, i) => {
      target.at = at[i];
      // Pictures on their way know nothing of what has just been aimed at, even where the target has been there before.
      if (known[i] === target.awaited || performance.now() - target.since > PATIENCE) target.awaited = undefined;
      const busy = target.awaited !== undefined || (nmm.gizmos.held && nmm.gizmos.held.gizmo === target.gizmo);
      if (!busy) {
        target.value = targets[i];
        show(target);
      }
      if (target.trail && samples.length) extend(target);
    });
    nmm.sights.update();
    parts.pause.textContent = paused ? "Go on" : "Pause";
    if (parts.told.textContent !== told) parts.told.textContent = told;
    parts.told.classList.toggle("bad", wrong);
    const now = performance.now();
    if (now - drawn > REDRAW) {
      drawn = now;
      nmm.plots.redraw();
      nmm.values.update();
    }
  };

  // Keys move the target that was moved last.
  function shift(way, by) {
    const target = drive.targets[drive.active];
    const k = target && target.axes[way];
    if (k === undefined) return;
    aim(target, target.value.map((old, i) => (i === k ? old + by : old)));
  }
  const step = (event, way, sign) => shift(way, sign * drive.targets[0].reach * (event.shiftKey ? 0.002 : 0.02));
  Object.assign(nmm.keys, {
    ArrowLeft: (event) => step(event, "x", -1),
    ArrowRight: (event) => step(event, "x", 1),
    ArrowUp: (event) => step(event, "y", 1),
    ArrowDown: (event) => step(event, "y", -1),
    PageUp: (event) => step(event, "z", 1),
    PageDown: (event) => step(event, "z", -1),
    " ": () => order(drive.paused ? "go" : "pause"),
    Home: () => order("restart"),
    t: () => order("here"),
    n: () => order(drive.plans ? "react" : "plan"),
  });
  for (const key of ["End", "+", "-", "0", "l"]) delete nmm.keys[key];
}
