// Names beside points of the scene: text of the page, moved apart where they would lie on one another.
"use strict";
{
  const THREE = MeshCat.THREE;
  const SVG = "http://www.w3.org/2000/svg";
  const [ASIDE, GAP] = [12, 2];
  const labels = (nmm.labels = { shown: true });
  const layer = nmm.element(document.body, "div", { id: "labels", "aria-hidden": "true" });
  const lines = layer.appendChild(document.createElementNS(SVG, "svg"));
  const leaders = lines.appendChild(document.createElementNS(SVG, "path"));
  const all = new Map();
  let last = "";

  // node: null takes the label away.
  labels.put = (key, text, node) => {
    if (node === null) {
      if (all.has(key)) all.get(key).tag.remove();
      all.delete(key);
    } else if (!all.has(key)) {
      const tag = nmm.element(layer, "span", {}, text);
      all.set(key, { tag, node, width: tag.offsetWidth, height: tag.offsetHeight });
    }
    last = "";
  };

  labels.show = (on) => {
    labels.shown = on;
    layer.hidden = !on;
    last = "";
  };

  // Where each label's point is in the picture, from the upper edge downwards.
  function seen(width, height) {
    const found = [];
    for (const label of all.values()) {
      const point = new THREE.Vector3().setFromMatrixPosition(label.node.matrixWorld).project(nmm.viewer.camera);
      if (point.z > 1) continue;
      found.push({ ...label, x: (0.5 + 0.5 * point.x) * width, y: (0.5 - 0.5 * point.y) * height });
    }
    return found.sort((a, b) => a.y - b.y || a.x - b.x);
  }

  // The nearest free place to the right of the point, then to its left, upwards or downwards.
  function free(label, placed, width) {
    const clear = (left, top) =>
      left >= 0 && left + label.width <= width &&
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
    return { left: label.x + ASIDE, top: label.y };
  }

  function update() {
    requestAnimationFrame(update);
    if (!labels.shown || all.size === 0 || !nmm.viewer.camera) return;
    const view = document.getElementById("view");
    const [width, height] = [view.clientWidth, view.clientHeight];
    const found = seen(width, height);
    const now = [width, height, ...found.map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`)].join(" ");
    if (now === last) return;
    last = now;
    for (const { tag } of all.values()) tag.hidden = true;
    const placed = [];
    let path = "";
    for (const label of found) {
      const { left, top } = free(label, placed, width);
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
