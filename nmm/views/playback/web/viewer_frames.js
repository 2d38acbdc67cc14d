// Frames: a triad and a name for each that is shown, the list of them, and the pose of one in numbers.
"use strict";
{
  const THREE = MeshCat.THREE;
  const DEGREES = 180 / Math.PI;
  // MeshCat turns the scene: three.js has y upwards, robots have z.
  const UPRIGHT = new THREE.Matrix4().set(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1);
  const frames = (nmm.frames = { list: [], shown: true });
  let triad = null;

  function draw(frame) {
    const on = frames.shown && frame.shown;
    if (on && !frame.triad) nmm.node(frame.path).add((frame.triad = triad()));
    if (frame.triad) frame.triad.visible = on;
    nmm.labels.put(frame.path, frame.name, on ? nmm.node(frame.path) : null, frame.named);
    nmm.viewer.set_dirty();
  }

  frames.show = (name, on) => {
    const frame = frames.list.find((one) => one.name === name);
    frame.shown = on;
    frame.box.checked = on;
    draw(frame);
    count();
  };

  function count() {
    const shown = frames.list.filter((frame) => frame.shown).length;
    frames.counter.textContent = `${shown} of ${frames.list.length}`;
  }

  // Position (m) and roll, pitch, yaw (rad) of a frame in the world: R = Rz(yaw) Ry(pitch) Rx(roll).
  frames.pose = (name) => {
    const { path } = frames.list.find((frame) => frame.name === name);
    const world = UPRIGHT.clone().invert().multiply(nmm.node(path).matrixWorld);
    const m = world.elements;
    const position = [m[12], m[13], m[14]];
    const pitch = Math.atan2(-m[2], Math.hypot(m[0], m[1]));
    // At ±90° of pitch, roll and yaw are not unique: the roll is then zero.
    const locked = Math.hypot(m[0], m[1]) < 1e-9;
    const roll = locked ? 0 : Math.atan2(m[6], m[10]);
    const yaw = locked ? Math.atan2(-m[4], m[5]) : Math.atan2(m[1], m[0]);
    return { position, rpy: [roll, pitch, yaw] };
  };

  function tell() {
    const { position, rpy } = frames.pose(frames.chosen.value);
    const cells = [
      ...position.map((value) => `${nmm.fixed(value, 4)} m`),
      ...rpy.map((value) => `${nmm.fixed(value * DEGREES, 2)}°`),
    ];
    cells.forEach((text, i) => (frames.cells[i].textContent = text));
  }

  function posePart(pose) {
    const head = nmm.element(nmm.panel, "div", { class: "head" });
    nmm.element(head, "h2", {}, "Pose of");
    frames.chosen = nmm.element(head, "select", { id: "posed", "aria-label": "Frame whose pose is told" });
    for (const { name } of frames.list) nmm.element(frames.chosen, "option", { value: name }, name);
    frames.chosen.value = pose;
    frames.chosen.addEventListener("change", tell);
    const table = nmm.element(nmm.panel, "dl", { id: "pose", title: "In the world: R = Rz(yaw) Ry(pitch) Rx(roll)" });
    frames.cells = ["x", "y", "z", "roll", "pitch", "yaw"].map((name) => {
      const pair = nmm.element(table, "div");
      nmm.element(pair, "dt", {}, name);
      return nmm.element(pair, "dd");
    });
  }

  function listPart() {
    const part = nmm.element(nmm.panel, "details", { id: "frames" });
    const summary = nmm.element(part, "summary");
    nmm.element(summary, "span", {}, "Frames");
    frames.counter = nmm.element(summary, "span", { class: "quiet" });
    const buttons = nmm.element(part, "div", { class: "head" });
    const choices = { all: () => true, none: () => false, "at first": (frame) => frame.first };
    for (const [text, choose] of Object.entries(choices)) {
      const button = nmm.element(buttons, "button", {}, text);
      button.addEventListener("click", () => frames.list.forEach((f) => frames.show(f.name, choose(f))));
    }
    for (const frame of frames.list) {
      const row = nmm.element(part, "label", { class: "frame" });
      frame.box = nmm.element(row, "input", { type: "checkbox", "data-frame": frame.name });
      nmm.element(row, "span", {}, frame.name);
      frame.box.addEventListener("change", () => {
        frame.named = true;
        frames.show(frame.name, frame.box.checked);
      });
    }
  }

  function toggle(id, text, title, on, act) {
    const button = nmm.element(document.getElementById("tools"), "button", { id, title, "aria-pressed": on }, text);
    button.addEventListener("click", () => {
      const now = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(now));
      act(now);
    });
  }

  // The world's own axes, which at first are where the root's are.
  function showWorld(on) {
    nmm.node("/nmm/axes").visible = on;
    nmm.viewer.set_dirty();
  }

  nmm.hooks.frames = ({ frames: list, shown, length, pose }) => {
    frames.list = list.map((frame) => ({ ...frame, first: frame.shown, triad: null }));
    frames.shown = shown;
    triad = nmm.triad(length);
    posePart(pose);
    listPart();
    toggle("triads", "Frames", "Show the frames that are ticked", shown, (on) => {
      frames.shown = on;
      frames.list.forEach(draw);
    });
    toggle("world", "World", "Show the world's axes", false, showWorld);
    showWorld(false);
    toggle("names", "Names", "Show the names of all frames, not only of tools, root and what is pointed at", false, nmm.labels.showAll);
    for (const frame of frames.list) frames.show(frame.name, frame.shown);
    nmm.viewer.scene.updateMatrixWorld();
    nmm.joints.listeners.push(tell);
    tell();
  };
}
