// Moves hand or base by what one holds: only while a dead man's switch is held, the page is seen and has the focus.
"use strict";
{
  const PERIOD = 40; // ms between two messages, each of which holds for 250
  const ZERO = [0, 0, 0, 0, 0, 0];
  const WHOSE = { hand: "its own", base: "the base's", world: "the world's" };
  const { devices } = nmm;
  const jog = (nmm.jog = { hands: [], base: [], part: "hand", frame: "hand", held: false, moves: false });
  const [parts, rows] = [{}, []];
  let [locked, before, built, looked] = [false, {}, false, 0];

  // The hand that was aimed at last, or the first one.
  const hand = () => jog.hands.find(({ task }) => task === nmm.drive.active) || jog.hands[0];
  const axes = () => (jog.part === "base" ? jog.base : hand() ? hand().axes : []);
  const alone = () => document.hidden || !document.hasFocus() || Boolean(nmm.ended);

  function tick() {
    if (!built) return;
    looked = performance.now();
    const now = devices.read();
    const seen = !alone();
    if (seen && now.part && !before.part) choose(jog.part === "hand" ? "base" : "hand");
    if (seen && now.frame && !before.frame) turn();
    before = now;
    // What was held before an interruption has to be let go of once.
    if (!seen) locked = true;
    else if (locked && !now.held) locked = false;
    const known = axes();
    const shares = now.axes.map((share, k) => (known.includes(devices.AXES[k].axis) ? share : 0));
    const moves = now.held && !locked && shares.some(Boolean);
    if (moves || jog.moves) say(moves ? shares : ZERO);
    Object.assign(jog, { moves, held: now.held && !locked });
    show(now);
  }
  function say(shares) {
    const one = jog.part === "hand" ? hand() : undefined;
    nmm.send({ type: "jog", part: jog.part, frame: jog.frame, task: one ? one.task : 0, axes: shares });
  }
  // At once, and not again before it has been let go of.
  function stop() {
    devices.forget();
    locked = true;
    tick();
  }

  // What is held while another part or other axes are chosen has to be let go of once. Where nothing is held, J may follow
  // before the next look.
  const lock = () => (locked ||= devices.read().held);

  function choose(part) {
    if (part === jog.part || !(part === "base" ? jog.base : jog.hands).length) return;
    if (jog.moves) say(ZERO);
    Object.assign(jog, { part, moves: false });
    lock();
    name();
  }
  function turn(frame) {
    const all = Object.keys(WHOSE);
    if (jog.moves) say(ZERO);
    Object.assign(jog, { frame: frame || all[(all.indexOf(jog.frame) + 1) % all.length], moves: false });
    lock();
    name();
  }

  function name() {
    for (const [key, button] of Object.entries(parts.part)) button.setAttribute("aria-pressed", String(key === jog.part));
    for (const [key, button] of Object.entries(parts.frame)) button.setAttribute("aria-pressed", String(key === jog.frame));
    parts.part.hand.disabled = !jog.hands.length;
    parts.part.base.disabled = !jog.base.length;
    parts.frames.hidden = jog.part === "base";
    for (const { line, axis } of rows) line.classList.toggle("idle", axis !== undefined && !axes().includes(axis));
  }
  function show({ names }) {
    const strange = devices.strange().map(({ id }) => `${id}: a gamepad whose buttons the browser does not know`);
    const hears = [...names, ...strange].join("; ");
    const told = jog.moves ? `The ${jog.part} moves.` : jog.held ? "Held: now a key, stick or the cap moves it." : `Nothing moves unless you hold J, L1 or R1${navigator.hid ? ", or a SpaceMouse's left button" : ""}.`;
    const text = hears ? `${told} Connected: ${hears}.` : told;
    if (parts.told.textContent !== text) parts.told.textContent = text;
    parts.told.classList.toggle("on", jog.held);
  }

  function group(label, choices, act) {
    const line = nmm.element(parts.field, "div", { class: "jog", role: "group", "aria-label": label });
    nmm.element(line, "span", {}, label);
    const buttons = Object.entries(choices).map(([key, text]) => {
      const button = nmm.element(line, "button", { type: "button", "aria-pressed": "false" }, text);
      button.addEventListener("click", () => act(key));
      return [key, button];
    });
    return [line, Object.fromEntries(buttons)];
  }

  nmm.hooks.jog = ({ hands, base }) => {
    Object.assign(jog, { hands, base, part: hands.length ? "hand" : "base" });
    if (!hands.length && !base.length) return;
    parts.field = document.createElement("fieldset");
    parts.field.id = "jog";
    document.getElementById("choices").before(parts.field);
    nmm.element(parts.field, "legend", {}, "Jog");
    [parts.parts, parts.part] = group("Moves", { hand: "Hand", base: "Base" }, choose);
    [parts.frames, parts.frame] = group("Axes", WHOSE, turn);
    parts.told = nmm.element(parts.field, "p", { id: "jogs", role: "status" });
    if (navigator.hid) {
      const ask = nmm.element(parts.field, "button", { id: "spacemouse", type: "button" }, "Connect a SpaceMouse");
      const why = nmm.element(parts.field, "p", { class: "quiet", role: "status" });
      ask.addEventListener("click", async () => (why.textContent = await devices.ask()));
    }
    table(nmm.element(parts.field, "details"));
    devices.changed = tick;
    built = true;
    name();
    show({ names: [] });
    setInterval(tick, PERIOD);
    // Where pictures come faster than a page can show them, its timers wait behind them.
    const { drive } = nmm.hooks;
    nmm.hooks.drive = (picture) => {
      drive(picture);
      // Where a base can go changes with how its wheels are steered.
      if (String(picture.base) !== String(jog.base)) {
        jog.base = picture.base;
        name();
      }
      if (performance.now() - looked > PERIOD) tick();
    };
    for (const end of ["blur", "pagehide"]) window.addEventListener(end, stop);
    // A menu or a drag of the browser's own takes the keyups; one that the page has prevented does not come.
    for (const end of ["contextmenu", "dragstart"]) window.addEventListener(end, (event) => event.defaultPrevented || stop());
    document.addEventListener("visibilitychange", () => document.hidden && stop());
    window.addEventListener("gamepaddisconnected", tick);
    nmm.endings.push(stop);
  };

  // What moves what; letters as the keyboard has them, where the browser tells.
  function table(part) {
    nmm.element(part, "summary", {}, "What moves what");
    const all = nmm.element(part, "table");
    const head = nmm.element(nmm.element(all, "thead"), "tr");
    for (const title of ["", "Keys", "Gamepad", "SpaceMouse"]) nmm.element(head, "th", { scope: "col" }, title);
    const body = nmm.element(all, "tbody");
    for (const { does, keys, label, gamepad, mouse, axis } of [...devices.BUTTONS, ...devices.AXES]) {
      const line = nmm.element(body, "tr");
      nmm.element(line, "th", { scope: "row" }, does);
      const [cell] = [label || letters(keys), gamepad, mouse].map((text) => nmm.element(line, "td", {}, text));
      rows.push({ line, axis, label, keys, cell });
    }
    nmm.element(part, "p", { class: "quiet" }, "Rows in grey do nothing now: a base goes only where its wheels let it, a task turns or moves only what it has.");
    if (!navigator.keyboard?.getLayoutMap) return;
    const rename = (layout) => rows.forEach(({ cell, label, keys }) => (cell.textContent = label || letters(keys, layout)));
    navigator.keyboard.getLayoutMap().then(rename, () => {});
  }
  const letters = (codes, layout = new Map()) => codes.map((code) => letter(code, [...layout])).join(", ");
  function letter(code, layout) {
    const [, key] = layout.find((place) => devices.meant(...place) === code) || layout.find(([place]) => place === code) || [];
    return (key || code.slice(3)).toUpperCase();
  }
}
