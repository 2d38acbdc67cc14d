// A page inside another one: wheel and touch belong to the reader, who scrolls, until he clicks into it.
"use strict";
if (window.parent !== window) {
  const view = document.getElementById("view");
  const { classList } = document.body;
  const TOLD = 1500; // ms
  let telling;
  const sleep = () => classList.add("asleep");
  const wake = () => classList.remove("asleep", "told");

  function pass(event) {
    if (!classList.contains("asleep")) return;
    if (event.type === "wheel") event.stopPropagation(); // over the plots, too
    if (!view.contains(event.target) || (event.type === "pointerdown" && event.pointerType !== "touch")) return;
    event.stopPropagation();
    clearTimeout(telling);
    classList.add("told");
    telling = setTimeout(() => classList.remove("told"), TOLD);
  }
  for (const kind of ["wheel", "pointerdown"]) window.addEventListener(kind, pass, { capture: true, passive: true });
  window.addEventListener("pointerdown", ({ pointerType }) => pointerType !== "touch" && wake(), true);
  window.addEventListener("click", wake, true);
  window.addEventListener("blur", sleep);
  sleep();
}
