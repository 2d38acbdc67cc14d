// Cameras: their frustums and lines of sight in the scene, and their pictures in a card over it. Coordinates in
// pictures are normalised, x to the right, y down; only the axes' numbers are in pixels where a camera has them.
"use strict";
{
  const THREE = MeshCat.THREE;
  const get = (id) => document.getElementById(id);
  const card = get("sights");
  // all: a camera of a motion each; figures: a picture each, of all motions' cameras of that name.
  // drag: what a page does with a goal that is dragged in a picture, as the camera's and the point's number and x, y.
  const sights = (nmm.sights = { all: [], figures: [], shown: false, drag: null });
  const [LEFT, RIGHT, TOP, BOTTOM] = [30, 7, 6, 16]; // px around the picture
  // What is shown beyond the border, as a share of it, and how much more where points have been.
  const [AROUND, FARTHEST] = [0.12, 0.6];
  const NEAR = 22; // px, of a goal that is taken hold of
  const REDRAW = 80; // ms between two drawings of a live page's pictures
  let drawn = 0;

  // The edges of a pyramid from the lens to the border, and a mark on its upper side.
  function frustum({ border: [x0, y0, x1, y1], depth, ink }) {
    const corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(([x, y]) => new THREE.Vector3(x, y, 1).multiplyScalar(depth));
    const lens = new THREE.Vector3();
    const [middle, mark] = [0.5 * (x0 + x1), 0.12 * (x1 - x0)];
    const above = [[-1, 0.25], [0, 1.5], [1, 0.25]].map(([a, b]) => new THREE.Vector3(middle + a * mark, y0 - b * mark, 1).multiplyScalar(depth));
    const edges = corners.flatMap((corner, k) => [[lens, corner], [corner, corners[(k + 1) % 4]]]);
    above.forEach((end, k) => edges.push([end, above[(k + 1) % 3]]));
    const paint = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.85, depthWrite: false });
    const group = new THREE.Group();
    for (const [from, to] of edges) {
      const along = to.clone().sub(from);
      const bar = new THREE.Mesh(new THREE.CylinderGeometry(0.0014 * nmm.stage.size, 0.0014 * nmm.stage.size, along.length(), 6), paint);
      bar.position.copy(from).addScaledVector(along, 0.5);
      bar.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
      group.add(bar);
    }
    const pane = new THREE.BufferGeometry().setFromPoints(corners);
    pane.setIndex([0, 1, 2, 0, 2, 3]);
    const glass = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.12, depthWrite: false, side: THREE.DoubleSide });
    group.add(new THREE.Mesh(pane, glass));
    const themed = () => [paint, glass].forEach(({ color }) => color.copy(nmm.color(nmm.theme.paint(ink))));
    themed();
    nmm.theme.listeners.push(themed);
    return group;
  }

  nmm.hooks.sight = (sight) => {
    const one = { times: [], pictures: [], goals: [], ...sight, count: sight.points.length, widened: 0 };
    const edges = `${sight.path}/frustum`;
    nmm.viewer.set_object(nmm.split(edges), frustum(sight));
    // Where a point is seen: from the lens to it.
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * one.count), 3));
    const thin = new THREE.LineBasicMaterial({ color: nmm.color(sight.color), transparent: true, opacity: 0.8 });
    one.rays = new THREE.LineSegments(geometry, thin);
    one.rays.frustumCulled = false;
    nmm.viewer.set_object(nmm.split(`${sight.of}/rays ${sights.all.length}`), one.rays);
    sights.all.push(one);
    const known = sights.figures.find(({ frame }) => frame === sight.frame);
    if (known) known.views.push(one);
    else sights.figures.push(figure(one));
  };

  nmm.hooks.sights = ({ color }) => {
    const also = nmm.camera.also;
    const seen = () => sights.all.flatMap(({ points }) => points.map((path) => new THREE.Vector3().setFromMatrixPosition(nmm.node(path).matrixWorld)));
    if (nmm.stage.live) nmm.camera.also = () => [...also(), ...seen()];
    document.body.classList.add("sighted");
    nmm.legend({ kind: "ball", color, text: "seen", act: (on) => {
      for (const { path, points, rays } of sights.all) {
        for (const node of [...points, `${path}/frustum`].map(nmm.node)) node.visible = on;
        rays.visible = on;
      }
    } });
    sights.show(true);
  };

  function figure(one) {
    const part = nmm.element(card, "figure");
    const [fx, fy, cx, cy] = one.intrinsics;
    const unit = fx === 1 && fy === 1 && cx === 0 && cy === 0 ? "X/Z" : "px";
    nmm.element(part, "figcaption", { title: one.frame }, one.frame);
    const canvas = nmm.element(part, "canvas", { role: "img" });
    const made = { frame: one.frame, unit, views: [one], canvas, told: nmm.element(part, "p"), range: null };
    listen(made);
    return made;
  }

  // The nearest goal within reach of a pointer; one that is held is aimed at where the pointer is.
  function listen(figure) {
    const { canvas } = figure;
    const spotOf = (event) => {
      const box = canvas.getBoundingClientRect();
      const [x0, y0, x1, y1] = figure.range;
      const scale = (canvas.clientWidth - LEFT - RIGHT) / (x1 - x0);
      const spot = [x0 + (event.clientX - box.left - LEFT) / scale, y0 + (event.clientY - box.top - TOP) / scale];
      return { scale, spot: spot.map((x, axis) => Math.min(Math.max(x, [x0, y0][axis]), [x1, y1][axis])) };
    };
    const near = (event) => {
      if (sights.drag === null || figure.range === null) return null;
      const { scale, spot } = spotOf(event);
      const found = figure.views.flatMap((one) =>
        at(one, one.goals, nmm.player.time).map((goal, point) => ({
          camera: sights.all.indexOf(one), point, away: goal === null ? Infinity : scale * Math.hypot(goal[0] - spot[0], goal[1] - spot[1]),
        })));
      return found.filter(({ away }) => away < NEAR).sort((a, b) => a.away - b.away)[0] ?? null;
    };
    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = near(event);
      if (held === null) return;
      event.preventDefault();
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (held === null) canvas.style.cursor = near(event) === null ? "" : "grab";
      else sights.drag(held.camera, held.point, spotOf(event).spot);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (held = null));
  }

  // Where the points of a camera, or their goals, are in its picture at a time; null for what is not there.
  function at(one, values, time) {
    const k = nmm.before(one.times, time + 1e-6);
    if (k < 0) return Array(one.count).fill(null);
    const next = Math.min(k + 1, one.times.length - 1);
    const share = next > k ? Math.min((time - one.times[k]) / (one.times[next] - one.times[k]), 1) : 0;
    return Array.from({ length: one.count }, (_, i) => {
      const [from, to] = [k, next].map((sample) => [0, 1].map((axis) => values[2 * (sample * one.count + i) + axis]));
      if (!from.every(Number.isFinite)) return null;
      return to.every(Number.isFinite) ? from.map((x, axis) => x + Math.max(share, 0) * (to[axis] - x)) : from;
    });
  }
  const inside = ([x, y], [x0, y0, x1, y1]) => x >= x0 && x <= x1 && y >= y0 && y <= y1;

  const around = ([x0, y0, x1, y1], share) => {
    const [wide, high] = [share * (x1 - x0), share * (y1 - y0)];
    return [x0 - wide, y0 - high, x1 + wide, y1 + high];
  };
  // The border with what is around it, wider where points have been, but not much.
  function widen(figure) {
    const { border } = figure.views[0];
    const [most, room] = [around(border, FARTHEST), 0.04 * (border[2] - border[0])];
    let [x0, y0, x1, y1] = figure.range ?? around(border, AROUND);
    for (const one of figure.views) {
      for (const values of [one.pictures, one.goals]) {
        for (let k = one.widened; k + 1 < values.length; k += 2) {
          const [x, y] = [values[k], values[k + 1]];
          if (!inside([x, y], most)) continue;
          [x0, y0, x1, y1] = [Math.min(x0, x - room), Math.min(y0, y - room), Math.max(x1, x + room), Math.max(y1, y + room)];
        }
      }
      one.widened = one.pictures.length;
    }
    figure.range = [x0, y0, x1, y1];
  }

  function pen(canvas, width, height) {
    const dense = window.devicePixelRatio || 1;
    const [w, h] = [width, height].map((pixels) => Math.round(pixels * dense));
    if (canvas.width !== w || canvas.height !== h) {
      Object.assign(canvas, { width: w, height: h });
      canvas.style.height = `${height}px`;
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, width, height);
    return pen;
  }

  // A run that is hidden has no picture; several have their colours.
  const runOf = (one) => nmm.runs.find(({ path }) => path === one.of);
  const colorOf = (one) => (nmm.motions.length > 1 && runOf(one) ? runOf(one).color : `rgb(${one.color.map((c) => Math.round(255 * c)).join(",")})`);

  function draw(figure, time) {
    const width = figure.canvas.clientWidth;
    if (width === 0) return;
    widen(figure);
    const [x0, y0, x1, y1] = figure.range;
    const scale = (width - LEFT - RIGHT) / (x1 - x0);
    const [right, bottom] = [width - RIGHT, TOP + Math.round(scale * (y1 - y0))];
    const p = pen(figure.canvas, width, bottom + BOTTOM);
    const place = ([x, y]) => [LEFT + scale * (x - x0), TOP + scale * (y - y0)];
    const [ink, quiet, line, zero, alarm, plot] = ["ink", "quiet", "grid", "zero", "alarm", "plot"].map((name) => nmm.theme.variable(`--${name}`));
    p.fillStyle = plot;
    p.fillRect(LEFT, TOP, right - LEFT, bottom - TOP);
    const stroke = (style, thick, points, dash = []) => {
      Object.assign(p, { strokeStyle: style, lineWidth: thick, lineJoin: "round" });
      p.setLineDash(dash);
      p.beginPath();
      points.forEach(([x, y], k) => (k ? p.lineTo(x, y) : p.moveTo(x, y)));
      p.stroke();
      p.setLineDash([]);
    };

    // The grid, with numbers as the camera is read.
    const [fx, fy, cx, cy] = figure.views[0].intrinsics;
    Object.assign(p, { font: "10px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", fillStyle: quiet });
    p.textAlign = "right";
    p.textBaseline = "top";
    p.fillText(figure.unit, right, bottom + 4);
    const unit = right - p.measureText(figure.unit).width - 5;
    for (const [low, high, f, c, upright] of [[x0, x1, fx, cx, true], [y0, y1, fy, cy, false]]) {
      const step = nmm.axes.step(f * (high - low), 4);
      for (let k = Math.ceil((f * low + c) / step); k * step <= f * high + c; k++) {
        const [x, y] = place([(k * step - c) / f, (k * step - c) / f]);
        if (upright) stroke(k === 0 ? zero : line, 1, [[x, TOP], [x, bottom]]);
        else stroke(k === 0 ? zero : line, 1, [[LEFT, y], [right, y]]);
        Object.assign(p, { textAlign: upright ? "center" : "right", textBaseline: upright ? "top" : "middle" });
        const text = nmm.axes.number(k * step, step);
        const half = 0.5 * p.measureText(text).width;
        if (upright) x + half < unit && p.fillText(text, x, bottom + 4);
        else if (y > TOP + 4 && y < bottom - 2) p.fillText(text, LEFT - 4, y);
      }
    }

    p.save();
    p.beginPath();
    p.rect(LEFT, TOP, right - LEFT, bottom - TOP);
    p.clip();
    const { border, bounded } = figure.views[0];
    const [[bx0, by0], [bx1, by1]] = [place(border.slice(0, 2)), place(border.slice(2))];
    stroke(ink, bounded ? 1.5 : 1, [[bx0, by0], [bx1, by0], [bx1, by1], [bx0, by1], [bx0, by0]], bounded ? [] : [4, 3]);
    const seen = figure.views.filter((one) => !runOf(one)?.hidden);
    for (const one of seen) for (let i = 0; i < one.count; i++) trace(one, i, time, place, stroke);
    const lost = seen.flatMap((one) => marks(one, time, { p, place, stroke, ink, alarm, plot, box: [LEFT, TOP, right, bottom] }));
    p.restore();
    stroke(line, 1, [[LEFT, TOP], [right, TOP], [right, bottom], [LEFT, bottom], [LEFT, TOP]]);

    const text = lost.length ? lost.join("; ") : seen.some((one) => one.times.length) ? "in the picture" : "";
    if (figure.told.textContent !== text) figure.told.textContent = text;
    figure.told.classList.toggle("lost", lost.length > 0);
    figure.canvas.setAttribute("aria-label", `Picture of ${figure.frame}: ${text}`);
  }

  // A point's path so far.
  function trace(one, i, time, place, stroke) {
    const last = nmm.before(one.times, time + 1e-6);
    let part = [];
    const parts = [part];
    for (let k = 0; k <= last; k++) {
      const first = 2 * (k * one.count + i);
      const spot = [one.pictures[first], one.pictures[first + 1]];
      if (spot.every(Number.isFinite)) part.push(place(spot));
      else if (part.length) parts.push((part = []));
    }
    const now = at(one, one.pictures, time)[i];
    if (now !== null) part.push(place(now));
    for (const points of parts) if (points.length > 1) stroke(colorOf(one), 1.5, points);
  }

  // Goals are crosses, points dots; those beyond the border are rings, or arrows where even these have no room.
  // Returns what is lost, in words.
  function marks(one, time, { p, place, stroke, ink, alarm, plot, box: [left, top, right, bottom] }) {
    const several = one.count > 1;
    const lost = new Map([["outside the picture", []], ["behind the camera", []]]);
    for (const goal of at(one, one.goals, time)) {
      if (goal === null) continue;
      const [x, y] = place(goal);
      for (const [color, thick] of [[plot, 4], [ink, 1.75]]) {
        stroke(color, thick, [[x - 9, y], [x + 9, y]]);
        stroke(color, thick, [[x, y - 9], [x, y + 9]]);
      }
    }
    const now = at(one, one.pictures, time);
    for (const [i, k] of one.lines) {
      if (now[i] === null || now[k] === null) continue;
      const [[ax, ay], [bx, by]] = [place(now[i]), place(now[k])];
      const far = (right - left + bottom - top) / Math.max(Math.hypot(bx - ax, by - ay), 1e-6);
      stroke(colorOf(one), 1.25, [[ax - far * (bx - ax), ay - far * (by - ay)], [bx + far * (bx - ax), by + far * (by - ay)]]);
    }
    now.forEach((spot, i) => {
      const within = spot !== null && inside(spot, one.border);
      if (!within && one.times.length) lost.get(spot === null ? "behind the camera" : "outside the picture").push(i + 1);
      if (spot === null) return;
      const [x, y] = place(spot);
      const [px, py] = [Math.min(Math.max(x, left + 6), right - 6), Math.min(Math.max(y, top + 6), bottom - 6)];
      p.beginPath();
      if (px !== x || py !== y) {
        const turn = Math.atan2(y - py, x - px);
        for (const [k, size] of [[0, 6], [2.5, 5], [-2.5, 5]]) p.lineTo(px + size * Math.cos(turn + k), py + size * Math.sin(turn + k));
        p.closePath();
        p.fillStyle = alarm;
        p.fill();
      } else {
        p.arc(x, y, 4.5, 0, 2 * Math.PI);
        Object.assign(p, { fillStyle: within ? colorOf(one) : plot, strokeStyle: within ? plot : alarm, lineWidth: within ? 1.5 : 2 });
        p.fill();
        p.stroke();
      }
      if (!several) return;
      Object.assign(p, { font: "600 10px system-ui, sans-serif", textAlign: "left", textBaseline: "bottom", strokeStyle: plot, lineWidth: 3, fillStyle: within ? ink : alarm });
      const [tx, ty] = [px > right - 18 ? px - 13 : px + 6, py < top + 16 ? py + 16 : py - 3];
      p.strokeText(String(i + 1), tx, ty);
      p.fillText(String(i + 1), tx, ty);
    });
    const whose = nmm.motions.length > 1 && runOf(one) ? `${runOf(one).name} ` : "";
    const found = [...lost].filter(([, numbers]) => numbers.length);
    return found.map(([where, numbers]) => `${whose}${where}${several ? `: ${numbers.join(", ")}` : ""}`);
  }

  // From the lens to each point that it sees, in the axes of the motion's node.
  function rays(one, time) {
    const world = (path) => {
      const node = nmm.node(path);
      node.updateWorldMatrix(true, false);
      return node.matrixWorld;
    };
    const root = world(one.of).clone().invert();
    const local = (path) => new THREE.Vector3().setFromMatrixPosition(world(path)).applyMatrix4(root);
    const { position } = one.rays.geometry.attributes;
    const now = at(one, one.pictures, time);
    const lens = local(one.path);
    one.points.forEach((path, i) => {
      const seen = now[i] !== null && inside(now[i], one.border);
      lens.toArray(position.array, 6 * i);
      (seen ? local(path) : lens).toArray(position.array, 6 * i + 3);
    });
    position.needsUpdate = true;
  }

  // Live pages: so many numbers a sample, and samples at times; number(i, k) is the k-th of sample i. Samples older
  // than `kept`, s, are forgotten.
  sights.width = () => sights.all.reduce((sum, { count }) => sum + 7 * count, 0);
  sights.take = (times, number, kept = Infinity) => {
    times.forEach((time, i) => {
      let first = 0;
      const next = (count) => Array.from({ length: count }, () => number(i, first++) ?? NaN);
      for (const one of sights.all) {
        if (one.times.length && time < one.times[one.times.length - 1]) Object.assign(one, { times: [], pictures: [], goals: [], widened: 0 });
        one.places = next(3 * one.count);
        one.pictures.push(...next(2 * one.count));
        one.goals.push(...next(2 * one.count));
        one.times.push(time);
      }
    });
    for (const one of sights.all) {
      const old = nmm.before(one.times, one.times[one.times.length - 1] - kept);
      if (old > 0) {
        one.times.splice(0, old);
        for (const values of [one.pictures, one.goals]) values.splice(0, 2 * one.count * old);
        one.widened = Math.max(0, one.widened - 2 * one.count * old);
      }
      if (one.places) one.points.forEach((path, k) => nmm.node(path).position.fromArray(one.places, 3 * k));
    }
    if (times.length) nmm.viewer.set_dirty();
  };

  sights.update = (time = nmm.player.time) => {
    if (!sights.all.length) return;
    for (const one of sights.all) rays(one, time);
    const now = performance.now();
    if (!sights.shown || (nmm.stage.live && now - drawn < REDRAW)) return;
    drawn = now;
    for (const figure of sights.figures) draw(figure, time);
  };
  sights.redraw = () => sights.update();

  sights.show = (on) => {
    sights.shown = on && sights.all.length > 0;
    document.body.classList.toggle("sights", sights.shown);
    get("image").setAttribute("aria-pressed", String(on));
    nmm.texts.fit();
    if (nmm.stage && sights.shown) sights.redraw();
    if (nmm.stage && !nmm.camera.moved) nmm.camera.reset();
    nmm.viewer.set_dirty();
  };
  get("unsee").addEventListener("click", () => nmm.actions.image());
  nmm.runs.listeners.push(sights.redraw);
  nmm.theme.listeners.push(sights.redraw);
  window.addEventListener("resize", sights.redraw);
}
