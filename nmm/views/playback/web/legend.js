// The legend: what each sign is, and buttons that show and hide it.
"use strict";
{
  const list = document.getElementById("legend");
  const SIGNS = {
    line: '<path d="M2 6h20" stroke="currentColor" stroke-width="4" stroke-linecap="round"/>',
    thin: '<path d="M2 6h20" stroke="currentColor" stroke-width="1.6" stroke-linecap="round"/>',
    dashed: '<path d="M1 6h22" stroke="currentColor" stroke-width="3" stroke-dasharray="6 4"/>',
    box: '<path d="M5 1h14v10H5z" fill="currentColor"/>',
    grid: '<path d="M2 3.5h20M2 8.5h20M8 0v12M16 0v12" stroke="currentColor"/>',
    ball: '<circle cx="12" cy="6" r="5" fill="currentColor"/>',
  };

  nmm.sign = (kind, color, dash = []) => {
    const sign = document.createElement("span");
    sign.className = "sign";
    sign.style.color = typeof color === "string" ? color : nmm.theme.css(color);
    sign.innerHTML = `<svg viewBox="0 0 24 12" aria-hidden="true">${SIGNS[kind]}</svg>`;
    if (dash.length) {
      const line = sign.querySelector("path");
      line.setAttribute("stroke-dasharray", dash.join(" "));
      line.setAttribute("stroke-linecap", "butt");
    }
    return sign;
  };

  // path: a node that the entry shows and hides, or several; act(on): what it does instead; aside: whether a low window
  // leaves it out.
  nmm.legend = ({ kind, color, text, path, act, aside = path === undefined && act === undefined }) => {
    const fixed = path === undefined && act === undefined;
    if (fixed && text && [...list.children].some((item) => item.textContent === text)) return undefined;
    const item = document.createElement("li");
    item.classList.toggle("aside", aside);
    const holder = fixed ? item : item.appendChild(document.createElement("button"));
    holder.append(nmm.sign(kind, color), text);
    if (!fixed) {
      holder.type = "button";
      holder.setAttribute("aria-pressed", "true");
      holder.title = `Show or hide ${text}`;
      holder.addEventListener("click", () => {
        const on = holder.getAttribute("aria-pressed") !== "true";
        holder.setAttribute("aria-pressed", String(on));
        if (act) act(on);
        else for (const one of [path].flat()) nmm.node(one).visible = on;
        nmm.viewer.set_dirty();
      });
    }
    list.append(item);
    return item;
  };
}
