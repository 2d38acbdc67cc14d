// The clock: it drives MeshCat's animator, the plots and the values, and the buttons drive it.
"use strict";
{
  const get = (id) => document.getElementById(id);
  const SPEEDS = [...get("speed").options].map((option) => Number(option.value));
  const PAUSE = 0.6;
  // range: s since the first sample, what the bar reaches over.
  const player = (nmm.player = { time: 0, playing: false, speed: 1, loop: true, range: { from: 0, to: 0 } });
  nmm.motions = [];
  let [last, rested] = [null, 0];

  nmm.hooks.stage = (stage) => {
    nmm.stage = stage;
    player.range.to = stage.duration;
    document.body.classList.toggle("live", stage.live);
    nmm.scenery.build(stage.view, stage.size, stage.follow.radius);
    nmm.camera.build(stage.view, stage.size, stage.tags, stage.wall);
  };

  nmm.hooks.motion = (motion) => {
    const row = nmm.motions.push(motion) - 1;
    if (motion.tag) nmm.scenery.tag(motion.path, motion.tag, motion.color);
    if (nmm.stage.live) return;
    const text = motion.label || "end-effector";
    const act = (on) => nmm.hide(nmm.runs[row], !on);
    motion.button = nmm.legend({ kind: "line", color: motion.color, text, act }).firstChild;
  };

  nmm.hooks.target = ({ color }) => nmm.legend({ kind: "ball", color, text: "target" });

  nmm.hooks.ready = () => {
    const grey = [0.5, 0.55, 0.62];
    const color = nmm.motions.length === 1 ? nmm.motions[0].color : grey;
    if (nmm.scenery.thin) nmm.legend({ kind: "thin", color, text: "platform's path" });
    nmm.legend({ kind: "grid", color: grey, text: `grid of ${nmm.scenery.pitch} m` });
    const animator = nmm.viewer.animator;
    animator.play(); // MeshCat seeks only once its actions have been started
    animator.pause();
    document.body.classList.remove("loading");
    document.body.classList.toggle("plain", !nmm.ghosts);
    get("status").textContent = "";
    get("slider").disabled = nmm.stage.duration === 0;
    if (nmm.stage.live) return setFollow(true);
    nmm.apart.start();
    player.setRange(0, nmm.stage.duration);
    nmm.plots.show(nmm.stage.plots);
    const { camera, time } = nmm.stage.opening;
    player.seek(time);
    nmm.camera.reset(); // the play bar is there only now
    if (typeof camera !== "string") nmm.camera.open(camera);
    else if (camera !== "iso") nmm.camera.look(camera);
    nmm.texts.fit();
    nmm.address.start();
    requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("nmm first pose")));
    return nmm.stage.autoplay && player.play();
  };

  // The bar reaches over a part of the motion, at least a thousandth of it.
  player.setRange = (from, to) => {
    const duration = nmm.stage.duration;
    const length = Math.min(Math.max(to - from, 1e-3 * duration), duration);
    const first = Math.min(Math.max(from, 0), duration - length);
    player.range = { from: first, to: length === duration ? duration : first + length };
    Object.assign(get("slider"), { min: player.range.from, max: player.range.to });
    get("slider").value = player.time;
    document.body.classList.toggle("beyond", player.beyond() !== 0);
  };
  // Whether the clock is before (-1) or after (1) what is zoomed into: where the slider cannot be.
  player.beyond = () => (player.time < player.range.from - 1e-9 ? -1 : Number(player.time > player.range.to + 1e-9));

  // time: s since the first sample.
  player.seek = (time) => {
    const duration = nmm.stage.duration;
    player.time = Math.min(Math.max(Number.isFinite(time) ? time : 0, 0), duration);
    follow();
    nmm.viewer.animator.seek(player.time);
    nmm.scenery.update(player.time);
    nmm.obstacles.update(player.time);
    nmm.sights.update(player.time);
    nmm.camera.update();
    nmm.plots.update();
    nmm.values.update();
    get("slider").value = player.time;
    document.body.classList.remove("beyond");
    get("slider").setAttribute("aria-valuetext", `${(nmm.stage.start + player.time).toFixed(2)} s`);
    const end = nmm.stage.start + duration;
    get("time").textContent = `${(nmm.stage.start + player.time).toFixed(2)} / ${end.toFixed(2)} s`;
    nmm.address.changed();
  };

  // What is zoomed into comes along when somebody goes elsewhere.
  function follow() {
    const { from, to } = player.range;
    if (player.time >= from && player.time <= to) return;
    const shift = player.time < from ? player.time - from : player.time - to;
    nmm.plots.zoom(from + shift, to + shift);
  }

  function setPlaying(on) {
    player.playing = on;
    [last, rested] = [null, 0];
    document.body.classList.toggle("playing", on);
    get("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  player.play = () => {
    if (player.time >= player.range.to || player.beyond()) player.seek(player.range.from);
    setPlaying(nmm.stage.duration > 0);
  };
  player.pause = () => setPlaying(false);
  player.toggle = () => (player.playing ? player.pause() : player.play());
  player.setSpeed = (speed) => {
    player.speed = speed;
    get("speed").value = String(speed);
  };
  player.faster = (by) => {
    const at = SPEEDS.indexOf(player.speed) + by;
    if (at >= 0 && at < SPEEDS.length) player.setSpeed(SPEEDS[at]);
  };

  function tick(now) {
    requestAnimationFrame(tick);
    if (!player.playing) return;
    const passed = last === null ? 0 : (now - last) / 1000;
    last = now;
    const { from, to } = player.range;
    const time = player.time + passed * player.speed;
    // It stays at the end for a moment before it begins again.
    rested = time >= to ? rested + passed : 0;
    if (time >= to && !player.loop) setPlaying(false);
    player.seek(rested >= PAUSE ? from : Math.min(time, to));
  }
  requestAnimationFrame(tick);
  // A page in the background is not drawn: after it, go on from where it was.
  document.addEventListener("visibilitychange", () => (last = null));

  function pressed(id, on) {
    get(id).setAttribute("aria-pressed", String(on));
    nmm.viewer.set_dirty();
  }
  const isPressed = (id) => get(id).getAttribute("aria-pressed") === "true";

  function setFollow(on) {
    nmm.camera.follow(on);
    pressed("follow", on);
    nmm.address.changed();
  }
  function setShown(id, objects, on) {
    for (const object of objects || []) object.visible = on;
    pressed(id, on);
  }

  const actions = (nmm.actions = {
    play: player.toggle,
    loop: () => pressed("loop", (player.loop = !player.loop)),
    follow: () => setFollow(!nmm.camera.following),
    reset: () => {
      nmm.camera.reset();
      nmm.viewer.set_dirty();
      nmm.address.changed();
    },
    ghosts: () => setShown("ghosts", nmm.ghosts, !isPressed("ghosts")),
    ellipsoids: () => setShown("ellipsoids", nmm.ellipsoids, !isPressed("ellipsoids")),
    distances: () => setShown("distances", nmm.obstacles.lines, !isPressed("distances")),
    image: () => {
      nmm.sights.show(!nmm.sights.shown);
      nmm.address.changed();
    },
    paths: () => setShown("paths", nmm.scenery.paths, !isPressed("paths")),
    grid: () => {
      setShown("grid", nmm.scenery.measures, !isPressed("grid"));
      nmm.address.changed();
    },
    curves: () => nmm.plots.show(!nmm.plots.shown),
  });
  for (const [id, action] of Object.entries(actions)) get(id).addEventListener("click", action);
  get("slider").addEventListener("input", (event) => player.seek(Number(event.target.value)));
  get("speed").addEventListener("change", (event) => player.setSpeed(Number(event.target.value)));
}
