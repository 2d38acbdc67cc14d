// Where to look from: at the whole motion, or along with the robots.
"use strict";
{
  const THREE = MeshCat.THREE;
  const FIELD = 36;
  // From the target towards the camera, in the world's axes.
  const TOWARDS = new THREE.Vector3(0.42, -0.9, 0.82);
  const camera = (nmm.camera = { following: false, moved: false, held: null });
  // Not the window: a page may have something beside the view.
  const view = document.getElementById("view");
  const upright = (v) => new THREE.Vector3(v.x, v.z, -v.y);
  let eye, points, last;

  camera.build = (held, size) => {
    points = [];
    for (let i = 0; i < held.length; i += 3) points.push(upright(new THREE.Vector3().fromArray(held, i)));
    eye = new THREE.PerspectiveCamera(FIELD, view.clientWidth / view.clientHeight, 0.01 * size, 80 * size);
    nmm.viewer.set_camera(eye);
    nmm.viewer.set_object(["Cameras", "default", "rotated"], eye);
    const controls = nmm.viewer.controls;
    controls.maxPolarAngle = 0.49 * Math.PI;
    controls.minDistance = 0.05 * size;
    controls.maxDistance = 30 * size;
    controls.addEventListener("start", () => (camera.moved = true));
    window.addEventListener("resize", () => camera.moved || camera.reset());
    camera.reset();
  };

  // Pixels at the upper and lower edge that the controls cover.
  function covered() {
    const bar = document.getElementById("bar").getBoundingClientRect();
    const head = document.getElementById("heading").getBoundingClientRect();
    const narrow = window.innerWidth < 640;
    const below = window.innerHeight - bar.top + (narrow ? 44 : 10);
    const under = view.clientHeight < window.innerHeight ? 56 : 24; // where a panel is below the view
    return [narrow || camera.held ? head.bottom + 4 : 24, bar.height ? below : under];
  }

  // Where, along one axis of the picture, what is held leaves the same room on both sides.
  function centred(held, axis, forward, z, [low, high], more, less) {
    for (let k = 0; k < 40; k++) {
      const middle = 0.5 * (low + high);
      let [most, least] = [-Infinity, Infinity];
      for (const p of held) {
        const slope = (axis.dot(p) - middle) / (forward.dot(p) - z);
        [most, least] = [Math.max(most, slope), Math.min(least, slope)];
      }
      if (most / more + least / less > 0) low = middle;
      else high = middle;
    }
    return 0.5 * (low + high);
  }

  // The nearest place for an eye that looks along -towards and has all that is held in the free part of the
  // window.
  function look(held, towards) {
    const [width, height] = [view.clientWidth, view.clientHeight];
    const [top, bottom] = covered();
    const across = Math.tan((FIELD * Math.PI) / 360);
    const tx = ((across * width) / height) * 0.94;
    const above = across * Math.max(0.1, 1 - (2 * top) / height);
    const below = across * Math.max(0.1, 1 - (2 * bottom) / height);
    const forward = towards.clone().negate().normalize();
    const right = new THREE.Vector3().crossVectors(forward, new THREE.Vector3(0, 1, 0)).normalize();
    const up = new THREE.Vector3().crossVectors(right, forward);
    const bounds = [[-Infinity, Infinity], [-Infinity, Infinity]];
    let [sum, near] = [0, Infinity];
    for (const p of held) {
      const [x, y, z] = [right.dot(p), up.dot(p), forward.dot(p)];
      bounds[0] = [Math.max(bounds[0][0], x - tx * z), Math.min(bounds[0][1], x + tx * z)];
      bounds[1] = [Math.max(bounds[1][0], y - above * z), Math.min(bounds[1][1], y + below * z)];
      sum += z;
      near = Math.min(near, z);
    }
    const [[left, rightmost], [highest, lowest]] = bounds;
    const depths = [(rightmost - left) / (2 * tx), (lowest - highest) / (above + below), near - 2 * eye.near];
    const z = Math.min(...depths);
    const x = centred(held, right, forward, z, [left + tx * z, rightmost - tx * z], tx, tx);
    const y = centred(held, up, forward, z, [highest + above * z, lowest - below * z], above, below);
    eye.position.copy(right.multiplyScalar(x)).addScaledVector(up, y).addScaledVector(forward, z);
    nmm.viewer.controls.target.copy(eye.position).addScaledVector(forward, sum / held.length - z);
    nmm.viewer.controls.update();
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

  camera.reset = () => {
    camera.moved = false;
    const towards = upright(TOWARDS);
    if (!camera.following && !camera.held) return look(points, towards);
    last = middle();
    // A page may say itself what there is to hold, as points in three.js's axes.
    if (camera.held) return look(camera.held(), towards);
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
    return look(around, towards);
  };

  camera.follow = (on) => {
    camera.following = on;
    camera.reset();
  };

  camera.update = () => {
    if (!camera.following) return;
    const now = middle();
    eye.position.add(now).sub(last);
    nmm.viewer.controls.target.add(now).sub(last);
    last = now;
  };
}
