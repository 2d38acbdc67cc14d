// The address is the state: #t=12.5&view=top&apart=1&grid=off&hide=pg&plots=H,error&plot=y~x&zoom=2,7, and where
// somebody has put the camera, &camera=eye's x,y,z,target's x,y,z. What it says otherwise is ignored.
"use strict";
{
  const address = (nmm.address = {});
  const SHOWN = ["grid", "ghosts", "paths", "image"];
  const pressed = (part) => document.getElementById(part).getAttribute("aria-pressed") === "true";
  const words = (text) => text.split(",").map((word) => word.trim().toLowerCase()).filter(Boolean);
  const short = (time) => String(Number((nmm.stage.start + time).toFixed(4)));
  let [ready, waiting, written] = [false, null, null];

  address.text = () => {
    const { player, plots, camera, stage } = nmm;
    const parts = [`t=${short(Math.min(player.time, stage.duration))}`];
    if (camera.from !== "iso") parts.push(`view=${camera.from}`);
    if (camera.following) parts.push("follow");
    if (camera.moved) parts.push(`camera=${camera.place().map((x) => Number(x.toPrecision(6))).join(",")}`);
    if (nmm.apart.share > 0) parts.push(`apart=${Number(nmm.apart.share.toFixed(3))}`);
    for (const part of SHOWN) if (!pressed(part)) parts.push(`${part}=off`);
    if (pressed("axes")) parts.push("axes=on");
    const hidden = nmm.runs.filter((run) => run.hidden).map((run) => encodeURIComponent(run.id));
    if (hidden.length) parts.push(`hide=${hidden.join(",")}`);
    const open = plots.shown ? plots.opened() : ["none"];
    if (plots.shown !== stage.plots || (plots.shown && open.join() !== plots.first.join())) {
      parts.push(`plots=${open.join(",") || "folded"}`);
    }
    parts.push(...nmm.own.text());
    const { from, to } = player.range;
    if (from > 0 || to < stage.duration) parts.push(`zoom=${short(from)},${short(to)}`);
    return `#${parts.join("&")}`;
  };

  // Not at each frame: browsers take only so many a second.
  address.changed = () => {
    if (!ready || waiting !== null) return;
    waiting = setTimeout(() => {
      waiting = null;
      if (nmm.player.playing) return address.changed();
      return address.write();
    }, 300);
  };
  address.write = () => {
    written = address.text();
    // A page in a frame of its own may not: its address is nobody's to copy.
    try {
      history.replaceState(null, "", written);
    } catch {
      ready = false;
    }
  };

  // Says whether there was anything to read.
  address.read = () => {
    const wanted = new URLSearchParams(location.hash.slice(1));
    const { stage, player, plots, camera, runs } = nmm;
    if (wanted.has("view")) camera.look(wanted.get("view"));
    if (wanted.has("follow") && !camera.following) nmm.actions.follow();
    if (wanted.has("apart") && runs.length > 1) nmm.apart.set(Number(wanted.get("apart")));
    for (const part of [...SHOWN, "axes"]) {
      const asked = wanted.get(part);
      if (["on", "off"].includes(asked) && (asked === "on") !== pressed(part)) nmm.actions[part]();
    }
    if (wanted.has("hide")) {
      const hidden = words(wanted.get("hide"));
      for (const run of runs) nmm.hide(run, hidden.includes(run.id));
    }
    if (wanted.has("plot")) nmm.own.read(wanted.getAll("plot"));
    if (wanted.has("plots")) {
      const named = words(wanted.get("plots"));
      const known = plots.ids().filter((id) => named.includes(id.toLowerCase()));
      if (known.length || named.includes("folded")) plots.open(known);
      if (known.length || named.includes("folded") || named.includes("none")) plots.show(!named.includes("none"));
    }
    const [from, to] = (wanted.get("zoom") || "").split(",").map((text) => Number(text || NaN) - stage.start);
    if (to > from && to > 0 && from < stage.duration) plots.zoom(from, to);
    const time = Number(wanted.get("t") || NaN);
    if (Number.isFinite(time)) player.seek(time - stage.start);
    // Where it was put, it was at that time: it may go along with the robots.
    const place = (wanted.get("camera") || "").split(",").map((text) => Number(text || NaN));
    if (place.length === 6 && place.every(Number.isFinite)) camera.put(place);
    if (wanted.has("play")) player.play();
  };

  address.start = () => {
    address.read();
    ready = true;
    nmm.plots.listeners.push(address.changed);
    nmm.runs.listeners.push(address.changed);
    window.addEventListener("hashchange", () => location.hash !== written && address.read());
  };
}
