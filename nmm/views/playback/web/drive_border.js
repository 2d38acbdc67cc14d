// An arrow at the view's border towards each target that has left the picture; a click brings it back.
"use strict";
{
  const THREE = MeshCat.THREE;
  const EDGE = 26; // px between the border and an arrow's middle
  const view = document.getElementById("view");
  const arrows = new Map();
  const border = (nmm.border = {});

  function arrow(target) {
    const title = `${target.heading} is out of the picture: show it (R)`;
    const button = nmm.element(document.body, "button", { class: "away", title, "aria-label": title, hidden: "" });
    button.innerHTML = '<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M4 5l17 7-17 7 4-7z"/></svg>';
    button.addEventListener("click", nmm.actions.reset);
    return button;
  }

  // Where a point is seen, from -1 to 1 to the right and upwards, or the way to it.
  function seen(place) {
    const { camera } = nmm.viewer;
    const p = new THREE.Vector3(place.x, place.z, -place.y);
    const behind = p.clone().applyMatrix4(camera.matrixWorldInverse).z > 0;
    const { x, y } = p.project(camera);
    return { x: behind ? -x : x, y: behind ? -y : y, out: behind || Math.max(Math.abs(x), Math.abs(y)) > 1 };
  }

  // Below what lies over the view's upper half, or above what lies over its lower one.
  function clear(x, y) {
    for (const id of ["heading", "tools", "status", "bar"]) {
      const card = document.getElementById(id).getBoundingClientRect();
      if (x < card.left - EDGE || x > card.right + EDGE || y < card.top - EDGE || y > card.bottom + EDGE) continue;
      if (card.width) y = card.top < 0.5 * view.clientHeight ? card.bottom + EDGE : card.top - EDGE;
    }
    return [x, y];
  }

  border.update = (targets) => {
    for (const target of targets) {
      if (!target.gizmo) continue;
      if (!arrows.has(target)) arrows.set(target, arrow(target));
      const button = arrows.get(target);
      const { x, y, out } = seen(target.gizmo.place);
      if (button.hidden === out) button.hidden = !out;
      if (!out) continue;
      const { left, top, width, height } = view.getBoundingClientRect();
      const [across, up] = [0.5 * width * x, 0.5 * height * y];
      const share = Math.min((0.5 * width - EDGE) / Math.abs(across), (0.5 * height - EDGE) / Math.abs(up));
      const [px, py] = clear(left + 0.5 * width + share * across, top + 0.5 * height - share * up);
      button.style.transform = `translate(${px.toFixed(1)}px, ${py.toFixed(1)}px) rotate(${Math.atan2(-up, across).toFixed(3)}rad)`;
    }
  };
}
