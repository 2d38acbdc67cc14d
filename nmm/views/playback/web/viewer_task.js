// What the robot can do for a task where the sliders are. The page asks, and the program answers.
"use strict";
{
  const THREE = MeshCat.THREE;
  const NAMES = { robot: "whole robot", arm: "arm alone" };
  const ROWS = [
    ["rank", "rank of J"],
    ["sigma_min", "σ_min"],
    ["sigma_max", "σ_max"],
    ["condition", "condition"],
    ["manipulability", "√det(J Jᵀ)"],
  ];
  const task = (nmm.task = { asked: 0, answered: 0, answer: null });
  const parts = {};
  let [cells, arrows, size, stale, count] = [{}, [], 0, false, 0];

  const told = (key, value) => {
    if (value === null) return "∞";
    if (key === "rank") return `${value} of ${count}`;
    return value === 0 ? "0" : (Math.abs(value) < 1e-4 ? value.toExponential(2) : value.toPrecision(4)).replace("e-", "e−");
  };

  nmm.hooks.viewed_task = ({ rows, parts: names, length }) => {
    size = length;
    count = rows.length;
    const part = nmm.element(nmm.panel, "section", { id: "task", "aria-label": "Task" });
    const head = nmm.element(part, "div", { class: "head" });
    nmm.element(head, "h2", {}, "Task");
    nmm.element(part, "p", { class: "quiet" }, rows.join(", "));
    const table = nmm.element(part, "table");
    const top = nmm.element(nmm.element(table, "thead"), "tr");
    nmm.element(top, "td");
    for (const name of names) nmm.element(top, "th", { scope: "col" }, NAMES[name]);
    const body = nmm.element(table, "tbody");
    for (const [key, text] of ROWS) {
      const row = nmm.element(body, "tr");
      nmm.element(row, "th", { scope: "row" }, text);
      for (const name of names) cells[`${name} ${key}`] = nmm.element(row, "td", { "data-value": `${name} ${key}` });
    }
    parts.words = nmm.element(part, "p", { id: "lost", role: "status" });
  };

  // Something seen through what is before it, in the colour of an alarm.
  const material = () => new THREE.MeshBasicMaterial({ color: 0xc62828, transparent: true, opacity: 0.85, depthTest: false });

  // Both ways along z: a direction has no sign.
  function arrow() {
    const group = new THREE.Group();
    const [radius, head] = [0.018 * size, 0.16 * size];
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 2 * (size - head), 12), material());
    shaft.rotation.x = Math.PI / 2;
    group.add(shaft);
    for (const sign of [1, -1]) {
      const tip = new THREE.Mesh(new THREE.ConeGeometry(3 * radius, head, 16), material());
      tip.rotation.x = (sign * Math.PI) / 2;
      tip.position.z = sign * (size - 0.5 * head);
      group.add(tip);
    }
    return group;
  }
  // A turn about z: a ring around its axis.
  function ring() {
    const group = new THREE.Group();
    const axis = new THREE.Mesh(new THREE.CylinderGeometry(0.01 * size, 0.01 * size, size, 8), material());
    axis.rotation.x = Math.PI / 2;
    group.add(axis, new THREE.Mesh(new THREE.TorusGeometry(0.4 * size, 0.018 * size, 10, 48), material()));
    return group;
  }

  function drawArrows(wanted) {
    for (const old of arrows) old.removeFromParent();
    arrows = wanted.map(({ kind, at, along }, i) => {
      const made = kind === "moves" ? arrow() : ring();
      made.position.fromArray(at);
      made.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3().fromArray(along));
      made.traverse((object) => (object.renderOrder = 800));
      nmm.node(`/nmm/lost/${i}`).add(made);
      return made;
    });
  }

  const SENTENCES = {
    fine: () => "No direction of the task is lost.",
    near: (words) => `Nearly lost: ${words}.`,
    lost: (words) => `Lost: no input gives ${words}.`,
  };

  nmm.hooks.task = (answer) => {
    const { number, problem, state, words, parts: numbers, ellipsoids, arrows: wanted } = answer;
    Object.assign(task, { answered: number, answer });
    for (const cell of Object.values(cells)) cell.textContent = "–";
    for (const part of numbers) for (const [key] of ROWS) cells[`${part.name} ${key}`].textContent = told(key, part[key]);
    const text = problem ? `There is no J: ${problem}` : SENTENCES[state](words.join("; "));
    if (parts.words.textContent !== text) parts.words.textContent = text;
    parts.words.className = problem ? "lost" : state;
    for (const group of nmm.ellipsoids || []) for (const one of group.children) one.visible = !problem;
    for (const [path, matrix] of ellipsoids) nmm.viewer.set_transform(nmm.split(path), matrix);
    drawArrows(wanted);
    nmm.viewer.set_dirty();
  };

  // The ends of the ellipsoids' axes and of the arrows.
  nmm.joints.beside.push(() => {
    const ends = [];
    const add = (node, lengths) => {
      node.updateWorldMatrix(true, false);
      for (const axis of [0, 1, 2]) {
        for (const sign of [1, -1]) {
          const point = new THREE.Vector3().setComponent(axis, sign * lengths[axis]);
          ends.push(point.applyMatrix4(node.matrixWorld));
        }
      }
    };
    for (const [path] of task.answer?.ellipsoids ?? []) add(nmm.node(path), [1, 1, 1]);
    for (const made of arrows) add(made, [0, 0, size]);
    return ends;
  });

  // One question at a time: where the sliders are once the last one is answered.
  function ask() {
    requestAnimationFrame(ask);
    if (!stale || task.answered < task.asked || !count) return;
    const q = nmm.joints.coordinates.map(({ value }) => Number(value.toPrecision(12)));
    if (!nmm.send({ type: "at", number: task.asked + 1, q })) return;
    task.asked += 1;
    stale = false;
  }
  nmm.joints.listeners.push(() => (stale = true));
  requestAnimationFrame(ask);
}
