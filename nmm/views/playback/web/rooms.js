// The room that each robot takes now: its name is above it, and copies keep out of its way.
"use strict";
{
  const THREE = MeshCat.THREE;
  const LEVEL = new THREE.Matrix4().makeRotationX(Math.PI / 2); // three.js has y upwards
  const [tags, parts] = [[], new Map()];

  nmm.scenery.tag = (path, text, rgb) => {
    const sprite = nmm.texts.put(nmm.scenery.label(text, rgb, true), "robot");
    nmm.node(path).add(sprite);
    tags.push({ path, sprite });
  };

  function meshes(path) {
    const found = [];
    nmm.node(`${path}/robot`).traverse((node) => {
      if (node.name.startsWith("visual ")) node.traverse((part) => part.isMesh && found.push(part));
    });
    for (const { geometry } of found) geometry.computeBoundingBox();
    return found;
  }

  // The box, along the world's axes, around everything that is drawn of a motion's robot.
  function room({ path }) {
    if (!parts.has(path)) parts.set(path, meshes(path));
    const box = new THREE.Box3();
    for (const { geometry, matrixWorld } of parts.get(path)) box.union(geometry.boundingBox.clone().applyMatrix4(matrixWorld));
    return box.applyMatrix4(LEVEL);
  }

  nmm.texts.before.push(() => {
    if (!nmm.stage || nmm.stage.live) return;
    const rooms = new Map(nmm.motions.map((motion) => [motion.path, room(motion)]));
    for (const { path, sprite } of tags) {
      rooms.get(path).getCenter(sprite.position).setZ(rooms.get(path).max.z).sub(nmm.node(path).position);
      sprite.updateMatrixWorld();
    }
    nmm.clearGhosts(nmm.motions.filter(({ path }) => nmm.node(path).visible).map(({ path }) => rooms.get(path)));
  });
}
