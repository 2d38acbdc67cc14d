// A slider for each coordinate: the page moves the joints itself, from their placements and axes.
"use strict";
{
  const THREE = MeshCat.THREE;
  const DEGREES = 180 / Math.PI;
  // beside: what else the camera holds, as functions that return points.
  const joints = (nmm.joints = { coordinates: [], listeners: [], beside: [] });

  nmm.panel = nmm.element(document.body, "aside", { id: "panel", class: "card", "aria-label": "Robot" });

  const told = ({ unit, value }) =>
    unit === "rad"
      ? `${nmm.fixed(value * DEGREES, 1)}° · ${nmm.fixed(value, 3)} rad`
      : `${nmm.fixed(value, 3)} m`;

  // The joint's frame in its parent's: its placement, then a turn about `angular` and a way along `linear`.
  function place(coordinate) {
    const { path, position, quaternion, linear, angular, value } = coordinate;
    const node = nmm.node(path);
    const turned = new THREE.Quaternion().fromArray(quaternion);
    const way = new THREE.Vector3().fromArray(linear).multiplyScalar(value).applyQuaternion(turned);
    node.position.fromArray(position).add(way);
    const axis = new THREE.Vector3().fromArray(angular);
    const angle = axis.length() * value;
    if (angle !== 0) turned.multiply(new THREE.Quaternion().setFromAxisAngle(axis.normalize(), angle));
    node.quaternion.copy(turned);
  }

  function show(coordinate) {
    coordinate.slider.value = coordinate.value;
    coordinate.slider.setAttribute("aria-valuetext", told(coordinate));
    coordinate.output.textContent = told(coordinate);
  }

  function moved() {
    nmm.viewer.scene.updateMatrixWorld();
    nmm.camera.update();
    nmm.camera.refit();
    const root = new THREE.Vector3().setFromMatrixPosition(nmm.node(nmm.motions[0].root).matrixWorld);
    nmm.scenery.center(root.x, -root.z);
    for (const listener of joints.listeners) listener();
    nmm.viewer.set_dirty();
  }

  // Values by name, m and rad; what follows another coordinate has no slider and goes with that one.
  joints.set = (values) => {
    for (const coordinate of joints.coordinates) {
      if (coordinate.follows || values[coordinate.name] === undefined) continue;
      coordinate.value = values[coordinate.name];
      place(coordinate);
      show(coordinate);
      for (const follower of joints.coordinates) {
        if (follower.follows?.leader !== coordinate.name) continue;
        follower.value = follower.follows.multiplier * coordinate.value + follower.follows.offset;
        place(follower);
      }
    }
    moved();
  };
  joints.reset = () => {
    joints.set(Object.fromEntries(joints.coordinates.map(({ name, start }) => [name, start])));
  };

  nmm.hooks.joints = ({ coordinates }) => {
    const head = nmm.element(nmm.panel, "div", { class: "head" });
    nmm.element(head, "h2", {}, "Coordinates");
    const reset = nmm.element(head, "button", { id: "rest", title: "Every slider back where it was" }, "Reset");
    reset.addEventListener("click", joints.reset);
    let group = null;
    for (const coordinate of coordinates) {
      const { name, unit, of, lower, upper, value, follows } = coordinate;
      coordinate.start = value;
      if (follows) continue;
      if (of !== group) nmm.element(nmm.panel, "h3", {}, (group = of));
      const row = nmm.element(nmm.panel, "label", { class: "coordinate" });
      nmm.element(row, "span", { title: name }, name);
      coordinate.output = nmm.element(row, "output");
      coordinate.slider = nmm.element(row, "input", {
        type: "range", min: lower, max: upper, step: "any", "data-name": name, "aria-label": name,
        title: `${name}: from ${nmm.fixed(lower, 3)} to ${nmm.fixed(upper, 3)} ${unit}`,
      });
      coordinate.slider.addEventListener("input", () => {
        joints.set({ [name]: Number(coordinate.slider.value) });
      });
      show(coordinate);
    }
    joints.coordinates = coordinates;
  };

  // The corners of the boxes around a robot's shapes, in the world.
  function corners() {
    const found = [];
    nmm.viewer.scene.updateMatrixWorld();
    nmm.node(nmm.motions[0].path).traverse((visual) => {
      if (!visual.name.startsWith("visual ")) return;
      visual.traverse((part) => {
        if (!part.isMesh) return;
        part.geometry.computeBoundingBox();
        const { min, max } = part.geometry.boundingBox;
        for (let k = 0; k < 8; k++) {
          const corner = new THREE.Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z);
          found.push(corner.applyMatrix4(part.matrixWorld));
        }
      });
    });
    // A robot without shapes is as large as its skeleton.
    const paths = joints.coordinates.map(({ path }) => path);
    if (found.length === 0) {
      for (const path of paths) found.push(new THREE.Vector3().setFromMatrixPosition(nmm.node(path).matrixWorld));
    }
    return [...found, ...joints.beside.flatMap((points) => points())];
  }

  // The camera holds the robot as it stands now and what stands beside it (m, world), with some room for names,
  // not all that it could reach.
  nmm.hooks.hold = ({ beside }) => {
    nmm.camera.held = () => {
      const held = [...corners(), ...beside.map(([x, y, z]) => new THREE.Vector3(x, z, -y))];
      const box = new THREE.Box3().setFromPoints(held);
      const middle = box.getCenter(new THREE.Vector3());
      const room = 0.02 + 0.04 * box.getSize(new THREE.Vector3()).length();
      for (const point of held) point.addScaledVector(point.clone().sub(middle).normalize(), room);
      return held;
    };
  };
}
