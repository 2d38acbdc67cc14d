// Where to look from: at the whole motion, or along with the robots.
"use strict";
{
  const THREE = MeshCat.THREE;
  // Degrees; from above all rays are as good as parallel, as in a plan.
  const [FIELD, PARALLEL] = [36, 1];
  const CATCH = 600; // ms
  const [FREE, EDGE] = [0.3, 0.6]; // of half the picture: where robots are kept that a hand leads, and from where on it does
  const NARROW = 190; // px: a heading that is too narrow to be read
  // From the target towards the camera, in the world's axes. From right above, up would be nowhere.
  const TOWARDS = {
    iso: new THREE.Vector3(0.42, -0.9, 0.82),
    top: new THREE.Vector3(0, -0.001, 1),
    front: new THREE.Vector3(0, -1, 0.06),
  };
  const camera = (nmm.camera = { following: false, frozen: false, moved: false, first: null, held: null, also: () => [], moving: () => {}, from: "iso" });
  const chooser = document.getElementById("from");
  // Not the window: a page may have something beside the view.
  const view = document.getElementById("view");
  let extent = 1;
  const tangent = (degrees) => Math.tan((degrees * Math.PI) / 360);
  // How many times farther away the eye is for the same picture than with FIELD.
  const farther = () => tangent(FIELD) / tangent(eye.fov);

  function lens() {
    eye.fov = camera.from === "top" && !camera.held ? PARALLEL : FIELD;
    nmm.viewer.controls.minDistance = 0.05 * extent * farther();
    nmm.viewer.controls.maxDistance = 30 * extent * farther();
    nmm.scenery.fit();
  }

  // What is nearer or farther than this is not drawn: little is lost of the depth's precision.
  function planes() {
    const away = eye.position.distanceTo(nmm.viewer.controls.target);
    eye.near = eye.fov === FIELD ? 0.01 * extent : Math.max(0.01 * extent, away - 20 * extent);
    eye.far = away + 80 * extent;
    eye.updateProjectionMatrix();
  }
  camera.unit = () => 2 * tangent(eye ? eye.fov : FIELD);

  const upright = (v) => new THREE.Vector3(v.x, v.z, -v.y);
  let eye, points, tags, last, thawed, leads;
  const vectors = (numbers = []) =>
    Array.from({ length: numbers.length / 3 }, (_, i) => upright(new THREE.Vector3().fromArray(numbers, 3 * i)));

  camera.build = (held, size, named, wall) => {
    tags = vectors(named);
    points = [...vectors(held), ...tags];
    if (wall) TOWARDS.wall = new THREE.Vector3(wall[0], wall[1], 0.06);
    else chooser.querySelector("[value=wall]").remove();
    eye = new THREE.PerspectiveCamera(FIELD, view.clientWidth / view.clientHeight, 0.01 * size, 80 * size);
    nmm.viewer.set_camera(eye);
    nmm.viewer.set_object(["Cameras", "default", "rotated"], eye);
    const controls = nmm.viewer.controls;
    controls.maxPolarAngle = 0.49 * Math.PI;
    extent = size;
    controls.addEventListener("change", planes);
    controls.addEventListener("start", () => Object.assign(camera, { moved: true, first: null }));
    controls.addEventListener("end", nmm.address.changed);
    camera.reset();
  };

  // Pixels at the upper, lower, left and right edge that are kept free: several ways to have nothing behind
  // the heading and the tools.
  function covered(named) {
    const bar = boxOf("bar");
    const [head, tools] = cards();
    const seen = boxOf("sights"); // what cameras see: at the left edge above the bar, or at the upper right
    const narrow = tools.top > 0.5 * view.clientHeight; // the tools are below
    const lowest = Math.min(bar.height ? bar.top : Infinity, narrow && tools.height ? tools.top : Infinity, view.clientHeight);
    const bottom = view.clientHeight - lowest + (bar.height || narrow ? 10 : view.clientHeight < window.innerHeight ? 56 : 24);
    if (narrow && seen.width) return [[seen.bottom + 4, bottom, 0, 0], [head.bottom + 4, bottom, 0, view.clientWidth - seen.left + 4]];
    if (narrow) return [[head.bottom + 4, bottom, 0, 0]];
    if (camera.held) return [[Math.max(head.bottom, tools.bottom) + 4, bottom, 0, 0]];
    const [aside, above] = room(named.length > 0).map((pixels) => pixels + 4);
    const tops = [24, tools.bottom + above, Math.max(head.bottom, tools.bottom) + above];
    const lefts = [0, head.right + aside];
    const rights = [0, view.clientWidth - tools.left + aside];
    const ways = (left, below) => tops.flatMap((top) => rights.map((right) => [top, below, left, right]));
    if (!seen.width) return lefts.flatMap((left) => ways(left, bottom));
    const [free, lifted] = [Math.max(seen.right + aside, lefts[1]), view.clientHeight - seen.top + 14];
    return [...ways(0, bottom), ...ways(free, bottom), ...lefts.flatMap((left) => ways(left, lifted))];
  }

  // Pixels beside and above a point that what stands there takes: a ball, or the tags one over another.
  const room = (tagged) => (tagged ? [44, 14 + 26 * nmm.motions.length] : [14, 14]);
  const boxOf = (id) => document.getElementById(id).getBoundingClientRect();
  const cards = () => ["heading", "tools"].map(boxOf);

  // The heading is beside the tools where there is room for it, else below them.
  function arrange() {
    const { width, top } = boxOf("tools");
    const above = top < 60;
    document.body.style.setProperty("--tools", `${above ? width : 0}px`);
    document.body.classList.toggle("stacked", above && view.clientWidth - width - 42 < NARROW);
  }

  // Whether something that is held is behind a card.
  function hidden(held, named) {
    eye.updateMatrixWorld();
    eye.updateProjectionMatrix();
    const [width, height] = [view.clientWidth, view.clientHeight];
    const shown = [...cards(), boxOf("sights")].filter((card) => card.width);
    const behind = (p, aside, above) => {
      const { x, y } = p.clone().project(eye);
      const [px, py] = [0.5 * (1 + x) * width, 0.5 * (1 - y) * height];
      return shown.some(
        (card) => px > card.left - aside && px < card.right + aside && py > card.top && py - above < card.bottom,
      );
    };
    return held.some((p) => behind(p, ...room(false))) || named.some((p) => behind(p, ...room(true)));
  }

  // Where, along one axis of the picture, what is held leaves the same room on both sides.
  function centred(along, depths, z, [low, high], more, less) {
    for (let k = 0; k < 40; k++) {
      const middle = 0.5 * (low + high);
      let [most, least] = [-Infinity, Infinity];
      for (let i = 0; i < along.length; i++) {
        const slope = (along[i] - middle) / (depths[i] - z);
        if (slope > most) most = slope;
        if (slope < least) least = slope;
      }
      if (most / more + least / less > 0) low = middle;
      else high = middle;
    }
    return 0.5 * (low + high);
  }

  // The nearest place for an eye that looks along -towards and has all that is held in the free part of the
  // window, with nothing behind a card.
  function look(held, towards, named) {
    lens();
    eye.near = 0.01 * extent;
    const forward = towards.clone().negate().normalize();
    const right = new THREE.Vector3().crossVectors(forward, new THREE.Vector3(0, 1, 0)).normalize();
    const up = new THREE.Vector3().crossVectors(right, forward);
    const [xs, ys, zs] = [right, up, forward].map((axis) => held.map((p) => axis.dot(p)));
    const ways = covered(named).map((free) => aim(xs, ys, zs, free));
    ways.sort((one, other) => other.z - one.z);
    for (const { z, across, upwards } of ways) {
      const [x, y] = [centred(xs, zs, z, ...across), centred(ys, zs, z, ...upwards)];
      eye.position.set(0, 0, 0).addScaledVector(right, x).addScaledVector(up, y).addScaledVector(forward, z);
      eye.lookAt(eye.position.clone().add(forward));
      if (ways.length === 1 || !hidden(held, named)) break;
    }
    const depth = zs.reduce((sum, z) => sum + z, 0) / zs.length - forward.dot(eye.position);
    nmm.viewer.controls.target.copy(eye.position).addScaledVector(forward, depth);
    nmm.viewer.controls.update();
    planes();
  }

  // How far forward the eye may be, and between what, aside and upwards, where so many pixels are not free.
  function aim(xs, ys, zs, [top, bottom, left, right]) {
    const [width, height] = [view.clientWidth, view.clientHeight];
    const half = tangent(eye.fov);
    const share = (length, taken) => Math.max(0.1, 1 - (2 * taken) / length);
    const [west, east] = [left, right].map((side) => ((half * width) / height) * Math.min(0.94, share(width, side)));
    const free = [top, bottom].map((end) => share(height, end));
    // Cards that leave less than a third of a low window have some of it behind them: it would be too far to see.
    const behind = Math.max(0, 1 / 3 - 0.5 * (free[0] + free[1]));
    const [above, below] = free.map((end) => half * (end + behind));
    let [x0, x1, y0, y1, near] = [-Infinity, Infinity, -Infinity, Infinity, Infinity];
    for (let i = 0; i < zs.length; i++) {
      x0 = Math.max(x0, xs[i] - east * zs[i]);
      x1 = Math.min(x1, xs[i] + west * zs[i]);
      y0 = Math.max(y0, ys[i] - above * zs[i]);
      y1 = Math.min(y1, ys[i] + below * zs[i]);
      near = Math.min(near, zs[i]);
    }
    const z = Math.min((x1 - x0) / (east + west), (y1 - y0) / (above + below), near - 2 * eye.near);
    return {
      z,
      across: [[x0 + east * z, x1 - west * z], east, west],
      upwards: [[y0 + above * z, y1 - below * z], above, below],
    };
  }

  // The middle of the robots that are shown, in the camera's axes.
  function middle() {
    nmm.viewer.scene.updateMatrixWorld();
    const shown = nmm.motions.filter((motion) => nmm.node(motion.path).visible);
    const sum = new THREE.Vector3();
    for (const motion of shown.length ? shown : nmm.motions) {
      sum.add(new THREE.Vector3().setFromMatrixPosition(nmm.node(motion.root).matrixWorld));
    }
    sum.divideScalar(shown.length || nmm.motions.length);
    return sum.setY(0.5 * (nmm.stage.follow.low + nmm.stage.follow.high));
  }

  // What stands there once for each of several robots that are set apart: ways in three.js's axes.
  const apart = (held) => (nmm.apart.ways.length ? nmm.apart.ways.flatMap((way) => held.map((p) => p.clone().add(way))) : held);

  camera.reset = () => {
    if (camera.frozen) return undefined;
    arrange();
    Object.assign(camera, { moved: false, first: null });
    thawed = undefined;
    const towards = upright(TOWARDS[camera.from]);
    const also = camera.also(); // what a page holds besides
    if (!camera.following && !camera.held) return look([...apart(points), ...also], towards, apart(tags));
    last = middle();
    // A page may say itself what there is to hold, as points in three.js's axes.
    if (camera.held) return look(camera.held(), towards, []);
    const { radius, low, high } = nmm.stage.follow;
    const half = 0.5 * (high - low);
    const around = [];
    for (let k = 0; k < 24; k++) {
      const angle = (Math.PI * k) / 12;
      const [x, z] = [radius * Math.cos(angle), radius * Math.sin(angle)];
      for (const y of [-half, half]) {
        around.push(last.clone().add(new THREE.Vector3(x, y, z)));
      }
    }
    return look([...around, ...also], towards, []);
  };

  // From one of the sides above; another name is none.
  camera.look = (from) => {
    if (!Object.hasOwn(TOWARDS, from)) return;
    camera.from = chooser.value = from;
    camera.reset();
    nmm.viewer.set_dirty();
    nmm.address.changed();
  };
  camera.next = () => {
    const sides = Object.keys(TOWARDS);
    camera.look(sides[(sides.indexOf(camera.from) + 1) % sides.length]);
  };
  chooser.addEventListener("change", () => camera.look(chooser.value));

  // Where somebody has put it: the eye and what it looks at, in the world's axes; the eye as with FIELD.
  camera.place = () => {
    const { target } = nmm.viewer.controls;
    const from = eye.position.clone().sub(target).divideScalar(farther()).add(target);
    return [from, target].flatMap(({ x, y, z }) => [x, -z, y]);
  };
  camera.put = (numbers) => {
    const [from, at] = vectors(numbers);
    Object.assign(camera, { moved: true, first: null });
    lens();
    eye.position.copy(from).sub(at).multiplyScalar(farther()).add(at);
    nmm.viewer.controls.target.copy(at);
    nmm.viewer.controls.update();
    planes();
    nmm.viewer.set_dirty();
  };

  // A scenario's first view: as it was chosen for a wide window; in a narrow one, in what heading and tools leave free.
  camera.open = (numbers) => {
    arrange();
    camera.put(numbers);
    camera.first = numbers;
    const [[top, bottom], another] = covered([]);
    if (another) return;
    const { target, update } = nmm.viewer.controls;
    const height = view.clientHeight;
    const away = eye.position.clone().sub(target).multiplyScalar(height / Math.max(height - top - bottom, 0.3 * height));
    const pixel = (camera.unit() * away.length()) / height;
    target.addScaledVector(new THREE.Vector3(0, 1, 0).applyQuaternion(eye.quaternion), 0.5 * (top - bottom) * pixel);
    eye.position.copy(target).add(away);
    update();
    planes();
  };

  // In a window of another size, where nobody has moved the eye.
  camera.fit = () => {
    if (camera.first) camera.open(camera.first);
    else if (!camera.moved) camera.reset();
  };

  // What is held may have left the picture since: then all of it is fitted again, if nobody has moved the eye.
  camera.refit = () => {
    if (camera.moved || !camera.held) return;
    eye.updateMatrixWorld();
    const out = ({ x, y }) => Math.abs(x) > 1 || Math.abs(y) > 1;
    if (camera.held().some((p) => out(p.project(eye)))) camera.reset();
  };

  camera.follow = (on) => {
    camera.following = on;
    camera.reset();
  };

  // Where the middle of the robots is in the picture: across and upwards, -1 to 1, and how deep.
  function seen() {
    eye.updateMatrixWorld();
    return middle().project(eye);
  }

  // Under a hand that holds something the picture stands, but where the hand leads the robots: where it is near an edge of
  // the picture, as `hand` says, and they come after it, the camera goes along with them. Let go of, it catches up.
  camera.freeze = (on, hand = null) => {
    camera.frozen = on;
    thawed = { at: performance.now(), left: CATCH };
    leads = on && camera.following ? hand : null;
  };
  // Whether the camera has moved.
  function goAlong() {
    const [at, hand] = [seen(), leads()];
    const kept = at.clone();
    for (const axis of ["x", "y"]) {
      const side = Math.sign(hand[axis]);
      if (side * hand[axis] > EDGE && side * at[axis] > FREE) kept[axis] = side * FREE;
    }
    if (kept.equals(at)) return false;
    const way = middle().sub(kept.unproject(eye));
    eye.position.add(way);
    nmm.viewer.controls.target.add(way);
    last.add(way);
    eye.updateMatrixWorld();
    return true;
  }

  camera.update = () => {
    if (!camera.following) return;
    if (camera.frozen) {
      if (leads && goAlong()) camera.moving();
      return;
    }
    const way = middle().sub(last);
    if (thawed) {
      const now = performance.now();
      const passed = now - thawed.at;
      way.multiplyScalar(Math.min(1, passed / thawed.left));
      thawed = passed < thawed.left ? { at: now, left: thawed.left - passed } : undefined;
    }
    eye.position.add(way);
    nmm.viewer.controls.target.add(way);
    last.add(way);
  };
}
