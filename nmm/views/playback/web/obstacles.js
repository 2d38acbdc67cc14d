// Names of the obstacles, and for each motion a line between the two points that are nearest to each other.
"use strict";
{
  const THREE = MeshCat.THREE;
  const obstacles = (nmm.obstacles = { lines: [], shown: [] });

  nmm.hooks.obstacle = ({ path, name, color, top }) => {
    const tag = nmm.texts.put(written(20), "obstacle");
    tag.write(name, css(color.map((c) => 0.5 * c)));
    tag.position.fromArray(top);
    const meshes = [];
    nmm.node(path).traverse((part) => part.isMesh && !part.material.transparent && meshes.push(part));
    if (meshes.length) standing.push({ meshes });
    nmm.node(path).add(tag);
  };

  nmm.hooks.obstacles = ({ paths, color, text }) => nmm.legend({ kind: "box", color, text, path: paths });
  nmm.hooks.carried = ({ name, color }) => nmm.legend({ kind: "box", color, text: name });

  // Over everything, as it usually ends behind something.
  function painted() {
    return new THREE.MeshBasicMaterial({ depthTest: false, depthWrite: false, transparent: true });
  }

  // A text in front of everything, with a white rim, or on a white plate before the others; it is so many
  // pixels high on any screen.
  function written(height, plate = false) {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const sprite = new THREE.Sprite(
      new THREE.SpriteMaterial({ depthTest: false, depthWrite: false, sizeAttenuation: false }),
    );
    sprite.renderOrder = plate ? 1002 : 1001;
    const font = "600 40px system-ui, sans-serif";
    sprite.write = (text, color) => {
      if (sprite.text === text + color) return;
      sprite.text = text + color;
      pen.font = font;
      const width = Math.ceil(pen.measureText(text).width) + 24;
      Object.assign(canvas, { width, height: 60 });
      Object.assign(pen, { font, textAlign: "center", textBaseline: "middle", lineWidth: 9, lineJoin: "round" });
      Object.assign(pen, { strokeStyle: "rgba(255,255,255,0.85)", fillStyle: color });
      if (plate) {
        pen.fillStyle = pen.strokeStyle;
        pen.beginPath();
        pen.arc(26, 30, 26, Math.PI / 2, 1.5 * Math.PI);
        pen.arc(width - 26, 30, 26, -Math.PI / 2, Math.PI / 2);
        pen.fill();
        pen.fillStyle = color;
      }
      pen.strokeText(text, width / 2, 32);
      pen.fillText(text, width / 2, 32);
      nmm.scenery.sized(sprite, (height * width) / 60, height);
      if (sprite.material.map) sprite.material.map.dispose();
      const map = new THREE.CanvasTexture(canvas);
      map.encoding = THREE.sRGBEncoding;
      map.minFilter = THREE.LinearFilter;
      Object.assign(sprite.material, { map, needsUpdate: true });
    };
    return sprite;
  }

  const css = (rgb) => `rgb(${rgb.map((c) => Math.round(255 * c)).join(",")})`;

  nmm.hooks.nearest = (found) => {
    const radius = 0.0035 * nmm.stage.size;
    const material = painted();
    const line = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, 8), material);
    const ends = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(2.2 * radius, 12, 8), material));
    const text = nmm.texts.put(written(23, true), "distance");
    const group = new THREE.Group();
    group.add(line, ...ends, text);
    for (const part of [line, ...ends]) part.renderOrder = 1000;
    nmm.viewer.set_object(nmm.split(found.path), group);
    const item = nmm.legend({ kind: "line", color: found.color, text: "" });
    item.classList.add("nearest");
    const words = item.appendChild(document.createElement("span"));
    obstacles.shown.push({ ...found, group, line, ends, text, item, words, material });
    obstacles.lines.push(nmm.node(found.path));
    document.body.classList.add("distances");
  };

  const point = (points, k, end) => new THREE.Vector3().fromArray(points, 6 * k + 3 * end);

  // The points at a time: between two samples on the way from one to the next, where the pair stays.
  function at({ times, points, distance, pairs }, time) {
    let [low, high] = [0, times.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-6) low = middle;
      else high = middle - 1;
    }
    const next = Math.min(low + 1, times.length - 1);
    const goes = next > low && pairs[next] === pairs[low];
    const share = goes ? Math.min(Math.max((time - times[low]) / (times[next] - times[low]), 0), 1) : 0;
    return {
      pair: pairs[low],
      d: distance[low] + share * (distance[next] - distance[low]),
      ends: [0, 1].map((end) => point(points, low, end).lerp(point(points, next, end), share)),
    };
  }

  // What stands before most of a robot is seen through.
  const [FADED, MOST_HIDDEN] = [0.3, 0.4];
  const standing = [];
  const ray = new THREE.Raycaster();
  let seen = "";

  nmm.texts.before.push((eye) => {
    if (!standing.length || !nmm.motions) return;
    const points = nmm.motions.flatMap(({ path }) => (nmm.node(path).visible ? joints(path) : []));
    const now = [eye.matrixWorld.elements, ...points.map((p) => p.toArray())].flat().map((x) => x.toFixed(3)).join(" ");
    if (now === seen || !points.length) return;
    seen = now;
    const from = new THREE.Vector3().setFromMatrixPosition(eye.matrixWorld);
    for (const { meshes } of standing) {
      const hidden = points.filter((point) => {
        const way = point.clone().sub(from);
        ray.set(from, way.clone().normalize());
        ray.far = way.length();
        return ray.intersectObjects(meshes, false).length > 0;
      });
      const faded = hidden.length > MOST_HIDDEN * points.length;
      for (const { material } of meshes) {
        Object.assign(material, { transparent: faded, opacity: faded ? FADED : 1, depthWrite: !faded });
      }
    }
  });

  // Where a robot's joints are.
  function joints(path) {
    const found = [];
    nmm.viewer.scene_tree.find(nmm.split(`${path}/robot`)).object.traverse((part) => {
      if (part.isMesh && part.geometry.boundingSphere) {
        found.push(part.geometry.boundingSphere.center.clone().applyMatrix4(part.matrixWorld));
      }
    });
    return found;
  }

  obstacles.update = (time) => {
    for (const one of obstacles.shown) {
      const { pair, d, ends } = at(one, time);
      one.group.visible = pair >= 0;
      one.item.classList.toggle("far", pair < 0);
      if (pair < 0) continue;
      const color = d < one.asked ? one.alarm : one.color;
      one.material.color.copy(nmm.color(nmm.theme.paint(color)));
      one.ends.forEach((end, k) => end.position.copy(ends[k]));
      const along = ends[1].clone().sub(ends[0]);
      const length = along.length();
      one.line.visible = length > 1e-9;
      one.line.scale.y = length;
      one.line.position.copy(ends[0]).addScaledVector(along, 0.5);
      if (length > 1e-9) {
        one.line.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
      }
      one.text.visible = one.told[pair] || d < one.asked;
      one.text.position.copy(ends[0]).add(ends[1]).multiplyScalar(0.5);
      one.text.write(`${d.toFixed(3)} m`, css(color));
      one.item.firstChild.style.color = nmm.theme.css(color);
      one.words.textContent = `${one.of ? `${one.of}: ` : ""}${one.names[pair]}`;
    }
  };
}
