// Names beside points of the scene: text of the page, moved apart where they would lie on one another or on the tools.
"use strict";
{
  const THREE = MeshCat.THREE;
  const SVG = "http://www.w3.org/2000/svg";
  const [ASIDE, GAP, NEAR] = [12, 2, 24];
  // all: whether every name is shown, or those that are kept and the one that is pointed at.
  const labels = (nmm.labels = { all: false });
  const layer = nmm.element(document.body, "div", { id: "labels", "aria-hidden": "true" });
  const lines = layer.appendChild(document.createElementNS(SVG, "svg"));
  const leaders = lines.appendChild(document.createElementNS(SVG, "path"));
  const all = new Map();
  let [last, pointer] = ["", null];
  const view = document.getElementById("view");

  // node: null takes the label away.
  labels.put = (key, text, node, kept) => {
    if (node === null) {
      if (all.has(key)) all.get(key).tag.remove();
      all.delete(key);
    } else {
      const tag = all.get(key)?.tag ?? nmm.element(layer, "span", {}, text);
      tag.hidden = false;
      all.set(key, { tag, node, kept, width: tag.offsetWidth, height: tag.offsetHeight });
    }
    last = "";
  };

  labels.showAll = (on) => {
    labels.all = on;
    last = "";
  };

  view.addEventListener("pointermove", ({ clientX, clientY }) => (pointer = [clientX, clientY]));
  view.addEventListener("pointerleave", () => (pointer = null));

  // Where the points of the labels to be shown are in the picture, from the upper edge downwards.
  function seen(width, height) {
    const found = [];
    let [nearest, least] = [null, NEAR];
    for (const label of all.values()) {
      const point = new THREE.Vector3().setFromMatrixPosition(label.node.matrixWorld).project(nmm.viewer.camera);
      const one = { ...label, x: (0.5 + 0.5 * point.x) * width, y: (0.5 - 0.5 * point.y) * height };
      if (point.z > 1 || one.x < 0 || one.x > width || one.y < 0 || one.y > height) continue;
      const away = pointer === null ? Infinity : Math.hypot(one.x - pointer[0], one.y - pointer[1]);
      if (away < least) [nearest, least] = [one, away];
      found.push(one);
    }
    const wanted = found.filter((one) => labels.all || one.kept || one === nearest);
    return wanted.sort((a, b) => a.y - b.y || a.x - b.x);
  }

  // What lies over the view, as boxes.
  const cards = () =>
    ["heading", "tools"].map((id) => document.getElementById(id).getBoundingClientRect()).filter(({ width }) => width);

  // The nearest free place to the right of the point, then to its left, upwards or downwards; null for none.
  function free(label, placed, width, height) {
    const clear = (left, top) =>
      left >= 0 && left + label.width <= width && top >= 0 && top + label.height <= height &&
      placed.every(
        (other) =>
          left > other.left + other.width + GAP || other.left > left + label.width + GAP ||
          top > other.top + other.height + GAP || other.top > top + label.height + GAP,
      );
    const step = label.height + GAP;
    for (let k = 0; k < 40; k++) {
      const shift = (k % 2 ? 1 : -1) * Math.ceil(k / 2) * 0.5 * step;
      const top = label.y - 0.5 * label.height + shift;
      for (const left of [label.x + ASIDE, label.x - ASIDE - label.width]) {
        if (clear(left, top)) return { left, top };
      }
    }
    return null;
  }

  function update() {
    requestAnimationFrame(update);
    if (!nmm.viewer.camera) return;
    const [width, height] = [view.clientWidth, view.clientHeight];
    const found = seen(width, height);
    const now = [width, height, ...found.map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`)].join(" ");
    if (now === last) return;
    last = now;
    for (const { tag } of all.values()) tag.hidden = true;
    const placed = cards();
    let path = "";
    for (const label of found) {
      const place = free(label, placed, width, height);
      if (place === null) continue;
      const { left, top } = place;
      placed.push({ left, top, width: label.width, height: label.height });
      label.tag.hidden = false;
      label.tag.style.transform = `translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)`;
      const near = left > label.x ? left : left + label.width;
      path += `M${label.x.toFixed(1)} ${label.y.toFixed(1)}L${near.toFixed(1)} ${(top + 0.5 * label.height).toFixed(1)}`;
    }
    leaders.setAttribute("d", path);
  }
  requestAnimationFrame(update);
}
