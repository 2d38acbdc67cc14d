// The texts over the scene: each right above its point, moved aside or upwards where another one has the room. Names of
// robots come first, then distances, names of obstacles, of frames, the times of the robot's copies, and names of axes, which are
// at the axes' ends or nowhere.
"use strict";
{
  const THREE = MeshCat.THREE;
  const [ABOVE, GAP] = [3, 2]; // px
  const [ROWS, ASIDE] = [[0, 1, -1, 2, -2, 3, -3, 4, 5, 6], [0, -1, 1, -2, 2]];
  const STACK = [0, 1, 2, 3, 4, 5, 6, 7, -1, -2, -3];
  const COLORS = { light: [0.31, 0.38, 0.46], dark: [0.72, 0.78, 0.85] };
  const RANKS = ["robot", "distance", "obstacle", "frame", "time", "axis"];
  const AXIS = RANKS.indexOf("axis");
  const view = document.getElementById("view");
  // before: what else is to be done before each picture, with the eye.
  const texts = (nmm.texts = { all: [], before: [] });
  let cards = [];

  texts.add = (text, place) => {
    const sprite = nmm.scenery.label(text, () => COLORS[nmm.theme.dark ? "dark" : "light"], false, 0.75);
    sprite.position.copy(place);
    sprite.renderOrder = 900;
    // What is cut off by a robot before it says another time.
    sprite.material.depthTest = false;
    return texts.put(sprite, "time");
  };

  // rank: what it names; of two that want one place the earlier in RANKS has it.
  texts.put = (sprite, rank) => {
    texts.all.push({ sprite, rank: RANKS.indexOf(rank) });
    return sprite;
  };

  // What lies over the view stands still, but for another size of the window.
  texts.fit = () => {
    cards = ["heading", "tools", "bar", "sights"].map((id) => document.getElementById(id).getBoundingClientRect());
  };

  function shown(sprite) {
    for (let part = sprite; part; part = part.parent) if (!part.visible) return false;
    return true;
  }

  // The nearest free place: above the point, beside that, or rows higher or lower.
  function free(taken, { x, y, wide, high, rank }, width) {
    // Names of robots are stacked.
    for (const row of [STACK, ROWS, ROWS, ROWS, ROWS, [0]][rank]) {
      for (const aside of rank % AXIS ? ASIDE : [0]) {
        const above = rank === AXIS ? -0.5 * high : ABOVE;
        const [left, top] = [x - 0.5 * wide + aside * (wide + GAP + 1), y - above - high - row * (high + 1)];
        const box = { left, top, right: left + wide, bottom: top + high };
        const clear = (other) =>
          box.left > other.right + GAP || other.left > box.right + GAP || box.top > other.bottom || other.top > box.bottom;
        if (left >= 0 && box.right <= width && top >= 0 && taken.every(clear)) return box;
      }
    }
    return null;
  }

  // Before each picture: where they are depends on where one looks from.
  nmm.viewer.scene.onBeforeRender = (renderer, scene, camera) => {
    for (const act of texts.before) act(camera);
    const [width, height] = [view.clientWidth, view.clientHeight];
    const found = [];
    for (const { sprite, rank } of texts.all) {
      if (!shown(sprite)) continue;
      const { x, y, z } = new THREE.Vector3().setFromMatrixPosition(sprite.matrixWorld).project(camera);
      const { wide, high } = sprite.userData;
      if (z < 1) found.push({ sprite, rank, x: 0.5 * (1 + x) * width, y: 0.5 * (1 - y) * height, wide, high });
    }
    found.sort((a, b) => a.rank - b.rank || b.y - a.y || a.x - b.x);
    const taken = [...cards];
    for (const one of found) {
      const { sprite, rank, x, y, wide, high } = one;
      const room = free(taken, one, width);
      sprite.material.visible = room !== null || rank < 2;
      if (!sprite.material.visible) continue;
      const box = room || { left: x - 0.5 * wide, top: y - ABOVE - high, right: x + 0.5 * wide, bottom: y - ABOVE };
      sprite.center.set((x - box.left) / wide, (box.bottom - y) / high);
      taken.push(box);
    }
  };
}
