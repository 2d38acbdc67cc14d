// A tape: two clicks on what one sees, or on the ground, tell how far they are from each other, and along each axis.
"use strict";
{
  const THREE = MeshCat.THREE;
  const [STILL, BALL] = [4, 0.006]; // px that a click may move; radius of an end, of the scene's size
  const COLOR = [0.72, 0.12, 0.5];
  const view = document.getElementById("view");
  const button = document.getElementById("measure");
  const told = document.getElementById("measured");
  const measure = (nmm.measure = { on: false, points: [] });
  let [group, pressed] = [null, null];

  // Of what is drawn there, in three.js's axes; the ground where nothing is. Null in the sky.
  function hit({ clientX, clientY }) {
    const box = view.getBoundingClientRect();
    const caster = new THREE.Raycaster();
    const at = [(2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height];
    caster.setFromCamera(new THREE.Vector2(...at), nmm.viewer.camera);
    const solid = [];
    nmm.viewer.scene.traverseVisible((part) => part.isMesh && part.material.depthWrite !== false && part.material.depthTest !== false && solid.push(part));
    const [nearest] = caster.intersectObjects(solid, false);
    return nearest ? nearest.point : caster.ray.intersectPlane(new THREE.Plane(new THREE.Vector3(0, 1, 0)), new THREE.Vector3());
  }

  // The scene is turned: robots have z upwards.
  const world = ({ x, y, z }) => new THREE.Vector3(x, -z, y);

  function draw() {
    if (group) {
      nmm.viewer.scene.remove(group);
      for (const { geometry, material } of group.children) [geometry, material].forEach((part) => part.dispose());
    }
    group = null;
    if (measure.points.length) {
      const color = nmm.color(COLOR);
      const over = { color, depthTest: false, transparent: true };
      const parts = measure.points.map((point) => {
        const ball = new THREE.Mesh(new THREE.SphereGeometry(BALL * nmm.stage.size, 16, 12), new THREE.MeshBasicMaterial(over));
        ball.position.copy(world(point));
        return ball;
      });
      if (parts.length > 1) parts.push(new THREE.Line(new THREE.BufferGeometry().setFromPoints(measure.points.map(world)), new THREE.LineBasicMaterial(over)));
      for (const part of parts) part.renderOrder = 1200;
      group = new THREE.Group().add(...parts);
      nmm.viewer.scene.add(group);
    }
    tell();
    nmm.viewer.set_dirty();
  }

  function tell() {
    const [from, to] = measure.points.map((point) => world(point).toArray());
    const metres = (numbers) => numbers.map((x) => nmm.fixed(x, 3).replace("-", "−")).join(", ");
    if (!measure.on) told.textContent = "";
    else if (!from) told.textContent = "Click a point: a robot's, an obstacle's, the ground's";
    else if (!to) told.textContent = `(${metres(from)}) m; click another`;
    else {
      const way = to.map((x, i) => x - from[i]);
      told.textContent = `${metres([Math.hypot(...way)])} m; along x, y, z ${metres(way)} m`;
    }
  }

  nmm.actions.measure = () => {
    measure.on = !measure.on;
    measure.points = [];
    button.setAttribute("aria-pressed", String(measure.on));
    view.classList.toggle("measuring", measure.on);
    draw();
  };
  button.addEventListener("click", nmm.actions.measure);

  // A drag turns the camera.
  view.addEventListener("pointerdown", (event) => (pressed = event.button === 0 ? event : null), true);
  view.addEventListener("pointerup", (event) => {
    const from = pressed;
    pressed = null;
    if (!measure.on || !from || Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) > STILL) return;
    const point = hit(event);
    if (!point) return;
    measure.points = [...measure.points.slice(0, 2 * (measure.points.length < 2)), point];
    draw();
  }, true);
}
