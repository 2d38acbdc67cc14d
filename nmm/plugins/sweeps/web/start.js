// One rollout opened, the outcomes, the views offered; and everything drawn for the first time.
const quoted = (word) => (/^[\w./:=,+@%-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`);

function choose(row) {
  if (row < 0) return;
  chosen = row;
  const box = $("one"), index = valueOf(byName.get("index"), row);
  const varied = DATA.columns.filter((column) => column.varied);
  const words = [...DATA.command];
  for (const column of varied) words.push("--set", `${column.name}=${valueOf(column, row)}`);
  const heading = document.createElement("h2");
  heading.textContent = `Rollout ${index}: ${valueOf(byName.get("outcome"), row)}`;
  const message = document.createElement("p");
  message.textContent = valueOf(byName.get("message"), row) || "";
  const list = document.createElement("dl");
  for (const column of DATA.columns) {
    const value = valueOf(column, row);
    if (["index", "outcome", "message"].includes(column.name) || value === null) continue;
    const item = document.createElement("div"), name = document.createElement("dt"), cell = document.createElement("dd");
    name.textContent = column.name;
    name.title = column.about;
    cell.textContent = measured(value, column);
    item.append(name, cell);
    list.append(item);
  }
  box.replaceChildren(heading, message, list);
  const motion = document.createElement("p");
  if (DATA.keep) {
    const folder = `runs/${String(index).padStart(9, "0")}/`;
    if (DATA.keep === "playback") motion.append(link(`${folder}playback.html`, "Play the motion"), " · ");
    motion.append(link(folder, "its run folder"), ` (nmm play ${folder} from here)`);
  } else motion.textContent = "This computes it again, to the last digit, and plays it:";
  box.append(motion);
  const command = document.createElement("pre");
  command.textContent = [...words, "--html", "--play"].map(quoted).join(" ");
  const copy = document.createElement("button");
  copy.type = "button";
  copy.textContent = "Copy the command";
  copy.addEventListener("click", () => {
    const range = document.createRange();
    range.selectNodeContents(command);
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    copy.textContent = document.execCommand("copy") ? "Copied" : "Selected: press Ctrl-C";
  });
  box.append(command, copy);
  box.hidden = false;
  box.scrollTop = 0;
  drawAll();
  box.scrollIntoView({ block: "nearest" });
}

function link(address, text) {
  const anchor = document.createElement("a");
  anchor.href = address;
  anchor.textContent = text;
  return anchor;
}

const hidden = new Set();
function showOutcomes() {
  if (!filters.has("outcome")) hidden.clear();
  $("outcomes").replaceChildren(
    ...Object.entries(DATA.outcomes).map(([name, count]) => {
      const button = document.createElement("button"), swatch = document.createElement("span");
      button.type = "button";
      button.setAttribute("aria-pressed", String(!hidden.has(name)));
      swatch.className = "swatch";
      swatch.style.background = OUTCOMES[name] || NAMED[6];
      button.append(swatch, `${count} ${name}`);
      button.addEventListener("click", () => {
        if (!hidden.delete(name)) hidden.add(name);
        const test = (value) => !hidden.has(value);
        setFilter("outcome", hidden.size ? { text: "", test } : null);
        showOutcomes();
      });
      return button;
    }),
  );
}

function offerViews() {
  const varied = DATA.columns.filter((column) => column.varied && !("same" in column));
  const numbers = varied.filter((column) => !isText(column)), named = varied.find(isText);
  const has = (name) => byName.has(name) && !("same" in byName.get(name));
  const outcome = has("outcome") ? "outcome" : null;
  const views = [];
  const H = has("objective_integral") ? "objective_integral" : "error_rms";
  if (numbers.length > 1)
    views.push([`Basins over ${numbers[0].name}, ${numbers[1].name}`, { x: numbers[0].name, y: numbers[1].name, colour: outcome || H }]);
  if (has("effort"))
    views.push(["Error against effort", {
      x: "effort", y: "error_rms", colour: named ? named.name : outcome || H, front: true, logX: true, logY: true,
    }]);
  if (numbers.length) {
    const key = (numbers.find((column) => column.name.endsWith("alpha")) || numbers[0]).name;
    views.push([`${H === "error_rms" ? "Error" : "H"} against ${key}`, { x: key, y: H, colour: named ? named.name : "outcome" }]);
  }
  if (has("arrival") && numbers.length > 1)
    views.push(["Time of arrival", { x: numbers[0].name, y: numbers[1].name, colour: "arrival" }]);
  const show = ([, view]) => {
    for (const id of ["x", "y", "colour"]) $(id).value = view[id];
    $("front").checked = Boolean(view.front);
    $("log-x").checked = Boolean(view.logX);
    $("log-y").checked = Boolean(view.logY);
  };
  for (const view of views) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = view[0];
    button.addEventListener("click", () => { show(view); drawAll(); });
    $("presets").append(button);
  }
  show(views[0] || ["", { x: "index", y: "error_rms", colour: "outcome" }]);
}

function offerAxes() {
  const first = ["error_rms", "objective_integral", "arrival", "scale_min", "sigma_min", "effort"];
  const usable = differing.filter((column) => column.name !== "message" && column.name !== "index");
  parallel.names = usable
    .filter((column) => column.varied || column.name === "outcome" || first.includes(column.name))
    .map((column) => column.name);
  for (const column of usable) {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = parallel.names.includes(column.name);
    box.addEventListener("change", () => {
      const wanted = new Set(parallel.names);
      if (!wanted.delete(column.name)) wanted.add(column.name);
      parallel.names = usable.map((one) => one.name).filter((name) => wanted.has(name));
      drawParallel();
    });
    label.append(box, ` ${column.name}`);
    $("axes").append(label);
  }
}

function drawAll() {
  drawPoints();
  drawParallel();
  drawTable();
}

for (const id of ["x", "y", "colour"]) {
  for (const column of DATA.columns) {
    if (column.name === "message") continue;
    const option = document.createElement("option");
    Object.assign(option, { value: column.name, textContent: titled(column) });
    $(id).append(option);
  }
  $(id).addEventListener("change", drawAll);
}
for (const id of ["log-x", "log-y", "front"]) $(id).addEventListener("change", drawPoints);
for (const column of DATA.columns) {
  const name = document.createElement("dt"), about = document.createElement("dd");
  name.textContent = titled(column);
  about.textContent = column.about + ("same" in column ? `; the same in all: ${written(column.same, column)}` : "");
  $("columns").append(name, about);
}
showOutcomes();
offerViews();
offerAxes();
makeHead();
listeners.push(drawAll);
window.addEventListener("resize", drawAll);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
filtered();
