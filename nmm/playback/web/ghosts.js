// Transparent copies of a robot at instants along its way: one geometry a joint, shared by all the copies.
"use strict";
{
  const THREE = MeshCat.THREE;
  const SLATE = nmm.color([0.36, 0.44, 0.54]);
  let copies = 0;

  // Everything fixed to a joint's node as one geometry in that node's frame, with the parts' colours.
  function merged(joint) {
    const inverse = joint.matrixWorld.clone().invert();
    const parts = [];
    for (const child of joint.children) {
      if (!child.name.startsWith("visual ")) continue;
      child.traverse((part) => part.isMesh && parts.push(part));
    }
    const pieces = parts.map((part) => {
      const piece = part.geometry.index === null ? part.geometry.clone() : part.geometry.toNonIndexed();
      return piece.applyMatrix4(inverse.clone().multiply(part.matrixWorld));
    });
    const count = pieces.reduce((sum, piece) => sum + piece.attributes.position.count, 0);
    if (count === 0) return null;
    const [position, normal, color] = [0, 1, 2].map(() => new Float32Array(3 * count));
    let start = 0;
    pieces.forEach((piece, i) => {
      position.set(piece.attributes.position.array, start);
      normal.set(piece.attributes.normal.array, start);
      const end = start + 3 * piece.attributes.position.count;
      // A little slate, so that white copies can be told from the floor.
      const shade = parts[i].material.color.clone().lerp(SLATE, 0.3);
      for (; start < end; start += 3) shade.toArray(color, start);
      piece.dispose();
    });
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(color, 3));
    return geometry;
  }

  nmm.hooks.ghosts = ({ path, joints, root, texts, height }) => {
    nmm.viewer.scene.updateMatrixWorld(true);
    const shapes = joints.map((joint) => merged(nmm.node(joint.path)));
    const count = joints[0].poses.length / 7;
    for (let k = 0; k < count; k++) {
      copies += 1;
      // Robots on one floor have many faces in one plane: what is solid comes before every copy, and of two
      // copies the older one.
      const back = 4 + copies;
      const offset = {
        side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: back, polygonOffsetUnits: 8 * back,
      };
      // First depth alone, then colour where it is nearest: a copy hides its own inside.
      const depth = new THREE.MeshBasicMaterial({ ...offset, transparent: true, colorWrite: false });
      const paint = new THREE.MeshLambertMaterial({
        ...offset, transparent: true, vertexColors: true, opacity: 0.16 + (0.16 * (k + 1)) / count,
        // Each copy colours a pixel once, however many of its faces lie in one plane.
        stencilWrite: true, stencilRef: 1 + (copies % 255),
        stencilFunc: THREE.NotEqualStencilFunc, stencilZPass: THREE.ReplaceStencilOp,
      });
      joints.forEach((joint, j) => {
        if (shapes[j] === null) return;
        const group = new THREE.Group();
        [depth, paint].forEach((material, pass) => {
          const mesh = new THREE.Mesh(shapes[j], material);
          mesh.renderOrder = 2 * k + pass + 1;
          group.add(mesh);
        });
        nmm.viewer.set_object(nmm.split(`${path}/${k}/${j}`), group);
        const node = nmm.node(`${path}/${k}/${j}`);
        node.position.fromArray(joint.poses, 7 * k);
        node.quaternion.fromArray(joint.poses, 7 * k + 3);
        if (joint.path !== root) return;
        const label = nmm.scenery.label(texts[k], [0.4, 0.47, 0.56], false, 0.75);
        label.center.set(0.5, 0.5 - 1.05 * nmm.motions.length); // those of robots at one place are stacked
        label.position.set(joint.poses[7 * k], joint.poses[7 * k + 1], joint.poses[7 * k + 2] + height);
        nmm.viewer.set_object(nmm.split(`${path}/${k}/text`), label);
      });
    }
    nmm.ghosts = (nmm.ghosts || []).concat(nmm.node(path));
  };
}
