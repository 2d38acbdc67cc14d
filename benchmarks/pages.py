"""How long a page takes to its first pose, and a frame of it, in Chromium, with OpenGL by the processor:

    python benchmarks/pages.py                                   printed
    python benchmarks/pages.py --markdown docs/performance.md    into that page

A page with ghosts is opened five times; times are medians. The first pose counts from the start of navigation
to the second frame after the page is ready; a frame is a seek, a picture of the scene and the wait for its
pixels, in 1280 x 720 px, without plots.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path

from machine import described
from tables import Section, into, text

import nmm
from nmm.plugins.live.rendering.chromium import HeadlessPage
from nmm.views.playback import write_html

SIZE, OPENED, FRAMES = (1280, 720), 5, 12
FIRST_POSE = "performance.getEntriesByName('nmm first pose')"
FRAME = f"""(() => {{
  nmm.plots.show(false);
  nmm.camera.reset();
  const {{ renderer, scene, camera }} = nmm.viewer;
  const gl = renderer.getContext();
  const times = [];
  for (let k = 0; k < {FRAMES}; k++) {{
    const start = performance.now();
    nmm.player.seek((k / {FRAMES}) * nmm.stage.duration);
    renderer.render(scene, camera);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    times.push(performance.now() - start);
  }}
  return [times.sort((a, b) => a - b)[{FRAMES} / 2], renderer.info.render.triangles];
}})()"""


def measured(name: str, runs: Sequence[nmm.Trajectory]) -> list[str]:
    """A row: to the first pose, s, a frame, ms, its triangles, and the page's size, MB."""
    opened, frames, triangles = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        page = write_html(runs, Path(folder) / "page.html")
        for _ in range(OPENED):
            with HeadlessPage(page, SIZE) as browser:
                browser.wait_for(f"{FIRST_POSE}.length")
                opened.append(browser.evaluate(f"{FIRST_POSE}[0].startTime"))
                frame, triangles = browser.evaluate(FRAME)
                frames.append(frame)
        size = page.stat().st_size / 1e6
    times = f"{statistics.median(opened) / 1e3:.2f}", f"{statistics.median(frames):.0f}"
    return [name, *times, f"{triangles:,}", f"{size:.1f}"]


def pages() -> Section:
    """The table."""
    tiago, planar = nmm.Scenario.load("tiago_pose"), nmm.Scenario.load("unicycle_2r_position")
    three = [tiago.with_resolver(name).run() for name in ("pg", "rg", "dls")]
    shown = {"unicycle_2r": [planar.run()], "TIAGo": three[:1], "three TIAGos compared": three}
    heads = ["page", "first pose, s", "frame, ms", "triangles of a frame", "MB"]
    return Section("pages", described(), heads, [measured(*one) for one in shown.items()], [])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--markdown", type=Path, metavar="PAGE", help="a page with the mark <!-- pages -->")
    asked = parser.parse_args()
    section = pages()
    print(text(section))
    if asked.markdown:
        into(asked.markdown, [section])


if __name__ == "__main__":
    main()
