// What may be chosen while one drives: a control each, in groups.
"use strict";
{
  const controls = new Map();
  let shown = null;

  nmm.hooks.choices = ({ choices, color }) => {
    nmm.runs[0].color = color;
    const keys = choices.map(({ key, options }) => `${key} ${options}`).join();
    if (keys !== shown) {
      shown = keys;
      controls.clear();
      const all = document.getElementById("choices");
      all.replaceChildren();
      const groups = new Map();
      for (const choice of choices) {
        if (!groups.has(choice.group)) {
          const part = nmm.element(all, "details", /^(Weights|Jog)/.test(choice.group) ? {} : { open: "" });
          nmm.element(part, "summary", {}, choice.group);
          groups.set(choice.group, part);
        }
        controls.set(choice.key, control(groups.get(choice.group), choice));
      }
    }
    for (const { key, value } of choices) controls.get(key)(value);
  };

  // Makes the control of a choice, and returns what shows its value.
  function control(part, choice) {
    const { key, text, unit, options, least, most } = choice;
    const line = nmm.element(part, "label", { class: "choice" });
    nmm.element(line, "span", {}, unit ? `${text} [${unit}]` : text);
    const pick = (value) => nmm.send({ type: "pick", key, value });
    if (typeof choice.value === "boolean") {
      const box = nmm.element(line, "input", { type: "checkbox", "data-key": key });
      box.addEventListener("change", () => pick(box.checked));
      return (value) => (box.checked = value);
    }
    if (options.length) {
      const list = nmm.element(line, "select", { "data-key": key });
      for (const option of options) nmm.element(list, "option", { value: option }, option.toUpperCase());
      list.addEventListener("change", () => pick(list.value));
      return (value) => (list.value = value);
    }
    // A slider along the logarithm.
    const slider = nmm.element(line, "input", { type: "range", min: Math.log(least), max: Math.log(most), step: "any", "data-key": key });
    const output = nmm.element(line, "output");
    const told = (value) => {
      output.textContent = value.toPrecision(3);
      slider.setAttribute("aria-valuetext", `${output.textContent} ${unit}`);
    };
    const chosen = () => Math.min(Math.max(Math.exp(Number(slider.value)), least), most);
    slider.addEventListener("input", () => told(chosen()));
    slider.addEventListener("change", () => pick(chosen()));
    return (value) => {
      if (document.activeElement === slider && slider.matches(":active")) return;
      slider.value = Math.log(value);
      told(value);
    };
  }
}
