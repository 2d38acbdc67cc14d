// What people hold: keys, gamepads and SpaceMice, each as six shares from -1 to 1 along x (ahead), y (left) and z (up)
// and about them (REP-103), and as buttons. One table says what moves what, for the devices and for those who hold them.
"use strict";
{
  const DEAD = 0.12; // share of a stick's way, and of a SpaceMouse's, that is nothing: let go of they are never quite at 0
  const SLOW = 0.1;
  const FULL = 350; // a SpaceMouse's numbers at its stops
  const MULTI_AXIS = { usagePage: 0x01, usage: 0x08 }; // as USB's HID Usage Tables name such a device
  const [L1, R1, L2, R2] = [4, 5, 6, 7]; // buttons of the "standard" gamepad of the W3C

  // stick and hid: a number of the device's, and its sign; pad: a button for more, and one for less. HID has x to the
  // right, y towards the user and z down, all turns right-handed.
  const AXES = [
    { axis: "x", does: "forward, back", keys: ["KeyW", "KeyS"], stick: [1, -1], hid: [1, -1], gamepad: "left stick up, down", mouse: "push away, pull" },
    { axis: "y", does: "left, right", keys: ["KeyA", "KeyD"], stick: [0, -1], hid: [0, -1], gamepad: "left stick left, right", mouse: "push left, right" },
    { axis: "z", does: "up, down", keys: ["KeyR", "KeyF"], stick: [3, -1], hid: [2, -1], gamepad: "right stick up, down", mouse: "lift, press" },
    { axis: "rx", does: "tilt right, left", keys: ["KeyC", "KeyX"], pad: [15, 14], hid: [4, -1], gamepad: "pad right, left", mouse: "tilt right, left" },
    { axis: "ry", does: "tilt forward, back", keys: ["KeyT", "KeyG"], pad: [12, 13], hid: [3, -1], gamepad: "pad up, down", mouse: "tilt away, to you" },
    { axis: "rz", does: "turn left, right", keys: ["KeyQ", "KeyE"], stick: [2, -1], hid: [5, -1], gamepad: "right stick left, right", mouse: "twist left, right" },
  ];
  const BUTTONS = [
    { name: "held", does: "hold to move", keys: ["KeyJ"], pad: [L1, R1], bit: 0, gamepad: "L1 or R1", mouse: "left button" },
    { name: "slow", does: "a tenth as fast", keys: ["ShiftLeft", "ShiftRight"], label: "Shift", pad: [L2, R2], gamepad: "L2 or R2", mouse: "" },
    { name: "part", does: "hand or base", keys: ["KeyB"], pad: [0], bit: 1, gamepad: "A, ×", mouse: "right button" },
    { name: "frame", does: "whose axes", keys: ["KeyO"], pad: [1], gamepad: "B, ○", mouse: "" },
  ];
  const devices = (nmm.devices = { AXES, BUTTONS, mice: [], changed: () => {} });
  devices.VALID = 250; // ms that what a SpaceMouse's cap has reported holds
  const ALL = [...BUTTONS, ...AXES];

  // From the end of the dead zone on, so that slow is slow.
  const beyond = (x) => (Math.abs(x) > DEAD ? (Math.sign(x) * (Math.min(Math.abs(x), 1) - DEAD)) / (1 - DEAD) : 0);
  const difference = (more, less) => Number(more) - Number(less);

  // Keys that move by their place, not by their letter: other layouts have the same hand on them. J, B and O by their
  // letter, and by their place where the page has no use for the letter that lies there.
  const LETTERS = { j: "KeyJ", b: "KeyB", o: "KeyO" };
  const NAMED = new Set(Object.values(LETTERS));
  const MOVING = new Set(AXES.flatMap(({ keys }) => keys));
  const [down, own] = [new Map(), new Set()]; // by place: what is down, and those that do nothing else until they come up
  const is = (meant) => [...down.values()].includes(meant);
  // Which of the table's keys one is; undefined for others.
  devices.meant = (code, key) => {
    const letter = key.toLowerCase();
    const named = LETTERS[letter];
    if (MOVING.has(code) && (!named || named === "KeyJ" || is("KeyJ"))) return code;
    if (named) return named;
    if (NAMED.has(code)) return nmm.keys[letter] ? undefined : code;
    return ALL.some(({ keys }) => keys.includes(code)) ? code : undefined;
  };
  const keyboard = {
    name: "keys",
    axes: () => AXES.map(({ keys: [more, less] }) => difference(is(more), is(less))),
    button: ({ keys }) => keys.some(is),
  };
  // Whether a key is taken: while J is held, those that move something do nothing else. Nor do they when J is let go of
  // first, and the system goes on to repeat them.
  devices.takes = ({ code, key, repeat }) => {
    const meant = devices.meant(code, key);
    if (meant === undefined) return false;
    if (!repeat) {
      own.delete(code);
      down.set(code, meant);
      devices.changed();
    }
    if (NAMED.has(meant) || (is("KeyJ") && !code.startsWith("Shift"))) own.add(code);
    return own.has(code);
  };
  // Keys that are down when nobody looks come up unseen; as do, on a Mac, those that are let go of while Meta is held.
  devices.forget = () => down.clear();
  window.addEventListener("keyup", ({ code }) => {
    own.delete(code);
    if (down.delete(code)) devices.changed();
  }, true);
  window.addEventListener("keydown", ({ metaKey }) => {
    if (!metaKey || !down.size) return;
    devices.forget();
    devices.changed();
  }, true);

  // Only of a known layout: of another one, an axis could be a trigger, which rests at -1.
  const gamepad = (pad) => ({
    name: pad.id,
    axes: () => AXES.map(({ stick, pad: buttons }) => (stick ? stick[1] * beyond(pad.axes[stick[0]] || 0) : difference(...buttons.map((k) => pressed(pad, k))))),
    button: ({ pad: buttons }) => buttons.some((k) => pressed(pad, k)),
  });
  const pressed = ({ buttons }, k) => buttons[k] !== undefined && (buttons[k].pressed || buttons[k].value > 0.5);
  const pads = () => [...(navigator.getGamepads ? navigator.getGamepads() : [])].filter((pad) => pad && pad.connected);
  devices.strange = () => pads().filter(({ mapping }) => mapping !== "standard");

  // Report 1 has x, y, z, and in newer devices the turns behind them; report 2 the turns; report 3 the buttons.
  function spaceMouse(device) {
    const [raw, mouse] = [new Array(6).fill(0), { device, bits: 0 }];
    let heard = 0;
    device.addEventListener("inputreport", ({ reportId, data }) => {
      const first = { 1: 0, 2: 3 }[reportId];
      if (first !== undefined) heard = performance.now();
      if (first !== undefined) for (let k = first; k < 6 && 2 * (k - first) + 1 < data.byteLength; k++) raw[k] = data.getInt16(2 * (k - first), true);
      if (reportId === 3 && data.byteLength) mouse.bits = data.getUint8(0);
      if (reportId === 3) devices.changed();
    });
    // Away from its rest a cap reports all the time, unless the mouse has no power or is too far away: then its buttons, too,
    // come up unseen.
    mouse.forget = () => {
      if (performance.now() - heard < devices.VALID || !raw.some((x) => beyond(x / FULL))) return;
      raw.fill(0);
      mouse.bits = 0;
    };
    return Object.assign(mouse, {
      name: device.productName || "SpaceMouse",
      axes: () => AXES.map(({ hid: [k, sign] }) => sign * beyond(raw[k] / FULL)),
      button: ({ bit }) => bit !== undefined && Boolean(mouse.bits & (1 << bit)),
    });
  }
  async function open(device) {
    if (devices.mice.some((mouse) => mouse.device === device)) return;
    if (!device.opened) await device.open();
    devices.mice.push(spaceMouse(device));
    devices.changed();
  }
  const isMouse = ({ collections }) => collections.some(({ usagePage, usage }) => usagePage === MULTI_AXIS.usagePage && usage === MULTI_AXIS.usage);
  if (navigator.hid) {
    navigator.hid.addEventListener("disconnect", ({ device }) => {
      devices.mice = devices.mice.filter((mouse) => mouse.device !== device);
      devices.changed();
    });
    // Those that this page has been given before.
    const again = (found) => Promise.all(found.filter(isMouse).map(open)).catch(() => {});
    navigator.hid.addEventListener("connect", ({ device }) => again([device]));
    navigator.hid.getDevices().then(again, () => {});
  }
  // Says why not, or "".
  devices.ask = async () => {
    try {
      const found = await navigator.hid.requestDevice({ filters: [MULTI_AXIS] });
      await Promise.all(found.map(open));
      return "";
    } catch (error) {
      return `The SpaceMouse cannot be opened: ${error.message}`;
    }
  };

  // All that is held, together.
  devices.read = () => {
    for (const mouse of devices.mice) mouse.forget();
    const all = [keyboard, ...pads().filter(({ mapping }) => mapping === "standard").map(gamepad), ...devices.mice];
    const state = Object.fromEntries(BUTTONS.map((button) => [button.name, all.some((device) => device.button(button))]));
    const each = all.map((device) => device.axes());
    const sums = AXES.map((_, k) => each.reduce((sum, shares) => sum + shares[k], 0));
    const axes = sums.map((sum) => Math.max(-1, Math.min(1, sum)) * (state.slow ? SLOW : 1));
    return { ...state, axes, names: all.slice(1).map(({ name }) => name) };
  };
}
