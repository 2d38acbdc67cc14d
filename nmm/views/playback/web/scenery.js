// What stands around the robots: light, ground, axes, the tubes of the paths, texts.
"use strict";
{
  const THREE = MeshCat.THREE;
  const SIDES = 8;
  const PAPER = new THREE.Color(1, 1, 1);
  const scenery = (nmm.scenery = { trails: [], desired: [], thin: false });

  function add(path, object) {
    nmm.viewer.set_object(nmm.split(path), object);
    return object;
  }

  // The largest of 1, 2, 5 times a power of ten that is not above x.
  function nice(x) {
    const power = 10 ** Math.floor(Math.log10(x));
    return power * (x / power >= 5 ? 5 : x / power >= 2 ? 2 : 1);
  }

  scenery.build = (view, size, reach) => {
    const viewer = nmm.viewer;
    for (const path of ["/Grid", "/Axes", "/Background", "/Lights"]) {
      viewer.set_property(nmm.split(path), "visible", false);
    }
    viewer.renderer.outputEncoding = THREE.sRGBEncoding;
    const box = new THREE.Box3().setFromArray(view);
    const center = box.getCenter(new THREE.Vector3()).setZ(0);
    const radius = 0.5 * Math.hypot(box.max.x - box.min.x, box.max.y - box.min.y);
    const room = Math.max(radius, 0.3 * size);
    const step = nice(0.22 * room);
    light(center, room, box.max.z);
    ground(center, 3.2 * room, step);
    axes(nice(Math.min(0.45 * size, 0.8 * reach)));
    scenery.period = 5 * step;
    scenery.pitch = step;
  };

  // Bring ground and sun below a robot that may go anywhere, by whole periods of the grid.
  scenery.center = (x, y) => {
    const period = scenery.period;
    for (const path of ["/nmm/ground", "/nmm/light/sun"]) {
      nmm.node(path).position.set(period * Math.round(x / period), period * Math.round(y / period), 0);
    }
  };

  function light(center, radius, top) {
    const sky = new THREE.HemisphereLight(0xffffff, 0xb9c2cc, 0.5);
    sky.position.set(0, 0, 1);
    add("/nmm/light/sky", sky);
    const sun = new THREE.DirectionalLight(0xfff6ea, 0.48);
    const distance = 4 * radius + top;
    sun.position.set(0.35, -0.45, 0.95).normalize().multiplyScalar(distance).add(center);
    sun.target.position.copy(center);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    sun.shadow.radius = 3;
    sun.shadow.bias = -0.0006;
    sun.shadow.normalBias = 0.004 * radius;
    Object.assign(sun.shadow.camera, {
      left: -1.25 * radius, right: 1.25 * radius, bottom: -1.25 * radius, top: 1.25 * radius,
      near: 0.05 * distance, far: 2.2 * distance,
    });
    const fill = new THREE.DirectionalLight(0xe3edff, 0.12);
    fill.position.set(-0.6, 0.5, 0.5).multiplyScalar(distance).add(center);
    fill.target.position.copy(center);
    const group = new THREE.Group();
    group.add(sun, sun.target, fill, fill.target);
    add("/nmm/light/sun", group);
  }

  // A grid that fades into the page's background, and what takes the robots' shadows.
  function ground(center, radius, step) {
    const group = new THREE.Group();
    group.position.set(center.x, center.y, 0);
    const fade = (x, y, most) => most * Math.max(0, 1 - (Math.hypot(x, y) / radius) ** 2) ** 1.5;
    const flat = { transparent: true, depthWrite: false };
    const shadow = new THREE.Mesh(
      new THREE.CircleGeometry(radius, 48),
      new THREE.ShadowMaterial({ ...flat, opacity: 0.28 }),
    );
    shadow.receiveShadow = true;

    const positions = [];
    const colors = [];
    const line = (ax, ay, bx, by, most) => {
      const pieces = 16;
      for (let k = 0; k < pieces; k++) {
        for (const s of [k / pieces, (k + 1) / pieces]) {
          const x = ax + s * (bx - ax);
          const y = ay + s * (by - ay);
          positions.push(x, y, 0);
          colors.push(0.16, 0.22, 0.3, fade(x, y, most));
        }
      }
    };
    for (const axis of [0, 1]) {
      const middle = axis === 0 ? center.x : center.y;
      for (let n = Math.ceil((middle - radius) / step); n * step <= middle + radius; n++) {
        const at = n * step - middle;
        const half = Math.sqrt(Math.max(0, radius * radius - at * at));
        const most = n % 5 === 0 ? 0.42 : 0.17;
        if (axis === 0) line(at, -half, at, half, most);
        else line(-half, at, half, at, most);
      }
    }
    const lines = new THREE.BufferGeometry();
    lines.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    lines.setAttribute("color", new THREE.Float32BufferAttribute(colors, 4));
    const grid = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ ...flat, vertexColors: true }));
    const themed = () => {
      grid.material.color.setRGB(...(nmm.theme.dark ? [4.4, 3.5, 2.8] : [1, 1, 1]));
      shadow.material.opacity = nmm.theme.dark ? 0.5 : 0.28;
    };
    themed();
    nmm.theme.listeners.push(themed);
    // Flat things that lie on one another are drawn in this order; nothing hides behind them.
    [grid, shadow].forEach((object, order) => (object.renderOrder = order - 2));
    group.add(grid, shadow);
    scenery.measures = [grid];
    add("/nmm/ground", group);
  }

  function axes(length) {
    const group = new THREE.Group();
    const radius = 0.016 * length;
    const ways = [["x", [0.84, 0.2, 0.18]], ["y", [0.16, 0.6, 0.24]], ["z", [0.16, 0.38, 0.86]]];
    ways.forEach(([name, rgb], axis) => {
      const painted = material(rgb, 1);
      const shaft = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 0.86 * length, 16), painted);
      const head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * radius, 0.14 * length, 20), painted);
      const tag = nmm.texts.put(label(name, rgb, false, 0.9), "axis");
      shaft.position.y = 0.43 * length;
      head.position.y = 0.93 * length;
      tag.position.y = 1.1 * length;
      const arrow = new THREE.Group();
      arrow.add(shaft, head, tag);
      // Faint where something is before it.
      const faint = new THREE.MeshBasicMaterial({ color: nmm.color(rgb), transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
      for (const part of [shaft, head]) {
        const before = new THREE.Mesh(part.geometry, faint);
        before.position.copy(part.position);
        before.renderOrder = 900;
        arrow.add(before);
      }
      if (axis === 0) arrow.rotation.z = -Math.PI / 2;
      if (axis === 2) arrow.rotation.x = Math.PI / 2;
      group.add(arrow);
    });
    scenery.measures.push(add("/nmm/axes", group));
  }

  // Pixels that a text is high, whatever the view's size.
  const HIGH = 22;
  const labels = [];
  scenery.fit = () => {
    const unit = nmm.camera.unit() / Math.max(document.getElementById("view").clientHeight, 1);
    for (const { scale, userData } of labels) scale.set(userData.wide * unit, userData.high * unit, 1);
  };

  // wide, high: px.
  scenery.sized = (sprite, wide, high) => {
    if (!labels.includes(sprite)) labels.push(sprite);
    sprite.userData = { wide, high };
    scenery.fit();
  };

  // A text that faces the viewer and keeps its size on the screen: white on a plate of its colour, or in its colour
  // with a rim of the page's, so that it can be read over a robot. rgb: or a function that tells it.
  function label(text, rgb, filled, part = 1) {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const font = "600 40px system-ui, sans-serif";
    pen.font = font;
    const [width, height] = [Math.ceil(pen.measureText(text).width) + 36, 60];
    Object.assign(canvas, { width, height });
    const map = new THREE.CanvasTexture(canvas);
    const themed = () => {
      const css = `rgb(${(typeof rgb === "function" ? rgb() : rgb).map((c) => Math.round(255 * c)).join(",")})`;
      pen.clearRect(0, 0, width, height);
      Object.assign(pen, { font, textAlign: "center", textBaseline: "middle", lineWidth: 8, lineJoin: "round", fillStyle: css });
      if (filled) {
        pen.beginPath();
        pen.arc(30, 30, 28, Math.PI / 2, 1.5 * Math.PI);
        pen.arc(width - 30, 30, 28, -Math.PI / 2, Math.PI / 2);
        pen.fill();
        pen.fillStyle = "white";
      } else {
        pen.strokeStyle = nmm.theme.dark ? "rgba(22,28,35,0.8)" : "rgba(255,255,255,0.8)";
        pen.strokeText(text, width / 2, height / 2 + 2);
      }
      pen.fillText(text, width / 2, height / 2 + 2);
      map.needsUpdate = true;
    };
    themed();
    nmm.theme.listeners.push(themed);
    map.encoding = THREE.sRGBEncoding;
    map.minFilter = THREE.LinearFilter;
    const sprite = new THREE.Sprite(
      new THREE.SpriteMaterial({ map, depthTest: !filled, depthWrite: false, sizeAttenuation: false }),
    );
    scenery.sized(sprite, (width / height) * HIGH * part, HIGH * part);
    sprite.renderOrder = filled ? 1000 : 0;
    return sprite;
  }

  scenery.label = label;
  // A tube along points: one ring of vertices a point, with both ends closed.
  function tube(points, radius) {
    const rings = points.length + 2;
    const at = (i) => points[Math.min(Math.max(i, 0), points.length - 1)];
    const position = new Float32Array(3 * SIDES * rings);
    const normal = new Float32Array(3 * SIDES * rings);
    const along = new THREE.Vector3();
    const side = new THREE.Vector3();
    const up = new THREE.Vector3();
    for (let ring = 0; ring < rings; ring++) {
      const i = Math.min(Math.max(ring - 1, 0), points.length - 1);
      const closed = ring === 0 || ring === rings - 1;
      along.subVectors(at(i + 1), at(i - 1)).normalize();
      side.set(0, 0, 1).cross(along);
      if (side.lengthSq() < 1e-6) side.set(1, 0, 0);
      side.normalize();
      up.crossVectors(along, side);
      for (let k = 0; k < SIDES; k++) {
        const angle = (2 * Math.PI * k) / SIDES;
        const out = side.clone().multiplyScalar(Math.cos(angle)).addScaledVector(up, Math.sin(angle));
        out.toArray(normal, 3 * (ring * SIDES + k));
        out.multiplyScalar(closed ? 0 : radius).add(points[i]).toArray(position, 3 * (ring * SIDES + k));
      }
    }
    const index = [];
    for (let ring = 0; ring + 1 < rings; ring++) {
      for (let k = 0; k < SIDES; k++) {
        const [a, b] = [ring * SIDES + k, ring * SIDES + ((k + 1) % SIDES)];
        index.push(a, a + SIDES, b, b, a + SIDES, b + SIDES);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    geometry.setIndex(index);
    return geometry;
  }

  function material(rgb, opacity) {
    return new THREE.MeshLambertMaterial({
      color: nmm.color(rgb), emissive: nmm.color(rgb), emissiveIntensity: 0.35,
      opacity, transparent: opacity < 1, depthWrite: opacity === 1,
    });
  }

  // The points of a path that are at least `step` apart, and the last one; with times, if there are any.
  function thinned(points, times, step) {
    const kept = [];
    const when = [];
    for (let i = 0; 3 * i < points.length; i++) {
      const point = new THREE.Vector3().fromArray(points, 3 * i);
      const last = 3 * (i + 1) === points.length;
      if (kept.length && point.distanceTo(kept[kept.length - 1]) < (last ? 1e-9 : step)) continue;
      kept.push(point);
      when.push(times === null ? 0 : times[i]);
    }
    return [kept, when];
  }

  // A path without times is dashed; one with times grows as the robot drives it, over a faint whole.
  nmm.hooks.path = ({ path, color, points, times, thick, text }) => {
    const radius = Math.min(0.0032 * nmm.stage.size, nmm.stage.thin) * thick;
    const [kept, when] = thinned(points, times, 0.0048 * nmm.stage.size * thick);
    if (kept.length < 2) return;
    const group = new THREE.Group();
    if (times === null) {
      const ink = material(color, 1);
      for (const dash of dashes(kept, 9 * radius, 7 * radius)) group.add(new THREE.Mesh(tube(dash, 0.9 * radius), ink));
      const themed = () => [ink.color, ink.emissive].forEach((part) => part.copy(nmm.color(nmm.theme.paint(color))));
      themed();
      nmm.theme.listeners.push(themed);
      nmm.legend({ kind: "dashed", color, text });
    } else {
      const driven = tube(kept, 1.25 * radius);
      const faint = driven.clone();
      const ahead = material(color, 0.22);
      const themed = () => {
        ahead.opacity = nmm.theme.dark ? 0.6 : 0.35;
        for (const part of [ahead.color, ahead.emissive]) part.copy(nmm.color(color)).lerp(PAPER, nmm.theme.dark ? 0.15 : 0);
      };
      themed();
      nmm.theme.listeners.push(themed);
      group.add(new THREE.Mesh(faint, ahead), new THREE.Mesh(driven, material(color, 1)));
      scenery.trails.push({ geometry: driven, when });
      scenery.thin ||= thick < 1;
    }
    scenery.paths = (scenery.paths || []).concat(group);
    if (times === null) scenery.desired.push(group);
    add(path, group);
  };

  function dashes(points, dash, gap) {
    const lines = [];
    let [line, left, drawing] = [[points[0]], dash, true];
    for (let i = 1; i < points.length; i++) {
      let from = points[i - 1];
      let rest = from.distanceTo(points[i]);
      while (rest >= left) {
        from = from.clone().lerp(points[i], left / rest);
        rest = from.distanceTo(points[i]);
        if (drawing) lines.push([...line, from]);
        drawing = !drawing;
        left = drawing ? dash : gap;
        line = [from];
      }
      left -= rest;
      if (drawing && rest > 1e-9) line.push(points[i]);
    }
    if (drawing && line.length > 1) lines.push(line);
    return lines;
  }

  scenery.update = (time) => {
    for (const { geometry, when } of scenery.trails) {
      let [low, high] = [0, when.length];
      while (low < high) {
        const middle = (low + high) >> 1;
        if (when[middle] <= time + 1e-6) low = middle + 1;
        else high = middle;
      }
      geometry.setDrawRange(0, 6 * SIDES * (low === when.length ? low + 1 : low));
    }
  };
}
