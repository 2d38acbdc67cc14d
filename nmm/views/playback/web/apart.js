// Robots that are compared, set apart from one another: over one another at first, side by side in the end.
"use strict";
{
  const THREE = MeshCat.THREE;
  const slider = document.getElementById("apart");
  // ways: how far each motion is moved, in three.js's axes; none while they stand over one another.
  const apart = (nmm.apart = { share: 0, ways: [] });
  const copies = [];
  const shared = () => Object.entries(nmm.viewer.scene_tree.find(["nmm"]).children).filter(([name]) => /^(desired|target) \d+$/.test(name));

  // The direction in which they need the least room, and how much that is.
  function room() {
    const box = new THREE.Box3().setFromArray(nmm.stage.view);
    const { x, y } = box.getSize(new THREE.Vector3());
    return x < y ? new THREE.Vector3(1.05 * x, 0, 0) : new THREE.Vector3(0, -1.05 * y, 0);
  }

  // Each robot that is moved takes the desired paths and targets along.
  function copied() {
    if (copies.length) return;
    nmm.motions.forEach((motion, i) => {
      if (i === 0) return;
      const group = new THREE.Group();
      for (const [name, { object }] of shared()) {
        const copy = object.clone();
        copy.visible = true;
        group.add(copy);
        if (name.startsWith("desired")) nmm.scenery.paths.push(...copy.children);
      }
      nmm.viewer.set_object(nmm.split(`/nmm/apart ${i}`), group);
      copies.push(nmm.node(`/nmm/apart ${i}`));
    });
  }

  // Set apart, a run that is hidden hides what it took along.
  function show() {
    const own = apart.share > 0;
    for (const [, { object }] of shared()) object.visible = !(own && nmm.runs[0].hidden);
    copies.forEach((copy, i) => (copy.visible = own && !nmm.runs[i + 1].hidden));
  }

  apart.set = (share) => {
    apart.share = Math.min(Math.max(Number.isFinite(share) ? share : 0, 0), 1);
    slider.value = apart.share;
    slider.setAttribute("aria-valuetext", `${Math.round(100 * apart.share)} %`);
    const way = room().multiplyScalar(apart.share);
    if (apart.share > 0) copied();
    apart.ways = [];
    nmm.motions.forEach((motion, i) => {
      const by = way.clone().multiplyScalar(i);
      nmm.node(motion.path).position.copy(by);
      if (i > 0 && copies.length) copies[i - 1].position.copy(by);
      if (apart.share > 0) apart.ways.push(new THREE.Vector3(by.x, by.z, -by.y));
    });
    show();
    if (!nmm.camera.moved) nmm.camera.reset();
    nmm.viewer.set_dirty();
    nmm.address.changed();
  };
  apart.start = () => document.body.classList.toggle("several", nmm.motions.length > 1);
  nmm.runs.listeners.push(show);
  slider.addEventListener("input", () => apart.set(Number(slider.value)));
}
