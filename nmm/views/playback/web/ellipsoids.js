// How fast an end-effector can move in each direction: translucent ellipsoids that the animation scales.
"use strict";
{
  const THREE = MeshCat.THREE;
  const AROUND = 72;
  const ball = new THREE.SphereGeometry(1, 48, 32);
  // The circles in which the planes of two axes cut it: a flat one keeps its edge and shows its axes.
  const circles = new THREE.BufferGeometry();
  const points = [];
  for (let plane = 0; plane < 3; plane++) {
    for (let k = 0; k < 2 * AROUND; k++) {
      const angle = (2 * Math.PI * ((k + 1) >> 1)) / AROUND;
      const point = [0, 0, 0];
      point[plane] = Math.cos(angle);
      point[(plane + 1) % 3] = Math.sin(angle);
      points.push(...point);
    }
  }
  circles.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));

  // after: of two around one point the larger one is drawn after the smaller.
  nmm.hooks.ellipsoid = ({ path, color, opacity, after }) => {
    const rgb = nmm.color(color);
    const seen = { transparent: true, depthWrite: false };
    const skin = new THREE.Mesh(ball, new THREE.MeshLambertMaterial({
      ...seen, color: rgb, emissive: rgb, emissiveIntensity: 0.4, opacity,
    }));
    const dark = rgb.clone().multiplyScalar(0.6);
    const lines = new THREE.LineSegments(circles, new THREE.LineBasicMaterial({ ...seen, color: dark, opacity: 0.75 }));
    // After the ghosts, before the tags.
    skin.renderOrder = 600 + 2 * after;
    lines.renderOrder = skin.renderOrder + 1;
    const group = new THREE.Group();
    group.add(skin, lines);
    nmm.viewer.set_object(nmm.split(path), group);
  };

  nmm.hooks.ellipsoids = ({ groups, entries, note }) => {
    nmm.ellipsoids = groups.map(nmm.node);
    for (const { text, color, paths } of entries) nmm.legend({ kind: "ball", color, text, path: paths });
    const item = document.createElement("li");
    item.className = "note";
    item.textContent = note;
    document.getElementById("legend").append(item);
    document.body.classList.add("ellipsoids");
  };
}
