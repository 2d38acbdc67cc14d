// Transparent copies of a robot at instants along its way: each one geometry, drawn in two passes.
"use strict";
{
  const THREE = MeshCat.THREE;
  const SLATE = nmm.color([0.36, 0.44, 0.54]);
  let copies = 0;

  // Everything fixed to the joints' nodes as one geometry: which triangles, in which colours, and each part
  // with its joint's number and its place in that joint's frame.
  function merged(joints) {
    const parts = [];
    joints.forEach((joint, number) => {
      const node = nmm.node(joint.path);
      const inverse = node.matrixWorld.clone().invert();
      for (const child of node.children) {
        if (!child.name.startsWith("visual ")) continue;
        child.traverse(({ isMesh, geometry, material, matrixWorld }) => {
          if (isMesh) parts.push({ number, geometry, material, matrix: inverse.clone().multiply(matrixWorld) });
        });
      }
    });
    const count = parts.reduce((sum, { geometry }) => sum + geometry.attributes.position.count, 0);
    const color = new Float32Array(3 * count);
    const index = [];
    let start = 0;
    for (const { geometry, material } of parts) {
      const many = geometry.attributes.position.count;
      if (geometry.index === null) for (let i = 0; i < many; i++) index.push(start + i);
      else for (const i of geometry.index.array) index.push(start + i);
      // A little slate, so that white copies can be told from the floor.
      const shade = material.color.clone().lerp(SLATE, 0.3);
      for (let i = start; i < start + many; i++) shade.toArray(color, 3 * i);
      start += many;
    }
    return { parts, count, index: new THREE.BufferAttribute(new Uint32Array(index), 1), color: new THREE.BufferAttribute(color, 3) };
  }

  // The robot with its joints in the k-th of their poses.
  function posed({ parts, count, index, color }, joints, k) {
    const [position, normal] = [0, 1].map(() => new Float32Array(3 * count));
    const places = joints.map(({ poses }) =>
      new THREE.Matrix4().compose(
        new THREE.Vector3().fromArray(poses, 7 * k), new THREE.Quaternion().fromArray(poses, 7 * k + 3), new THREE.Vector3(1, 1, 1),
      ));
    const v = new THREE.Vector3();
    let at = 0;
    for (const { number, geometry, matrix } of parts) {
      const placed = places[number].clone().multiply(matrix);
      const turned = new THREE.Matrix3().getNormalMatrix(placed);
      for (let i = 0; i < geometry.attributes.position.count; i++, at += 3) {
        v.fromBufferAttribute(geometry.attributes.position, i).applyMatrix4(placed).toArray(position, at);
        v.fromBufferAttribute(geometry.attributes.normal, i).applyMatrix3(turned).normalize().toArray(normal, at);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    geometry.setAttribute("color", color);
    geometry.setIndex(index);
    return geometry;
  }

  // The highest point of a copy.
  function top({ attributes: { position } }) {
    let highest = 0;
    for (let i = 1; i < position.count; i++) if (position.getZ(i) > position.getZ(highest)) highest = i;
    return position.count ? new THREE.Vector3().fromBufferAttribute(position, highest) : null;
  }

  nmm.hooks.believed = ({ paths, color }) =>
    nmm.legend({ kind: "box", color, text: "where odometry has it", path: paths });

  nmm.hooks.ghosts = ({ path, joints, texts }) => {
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
        ...offset, transparent: true, vertexColors: true, opacity: 0.16 + (0.16 * (k + 1)) / count,
        // Each copy colours a pixel once, however many of its faces lie in one plane.
        stencilWrite: true, stencilRef: 1 + (copies % 255),
        stencilFunc: THREE.NotEqualStencilFunc, stencilZPass: THREE.ReplaceStencilOp,
      });
      const group = new THREE.Group();
      const geometry = posed(shape, joints, k);
      [depth, paint].forEach((material, pass) => {
        const mesh = new THREE.Mesh(geometry, material);
        mesh.renderOrder = 2 * k + pass + 1;
        // What is transparent comes last, but three.js would draw its back and its front by themselves.
        mesh.onBeforeRender = () => (material.transparent = false);
        mesh.onAfterRender = () => (material.transparent = true);
        group.add(mesh);
      });
      nmm.viewer.set_object(nmm.split(`${path}/${k}/robot`), group);
      const highest = top(geometry);
      if (highest && texts[k]) nmm.viewer.set_object(nmm.split(`${path}/${k}/text`), nmm.texts.add(texts[k], highest));
    }
    nmm.ghosts = (nmm.ghosts || []).concat(nmm.node(path));
  };
}
