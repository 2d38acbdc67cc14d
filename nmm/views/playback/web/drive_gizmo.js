// The handle of a target: a ball that is dragged in a plane, an arrow for each axis that it may go along, and rings
// to turn it. A target that turns has them along its own axes.
"use strict";
{
  const THREE = MeshCat.THREE;
  const COLORS = { x: 0xd63a2e, y: 0x2f9e44, z: 0x2b6be0, ball: 0xd41a38 };
  const DEAD = 0x8a949f;
  const AXES = ["x", "y", "z"];
  const UNIT = Object.fromEntries(AXES.map((axis, i) => [axis, new THREE.Vector3().setComponent(i, 1)]));
  const [REST, HELD] = [0.85, 1];
  const RING = 0.72; // of the arrows' length
  const EDGE = 0.25; // cosine of the angle from which on a ring is seen from its side
  const view = document.getElementById("view");
  const gizmos = (nmm.gizmos = { all: [], held: null, bright: null });
  // three.js has y upwards, the robot's world z.
  const toWorld = (v) => new THREE.Vector3(v.x, -v.z, v.y);
  const linear = (hex) => new THREE.Color(hex).convertSRGBToLinear();

  function handle(geometry, name, gizmo, { color = COLORS[name], seen = true } = {}) {
    const material = new THREE.MeshBasicMaterial({ color: linear(color), depthTest: false, transparent: true, opacity: REST });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = 1100;
    mesh.visible = seen;
    mesh.userData = { name, gizmo };
    return mesh;
  }

  // Shapes made along y, turned to another axis.
  function along(axis, ...parts) {
    const group = new THREE.Group();
    group.add(...parts);
    if (axis === "x") group.rotation.z = -Math.PI / 2;
    if (axis === "z") group.rotation.x = Math.PI / 2;
    return group;
  }
  function arrow(axis, length, gizmo) {
    const shaft = handle(new THREE.CylinderGeometry(0.022 * length, 0.022 * length, 0.72 * length, 12), axis, gizmo);
    const head = handle(new THREE.ConeGeometry(0.085 * length, 0.24 * length, 16), axis, gizmo);
    shaft.position.y = 0.5 * length;
    head.position.y = 0.98 * length;
    return along(axis, shaft, head);
  }
  // Thin to the eye and thicker to the pointer.
  function ring(axis, length, gizmo) {
    const parts = [0.016, 0.07].map((thick) => {
      const geometry = new THREE.TorusGeometry(gizmo.radius, thick * length, 8, 64).rotateX(Math.PI / 2);
      return handle(geometry, `turn ${axis}`, gizmo, { color: COLORS[axis], seen: thick < 0.02 });
    });
    return along(axis, ...parts);
  }

  // target: its number; axes: those it moves along; turns: whether it turns; moved(place, rotation): what to do with
  // another place or rotation.
  gizmos.add = (target, { axes, turns }, length, moved) => {
    const [group, turned] = [new THREE.Group(), new THREE.Group()];
    const gizmo = { target, axes, turns, moved, place: new THREE.Vector3(), rotation: new THREE.Quaternion(), group, turned };
    Object.assign(gizmo, { own: turns && axes.length === 3, radius: RING * length });
    group.add(turned);
    if (axes.length) group.add(handle(new THREE.SphereGeometry(0.16 * length, 24, 16), "ball", gizmo));
    for (const axis of axes) (gizmo.own ? turned : group).add(arrow(axis, length, gizmo));
    if (turns) for (const axis of AXES) turned.add(ring(axis, length, gizmo));
    nmm.viewer.set_object(nmm.split(`/nmm/gizmo ${target}`), group);
    gizmos.all.push(gizmo);
    return gizmo;
  };
  gizmos.put = (gizmo, { x, y, z }, rotation = gizmo.rotation) => {
    gizmo.place.set(x, y, z);
    gizmo.rotation.copy(rotation);
    gizmo.group.position.copy(gizmo.place);
    gizmo.turned.quaternion.copy(gizmo.rotation);
    nmm.viewer.set_dirty();
  };

  // A rotation vector (3), rad, of at most π, and its quaternion.
  gizmos.quaternion = (vector) => {
    const v = new THREE.Vector3(...vector);
    const angle = v.length();
    return new THREE.Quaternion().setFromAxisAngle(angle > 0 ? v.divideScalar(angle) : v.set(1, 0, 0), angle);
  };
  gizmos.vector = ({ x, y, z, w }) => {
    const v = new THREE.Vector3(x, y, z).multiplyScalar(w < 0 ? -1 : 1);
    const size = v.length();
    return size > 0 ? v.multiplyScalar((2 * Math.atan2(size, Math.abs(w))) / size).toArray() : [0, 0, 0];
  };

  function parts() {
    const all = [];
    for (const { group } of gizmos.all) group.traverse((part) => part.isMesh && all.push(part));
    return all;
  }
  // Where a pointer is in the picture: across and upwards, -1 to 1.
  function inPicture({ clientX, clientY }) {
    const box = view.getBoundingClientRect();
    return new THREE.Vector2((2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height);
  }
  function ray(event) {
    const caster = new THREE.Raycaster();
    caster.setFromCamera(inPicture(event), nmm.viewer.camera);
    return caster;
  }
  function found(event) {
    const hits = ray(event).intersectObjects(parts(), false).map(({ object, point }) => ({ ...object.userData, point }));
    // An arrow that points at the viewer lies over the ball, and leads nowhere.
    return hits.find(({ name }) => name === "ball") || hits[0] || null;
  }
  // What is under the pointer, or held, is bright.
  function light(hit) {
    const name = hit && `${hit.gizmo.target} ${hit.name}`;
    if (name === gizmos.bright) return;
    gizmos.bright = name;
    for (const { material, userData } of parts()) {
      material.opacity = `${userData.gizmo.target} ${userData.name}` === name ? HELD : hit ? 0.45 : REST;
    }
    nmm.viewer.set_dirty();
  }

  // Where a line, from and along, meets a plane through a point; null where it is nowhere.
  function onPlane({ from, way }, point, normal) {
    const steep = normal.dot(way);
    if (Math.abs(steep) < 0.03) return null;
    const distance = normal.dot(point.clone().sub(from)) / steep;
    return distance > 0 ? from.clone().addScaledVector(way, distance) : null;
  }
  function line(event) {
    const { ray: one } = ray(event);
    return { from: toWorld(one.origin), way: toWorld(one.direction) };
  }

  // Where on the axis, or in the plane, through the gizmo's place the pointer is; null where it is nowhere.
  function under(event, { name, gizmo, start, axis }) {
    const { from, way } = line(event);
    if (name !== "ball") {
      const across = axis.clone().cross(way);
      if (across.lengthSq() < 1e-4) return null;
      return start.clone().addScaledVector(axis, from.clone().sub(start).cross(way).dot(across) / across.lengthSq());
    }
    // Upright planes face the camera: with Shift, or where the target cannot move in the ground's plane.
    const flat = !event.shiftKey && gizmo.axes.some((one) => one !== "z");
    return onPlane({ from, way }, start, flat ? UNIT.z : new THREE.Vector3(way.x, way.y, 0).normalize());
  }

  // The angle of the pointer about a ring's axis, rad: in its plane; seen from its side, as on a wheel's rim in front.
  function angle(event, { gizmo, start, axis, grabbed, side, sight }) {
    const arm = (side ? sight.clone().negate() : grabbed.clone().sub(start)).projectOnPlane(axis).normalize();
    const ahead = axis.clone().cross(arm);
    const at = side ? onPlane(line(event), grabbed, sight) : onPlane(line(event), start, axis);
    if (at === null) return null;
    if (side) return at.sub(grabbed).dot(ahead) / gizmo.radius;
    at.sub(start);
    return Math.atan2(at.dot(ahead), at.dot(arm));
  }

  view.addEventListener("pointerdown", (event) => {
    const hit = event.button === 0 && !nmm.ended && !nmm.silent ? found(event) : null;
    if (hit === null) return;
    event.stopPropagation();
    event.preventDefault();
    view.setPointerCapture(event.pointerId);
    nmm.viewer.controls.enabled = false;
    const { name, gizmo } = hit;
    nmm.camera.freeze(true, name.startsWith("turn ") ? null : () => inPicture(gizmos.held.event));
    light(hit);
    const held = (gizmos.held = { ...hit, event, start: gizmo.place.clone(), rotation: gizmo.rotation.clone() });
    held.ring = name.startsWith("turn ") ? name.slice(5) : null;
    const axis = UNIT[held.ring || name];
    if (axis) held.axis = axis.clone().applyQuaternion(gizmo.own || held.ring ? gizmo.rotation : new THREE.Quaternion());
    if (held.ring) {
      held.grabbed = toWorld(hit.point);
      held.sight = line(event).way;
      held.side = Math.abs(held.axis.dot(held.sight)) < EDGE;
      [held.angle, held.turn] = [angle(event, held) || 0, 0];
    } else held.offset = (under(event, held) || gizmo.place.clone()).sub(gizmo.place);
  }, true);
  view.addEventListener("pointermove", (event) => {
    const { held } = gizmos;
    if (held === null) {
      const hit = event.buttons === 0 && !nmm.ended && !nmm.silent ? found(event) : null;
      view.style.cursor = hit ? "grab" : "";
      return light(hit);
    }
    event.stopPropagation();
    return drag(event);
  }, true);
  // The same, as the pointer moves: browsers keep "pointermove" for the next picture.
  view.addEventListener("pointerrawupdate", (event) => gizmos.held && drag(event), true);

  function drag(event) {
    const { held } = gizmos;
    held.event = event;
    return held.ring ? turn(event, held) : shift(event, held);
  }
  // Where the camera goes along with the robot, what is held stays under the pointer.
  nmm.camera.moving = () => gizmos.held && drag(gizmos.held.event);

  function shift(event, held) {
    const at = under(event, held);
    if (at === null) return;
    at.sub(held.offset);
    const { gizmo } = held;
    const next = gizmo.place.clone();
    for (const axis of gizmo.axes) next[axis] = at[axis];
    gizmos.put(gizmo, next);
    gizmo.moved(next, gizmo.rotation);
  }
  function turn(event, held) {
    const now = angle(event, held);
    if (now === null) return;
    const by = now - held.angle;
    held.turn += held.side ? by : Math.atan2(Math.sin(by), Math.cos(by));
    held.angle = now;
    const { gizmo } = held;
    gizmos.put(gizmo, gizmo.place, new THREE.Quaternion().setFromAxisAngle(held.axis, held.turn).multiply(held.rotation));
    gizmo.moved(gizmo.place, gizmo.rotation);
  }

  function release() {
    if (gizmos.held === null) return;
    gizmos.held = null;
    nmm.viewer.controls.enabled = true;
    nmm.camera.freeze(false);
    light(null);
  }
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) view.addEventListener(end, release, true);

  // Nobody hears them any more.
  nmm.endings.push(() => {
    release();
    for (const { material } of parts()) material.color.copy(linear(DEAD));
  });
}
