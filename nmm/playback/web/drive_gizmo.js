// The handle of a target: a ball that is dragged in a plane, and an arrow for each axis that it may go along.
"use strict";
{
  const THREE = MeshCat.THREE;
  const COLORS = { x: 0xd63a2e, y: 0x2f9e44, z: 0x2b6be0 };
  const WAYS = { x: new THREE.Vector3(1, 0, 0), y: new THREE.Vector3(0, 1, 0), z: new THREE.Vector3(0, 0, 1) };
  const view = document.getElementById("view");
  const gizmos = (nmm.gizmos = { all: [], held: null });
  // three.js has y upwards, the robot's world z.
  const toWorld = (v) => new THREE.Vector3(v.x, -v.z, v.y);

  function handle(geometry, color, name, gizmo) {
    const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true, opacity: 0.92 }));
    mesh.renderOrder = 1100;
    mesh.userData = { name, gizmo };
    return mesh;
  }

  function arrow(axis, length, gizmo) {
    const group = new THREE.Group();
    const [shaft, head] = [
      handle(new THREE.CylinderGeometry(0.022 * length, 0.022 * length, 0.72 * length, 12), COLORS[axis], axis, gizmo),
      handle(new THREE.ConeGeometry(0.085 * length, 0.24 * length, 16), COLORS[axis], axis, gizmo),
    ];
    shaft.position.y = 0.5 * length;
    head.position.y = 0.98 * length;
    group.add(shaft, head);
    if (axis === "x") group.rotation.z = -Math.PI / 2;
    if (axis === "z") group.rotation.x = Math.PI / 2;
    return group;
  }

  // target: its number; axes: those it moves along; moved(place): what to do with another place.
  gizmos.add = (target, axes, length, moved) => {
    const group = new THREE.Group();
    const gizmo = { target, axes, moved, place: new THREE.Vector3(), group };
    group.add(handle(new THREE.SphereGeometry(0.16 * length, 24, 16), 0xd41a38, "ball", gizmo));
    for (const axis of axes) group.add(arrow(axis, length, gizmo));
    nmm.viewer.set_object(nmm.split(`/nmm/gizmo ${target}`), group);
    gizmos.all.push(gizmo);
    return gizmo;
  };
  gizmos.put = (gizmo, x, y, z) => {
    gizmo.place.set(x, y, z);
    gizmo.group.position.copy(gizmo.place);
    nmm.viewer.set_dirty();
  };

  function ray(event) {
    const box = view.getBoundingClientRect();
    const at = new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height,
    );
    const caster = new THREE.Raycaster();
    caster.setFromCamera(at, nmm.viewer.camera);
    return caster;
  }
  function found(event) {
    const parts = gizmos.all.flatMap(({ group }) => {
      const all = [];
      group.traverse((part) => part.isMesh && all.push(part));
      return all;
    });
    // An arrow that points at the viewer lies over the ball, and leads nowhere.
    const hits = ray(event).intersectObjects(parts, false).map(({ object }) => object.userData);
    return hits.find(({ name }) => name === "ball") || hits[0] || null;
  }

  // Where on the axis, or in the plane, through the gizmo's place the pointer is; null where it is nowhere.
  function under(event, { name, gizmo, start }, upright) {
    const { ray: line } = ray(event);
    const [from, along] = [toWorld(line.origin), toWorld(line.direction)];
    if (name !== "ball") {
      const axis = WAYS[name];
      const across = axis.clone().cross(along);
      if (across.lengthSq() < 1e-4) return null;
      const way = from.clone().sub(start).cross(along).dot(across) / across.lengthSq();
      return start.clone().addScaledVector(axis, way);
    }
    // Upright planes face the camera: with Shift, or where the target cannot move in the ground's plane.
    const flat = !upright && gizmo.axes.some((axis) => axis !== "z");
    const normal = flat ? WAYS.z : new THREE.Vector3(along.x, along.y, 0).normalize();
    const steep = normal.dot(along);
    if (Math.abs(steep) < 0.03) return null;
    const distance = normal.dot(start.clone().sub(from)) / steep;
    return distance > 0 ? from.addScaledVector(along, distance) : null;
  }

  view.addEventListener("pointerdown", (event) => {
    const hit = event.button === 0 ? found(event) : null;
    if (hit === null) return;
    event.stopPropagation();
    event.preventDefault();
    view.setPointerCapture(event.pointerId);
    nmm.viewer.controls.enabled = false;
    gizmos.held = { ...hit, start: hit.gizmo.place.clone() };
    gizmos.held.offset = (under(event, gizmos.held, event.shiftKey) || hit.gizmo.place.clone()).sub(hit.gizmo.place);
  }, true);
  view.addEventListener("pointermove", (event) => {
    const { held } = gizmos;
    if (held === null) {
      view.style.cursor = event.buttons === 0 && found(event) ? "grab" : "";
      return;
    }
    event.stopPropagation();
    const at = under(event, held, event.shiftKey);
    if (at === null) return;
    at.sub(held.offset);
    const { gizmo } = held;
    const next = gizmo.place.clone();
    for (const axis of gizmo.axes) next[axis] = at[axis];
    gizmos.put(gizmo, next.x, next.y, next.z);
    gizmo.moved(next);
  }, true);
  for (const end of ["pointerup", "pointercancel"]) {
    view.addEventListener(end, () => {
      if (gizmos.held === null) return;
      gizmos.held = null;
      nmm.viewer.controls.enabled = true;
    }, true);
  }
}
