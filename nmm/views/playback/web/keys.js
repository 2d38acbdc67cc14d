// The keyboard: one table of keys, none of which is taken from a control that has the focus and its own use for it.
"use strict";
{
  const FRAME = 1 / 60;
  const SLIDES = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"]);
  const { player, actions, plots } = nmm;
  const step = (event) => (event.shiftKey ? FRAME : 0.5);
  const keys = (nmm.keys = {
    " ": actions.play,
    ArrowLeft: (event) => player.seek(player.time - step(event)),
    ArrowRight: (event) => player.seek(player.time + step(event)),
    ArrowUp: () => player.faster(1),
    ArrowDown: () => player.faster(-1),
    Home: () => player.seek(player.range.from),
    End: () => player.seek(player.range.to),
    c: actions.curves,
    d: actions.distances,
    e: actions.ellipsoids,
    f: actions.follow,
    g: actions.ghosts,
    i: actions.image,
    k: actions.measure,
    l: actions.loop,
    m: () => document.body.classList.toggle("panel"),
    p: actions.paths,
    t: actions.axes,
    x: actions.grid,
    r: actions.reset,
    s: () => document.getElementById("picture").click(),
    v: () => nmm.camera.next(),
    w: () => document.getElementById("film").click(),
    "+": () => plots.closer(0.5),
    "-": () => plots.closer(2),
    0: () => plots.whole(),
  });

  // What a control does with a key itself. The slider of the time is the clock: its arrows are the page's.
  function owns(target, key) {
    if (!target.closest || target.id === "slider") return false;
    if (target.type === "range" && !target.closest(".dg, #panel")) return SLIDES.has(key);
    if (target.closest(".dg, #panel, input, select, textarea, [contenteditable]")) return true;
    return target.closest("button, summary, a") !== null && (key === " " || key === "Enter");
  }

  window.addEventListener(
    "keydown",
    (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (event.ctrlKey || event.metaKey || event.altKey || !nmm.stage || owns(event.target, key)) return;
      const taken = nmm.devices?.takes(event); // by what one holds
      if (!taken && keys[key] === undefined) return;
      event.preventDefault();
      if (!taken) keys[key](event);
    },
    true,
  );

  // A button that a mouse has pressed does not keep the space bar from the clock.
  window.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button && event.detail > 0 && !button.closest("#panel")) button.blur();
  });
}
