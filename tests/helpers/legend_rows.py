"""What a page's scene draws, and which row of its legend says what it is."""

from __future__ import annotations

import re

import numpy as np
from playwright.sync_api import Page

#: The nodes that are seen, by the first names of their paths, each with its parts' colours, sRGB.
DRAWN = """() => {
  const found = {};
  const named = ({ name }) => name && name !== "<object>";
  const shown = (node) => !node || (node.visible && shown(node.parent));
  viewer.scene.traverse((one) => {
    if (!(one.isLine || one.isMesh) || !shown(one)) return;
    const names = [];
    for (let part = one; part; part = part.parent) if (named(part)) names.unshift(part.name);
    const colors = (found[names.slice(2, 4).join("/")] ||= []);
    colors.push(one.material.color.clone().convertLinearToSRGB().toArray());
  });
  return found;
}"""
#: The legend's rows: what they say, and the colour of their signs, sRGB; null without one.
ROWS = """() => [...document.querySelectorAll("#legend li")].map((row) => {
  const sign = row.querySelector(".sign");
  const color = sign && getComputedStyle(sign).color.match(/[\\d.]+/g).slice(0, 3);
  return [row.textContent, color && color.map((c) => c / 255)];
})"""

#: What is no line, or is told from others without a legend: robots, bodies, axes with their letters, handles.
NO_LINE = re.compile(
    r"motion \d+/(robot|ghosts|believed|frustum.*|seen.*)|(obstacle|target|gizmo) \d+(/.*)?|axes"
    r"|plan/ghosts"
)
#: What the legend says of each line.
SAID = {
    r"ground": r"grid of \S+ m",
    r"motion \d+/path": r"end-effector|RG|PG|PLAN",
    r"motion \d+/platform": r"platform's path",
    r"motion \d+/plan": r"plan",
    r"motion \d+/nearest": r".+ and .+",
    r"motion \d+/rays \d+": r"seen",
    r"desired \d+": r"desired path",
    r"running driven": r"path of \w+",
    r"running desired": r"desired path",
    r"trail \d+": r"the last \d+ s of \w+",
    r"plan/\d+": r"plan",
    r"plan/tree": r"search tree",
}
#: The sign of lines of several colours, and of the grid, which fades.
GREY = [0.5, 0.55, 0.62]
#: Ink on paper is a little darker than in the scene, and on a dark page lighter.
ALIKE = 0.15


def lines_with_rows(page: Page) -> list[str]:
    """The lines that a page draws, by their nodes; each has a row in the legend, in its colour."""
    rows, lines = page.evaluate(ROWS), []
    for node, colors in page.evaluate(DRAWN).items():
        if NO_LINE.fullmatch(node):
            continue
        says = next((text for path, text in SAID.items() if re.fullmatch(path, node)), None)
        assert says is not None, f"{node} is drawn, and nothing says what its row in the legend is"
        signs = [sign for text, sign in rows if re.fullmatch(says, text)]
        assert signs, f"{node} is drawn, and the legend has no row {says!r}: {[text for text, _ in rows]}"
        off = min(np.abs(np.subtract(color, sign)).max() for color in [*colors, GREY] for sign in signs)
        assert off < ALIKE, f"{node} is {colors}, and its row's sign {signs}"
        lines.append(node)
    return sorted(lines)
