// The controls: a clock that drives MeshCat's animator, the play bar, the legend, the keyboard.
"use strict";
{
  const get = (id) => document.getElementById(id);
  const SPEEDS = [...get("speed").options].map((option) => Number(option.value));
  const FRAME = 1 / 60;
  const player = (nmm.player = { time: 0, playing: false, speed: 1, loop: true });
  nmm.motions = [];
  let last = null;

  nmm.hooks.stage = (stage) => {
    nmm.stage = stage;
    document.body.classList.toggle("live", stage.live);
    nmm.scenery.build(stage.view, stage.size, stage.follow.radius);
    nmm.camera.build(stage.view, stage.size, stage.tags);
  };

  nmm.hooks.motion = (motion) => {
    const row = nmm.motions.push(motion) - 1;
    const { tag, color, height } = motion;
    if (tag) nmm.scenery.tag(nmm.node(motion.root), tag, color, height, row);
    if (nmm.stage.live) return;
    const text = motion.label || "end-effector";
    nmm.legend({ kind: "line", color: motion.color, text, path: motion.path });
  };

  nmm.hooks.target = ({ color }) => nmm.legend({ kind: "ball", color, text: "target" });

  nmm.hooks.ready = () => {
    const animator = nmm.viewer.animator;
    animator.play(); // MeshCat seeks only once its actions have been started
    animator.pause();
    document.body.classList.remove("loading");
    document.body.classList.toggle("plain", !nmm.ghosts);
    get("status").textContent = "";
    get("slider").max = nmm.stage.duration;
    get("slider").disabled = nmm.stage.duration === 0;
    if (nmm.stage.live) return setFollow(true);
    const wanted = new URLSearchParams(location.hash.slice(1));
    player.seek(Number(wanted.get("t") || nmm.stage.start) - nmm.stage.start);
    if (nmm.stage.autoplay || wanted.has("play")) player.play();
    return nmm.camera.reset(); // the play bar is there only now
  };

  // time: s since the first sample.
  player.seek = (time) => {
    const duration = nmm.stage.duration;
    player.time = Math.min(Math.max(Number.isFinite(time) ? time : 0, 0), duration);
    nmm.viewer.animator.seek(player.time);
    nmm.scenery.update(player.time);
    nmm.obstacles.update(player.time);
    nmm.camera.update();
    get("slider").value = player.time;
    get("slider").setAttribute("aria-valuetext", `${player.time.toFixed(2)} s`);
    const end = nmm.stage.start + duration;
    get("time").textContent = `${(nmm.stage.start + player.time).toFixed(2)} / ${end.toFixed(2)} s`;
  };

  function setPlaying(on) {
    player.playing = on;
    last = null;
    document.body.classList.toggle("playing", on);
    get("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  player.play = () => {
    if (player.time >= nmm.stage.duration) player.seek(0);
    setPlaying(nmm.stage.duration > 0);
  };
  player.pause = () => setPlaying(false);
  player.toggle = () => (player.playing ? player.pause() : player.play());
  player.setSpeed = (speed) => {
    player.speed = speed;
    get("speed").value = String(speed);
  };

  function tick(now) {
    requestAnimationFrame(tick);
    if (!player.playing) return;
    const passed = last === null ? 0 : (now - last) / 1000;
    last = now;
    let time = player.time + passed * player.speed;
    if (time >= nmm.stage.duration) {
      // Stay at the end for a moment before beginning again.
      if (player.loop && time >= nmm.stage.duration + 0.6 * player.speed) time = 0;
      else if (!player.loop) setPlaying(false);
    }
    player.seek(time);
    if (time > nmm.stage.duration && player.playing) player.time = time;
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
  }
  function setShown(id, objects, on) {
    for (const object of objects || []) object.visible = on;
    pressed(id, on);
  }

  const actions = {
    play: player.toggle,
    loop: () => pressed("loop", (player.loop = !player.loop)),
    follow: () => setFollow(!nmm.camera.following),
    reset: () => {
      nmm.camera.reset();
      nmm.viewer.set_dirty();
    },
    ghosts: () => setShown("ghosts", nmm.ghosts, !isPressed("ghosts")),
    ellipsoids: () => setShown("ellipsoids", nmm.ellipsoids, !isPressed("ellipsoids")),
    distances: () => setShown("distances", nmm.obstacles.lines, !isPressed("distances")),
    paths: () => setShown("paths", nmm.scenery.paths, !isPressed("paths")),
  };
  for (const [id, action] of Object.entries(actions)) get(id).addEventListener("click", action);
  get("slider").addEventListener("input", (event) => player.seek(Number(event.target.value)));
  get("speed").addEventListener("change", (event) => player.setSpeed(Number(event.target.value)));

  const faster = (by) => {
    const at = SPEEDS.indexOf(player.speed) + by;
    if (at >= 0 && at < SPEEDS.length) player.setSpeed(SPEEDS[at]);
  };
  const keys = {
    " ": actions.play,
    ArrowLeft: (event) => player.seek(player.time - (event.shiftKey ? FRAME : 0.5)),
    ArrowRight: (event) => player.seek(player.time + (event.shiftKey ? FRAME : 0.5)),
    ArrowUp: () => faster(1),
    ArrowDown: () => faster(-1),
    Home: () => player.seek(0),
    End: () => player.seek(nmm.stage.duration),
    l: actions.loop,
    f: actions.follow,
    r: actions.reset,
    g: actions.ghosts,
    e: actions.ellipsoids,
    d: actions.distances,
    p: actions.paths,
    m: () => document.body.classList.toggle("panel"),
  };
  window.addEventListener(
    "keydown",
    (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (event.ctrlKey || event.metaKey || event.altKey || keys[key] === undefined || !nmm.stage) return;
      // Letters, arrows and space belong to a panel while one types or slides there.
      if (event.target.closest && event.target.closest(".dg, #panel")) return;
      event.preventDefault();
      keys[key](event);
    },
    true,
  );

  const SIGNS = {
    line: '<path d="M2 6h20" stroke="currentColor" stroke-width="4" stroke-linecap="round"/>',
    dashed: '<path d="M1 6h22" stroke="currentColor" stroke-width="3" stroke-dasharray="6 4"/>',
    box: '<path d="M5 1h14v10H5z" fill="currentColor"/>',
    ball: '<circle cx="12" cy="6" r="5" fill="currentColor"/>',
  };

  // path: a node that the entry shows and hides, or several.
  nmm.legend = ({ kind, color, text, path }) => {
    if (path === undefined && text && [...get("legend").children].some((item) => item.textContent === text)) return;
    const item = document.createElement("li");
    const sign = document.createElement("span");
    sign.style.color = `rgb(${color.map((c) => Math.round(255 * c)).join(",")})`;
    sign.innerHTML = `<svg viewBox="0 0 24 12" aria-hidden="true">${SIGNS[kind]}</svg>`;
    const holder = path === undefined ? item : item.appendChild(document.createElement("button"));
    holder.append(sign, text);
    if (path !== undefined) {
      holder.setAttribute("aria-pressed", "true");
      holder.title = `Show or hide ${text}`;
      holder.addEventListener("click", () => {
        const on = holder.getAttribute("aria-pressed") !== "true";
        for (const one of [path].flat()) nmm.node(one).visible = on;
        holder.setAttribute("aria-pressed", String(on));
        nmm.viewer.set_dirty();
      });
    }
    get("legend").append(item);
    return item;
  };
}
