// Transparent copies of a robot at instants along its way: each one geometry, drawn in two passes.
"use strict";
{
  const THREE = MeshCat.THREE;
  const [SLATE, PALE] = [nmm.color([0.36, 0.44, 0.54]), nmm.color([0.78, 0.84, 0.9])];
  // Of a copy's room on the floor, what may be another's, and a robot's that is there now.
  const [SHARED, BESIDE] = [0.2, 0.4];
  const all = [];
  let copies = 0;

  // More triangles than this say no more of a transparent copy.
  const MOST = 4000;

  // Everything fixed to the joints' nodes as one geometry: corners in their joints' frames.
  function merged(joints) {
    const [places, numbers, colors, index] = [[], [], [], []];
    const v = new THREE.Vector3();
    joints.forEach((joint, number) => {
      const node = nmm.node(joint.path);
      const inverse = node.matrixWorld.clone().invert();
      for (const child of node.children) {
        if (!child.name.startsWith("visual ")) continue;
        child.traverse(({ isMesh, geometry, material, matrixWorld }) => {
          if (!isMesh) return;
          const placed = inverse.clone().multiply(matrixWorld);
          const { position } = geometry.attributes;
          const start = numbers.length;
          for (let i = 0; i < position.count; i++) {
            v.fromBufferAttribute(position, i).applyMatrix4(placed);
            places.push(v.x, v.y, v.z);
            numbers.push(number);
            colors.push(material.color);
          }
          if (geometry.index === null) for (let i = 0; i < position.count; i++) index.push(start + i);
          else for (const i of geometry.index.array) index.push(start + i);
        });
      }
    });
    let shape = { places, numbers, colors, index };
    for (let cell = 0.004 * spread(places); shape.index.length > 3 * MOST; cell *= 1.5) shape = coarser(shape, cell);
    const color = new Float32Array(3 * shape.numbers.length);
    const themed = () => {
      // A little slate, so that white copies can be told from the floor, and black ones from a dark page.
      shape.colors.forEach((own, i) =>
        own.clone().lerp(nmm.theme.dark ? PALE : SLATE, nmm.theme.dark ? 0.5 : 0.3).toArray(color, 3 * i));
      attribute.needsUpdate = true;
    };
    const attribute = new THREE.BufferAttribute(color, 3);
    themed();
    nmm.theme.listeners.push(themed);
    return { ...shape, index: new THREE.BufferAttribute(new Uint32Array(shape.index), 1), color: attribute };
  }

  // The longest side of the box around points.
  function spread(places) {
    let most = 0;
    for (const axis of [0, 1, 2]) {
      let [low, high] = [Infinity, -Infinity];
      for (let i = axis; i < places.length; i += 3) [low, high] = [Math.min(low, places[i]), Math.max(high, places[i])];
      most = Math.max(most, high - low);
    }
    return most;
  }

  // The corners of a joint in one cube of a grid become one, and triangles without an area go.
  function coarser({ places, numbers, colors, index }, cell) {
    const found = new Map();
    const made = { places: [], numbers: [], colors: [], index: [] };
    const named = numbers.map((number, i) => {
      const [x, y, z] = [0, 1, 2].map((axis) => Math.round(places[3 * i + axis] / cell) + 2 ** 11);
      const key = ((number * 2 ** 12 + x) * 2 ** 12 + y) * 2 ** 12 + z;
      if (!found.has(key)) {
        found.set(key, made.numbers.length);
        made.places.push(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
        made.numbers.push(number);
        made.colors.push(colors[i]);
      }
      return found.get(key);
    });
    for (let i = 0; i < index.length; i += 3) {
      const [a, b, c] = [named[index[i]], named[index[i + 1]], named[index[i + 2]]];
      if (a !== b && b !== c && c !== a) made.index.push(a, b, c);
    }
    return made;
  }

  // The robot with its joints in the k-th of their poses.
  function posed({ places, numbers, index, color }, joints, k) {
    const position = new Float32Array(places.length);
    const at = joints.map(({ poses }) =>
      new THREE.Matrix4().compose(
        new THREE.Vector3().fromArray(poses, 7 * k), new THREE.Quaternion().fromArray(poses, 7 * k + 3), new THREE.Vector3(1, 1, 1),
      ));
    const v = new THREE.Vector3();
    numbers.forEach((number, i) => v.fromArray(places, 3 * i).applyMatrix4(at[number]).toArray(position, 3 * i));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("color", color);
    geometry.setIndex(index);
    geometry.computeVertexNormals();
    geometry.computeBoundingBox();
    return geometry;
  }

  // The highest point of a copy.
  function top({ attributes: { position } }) {
    let highest = 0;
    for (let i = 1; i < position.count; i++) if (position.getZ(i) > position.getZ(highest)) highest = i;
    return position.count ? new THREE.Vector3().fromBufferAttribute(position, highest) : null;
  }

  nmm.hooks.believed = ({ paths, color }) =>
    nmm.legend({ kind: "box", color, text: "where it is believed to be", path: paths });

  // Whether of two boxes, seen from above, one takes more than a share of the other's room.
  function overlap(one, other, share) {
    const [a, b] = [one.getSize(new THREE.Vector3()), other.getSize(new THREE.Vector3())];
    const common = one.clone().intersect(other).getSize(new THREE.Vector3());
    return common.x * common.y > share * Math.min(a.x * a.y, b.x * b.y);
  }

  // Copies are shown where no robot is now; of those that overlap, the first one.
  nmm.clearGhosts = (rooms) => {
    const shown = [];
    for (const { group, box, node } of all) {
      const run = nmm.runs.find((one) => one.path === node);
      if (run && run.hidden) continue;
      const now = box.clone().translate(nmm.node(node).position);
      const free = !shown.some((one) => overlap(one, now, SHARED));
      if (free) shown.push(now);
      group.visible = free && !rooms.some((room) => overlap(room, now, BESIDE));
    }
  };

  nmm.hooks.ghosts = ({ path, joints, texts, clear: only = false }) => {
    nmm.viewer.scene.updateMatrixWorld(true);
    const shape = merged(joints);
    const count = joints[0].poses.length / 7;
    for (let k = 0; k < count; k++) {
      copies += 1;
      // Robots on one floor have many faces in one plane: what is solid comes before every copy, and of two
      // copies the older one.
      const back = 4 + copies;
      const offset = {
        // As three.js blends what is transparent: the picture itself stays opaque.
        side: THREE.DoubleSide, blending: THREE.CustomBlending, blendSrcAlpha: THREE.OneFactor,
        blendDstAlpha: THREE.OneMinusSrcAlphaFactor, polygonOffset: true, polygonOffsetFactor: back, polygonOffsetUnits: 8 * back,
      };
      // First depth alone, then colour where it is nearest: a copy hides its own inside.
      const depth = new THREE.MeshBasicMaterial({ ...offset, transparent: true, colorWrite: false });
      const paint = new THREE.MeshLambertMaterial({
        ...offset, transparent: true, vertexColors: true, opacity: 0.18 + (0.16 * (k + 1)) / count,
        // Each copy colours a pixel once, however many of its faces lie in one plane.
        stencilWrite: true, stencilRef: 1 + (copies % 255),
        stencilFunc: THREE.NotEqualStencilFunc, stencilZPass: THREE.ReplaceStencilOp,
      });
      const group = new THREE.Group();
      const geometry = posed(shape, joints, k);
      const { opacity } = paint;
      const themed = () => (paint.opacity = nmm.theme.dark ? 1.6 * opacity : opacity);
      themed();
      nmm.theme.listeners.push(themed);
      [depth, paint].forEach((material, pass) => {
        const mesh = new THREE.Mesh(geometry, material);
        mesh.renderOrder = 2 * k + pass + 1;
        // What is transparent comes last, but three.js would draw its back and its front by themselves.
        mesh.onBeforeRender = () => (material.transparent = false);
        mesh.onAfterRender = () => (material.transparent = true);
        group.add(mesh);
      });
      nmm.viewer.set_object(nmm.split(`${path}/${k}/robot`), group);
      if (only) all.push({ group: nmm.node(`${path}/${k}`), box: geometry.boundingBox, node: path.replace(/\/ghosts$/, "") });
      const highest = top(geometry);
      if (highest && texts[k]) nmm.viewer.set_object(nmm.split(`${path}/${k}/text`), nmm.texts.add(texts[k], highest));
    }
    nmm.ghosts = (nmm.ghosts || []).concat(nmm.node(path));
  };
}
