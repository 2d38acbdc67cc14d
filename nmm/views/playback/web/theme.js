// Light or dark, as the reader's system has it.
"use strict";
{
  const wanted = matchMedia("(prefers-color-scheme: dark)");
  const theme = (nmm.theme = { dark: wanted.matches, listeners: [] });

  wanted.addEventListener("change", (event) => {
    theme.dark = event.matches;
    for (const listener of theme.listeners) listener();
    nmm.viewer.set_dirty();
  });

  // What is drawn almost black stands for ink: on a dark page it is light.
  const isInk = (rgb) => Math.max(...rgb) < 0.3;
  theme.paint = (rgb) => (theme.dark && isInk(rgb) ? rgb.map((c) => 0.95 - 0.6 * c) : rgb);
  theme.css = (rgb) => (isInk(rgb) ? "var(--ink)" : `rgb(${rgb.map((c) => Math.round(255 * c)).join(",")})`);
  theme.variable = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();
}
