"""How long it takes from a pointer's event in `nmm drive` to the first pose that shows it, on this machine.

A robot that rests is driven in a window of Chromium; its ball is pressed and moved by a mouse, 30 times. The
time runs from the event to the first pose that differs. It is compared with two control periods and a frame,
the longest between two pictures of the window meanwhile. First the processor draws, as in all headless tests;
then nothing draws, so that a frame is what it is with a graphics card.

    python benchmarks/drive_delay.py
"""

from __future__ import annotations

import shutil

import numpy as np
from playwright.sync_api import Page, sync_playwright

import nmm
from nmm.plugins.live.driving import RobotSetup
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.session import DriveSession

DRAGS = 30
#: Told of each drag, ms: from the event to the pose, and the longest frame meanwhile.
WATCH = """() => {
  window.told = [];
  let [moved, before, last, longest] = [null, "", performance.now(), 0];
  const frame = (now) => {
    [longest, last] = [Math.max(longest, now - last), now];
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  for (const name of ["pointerrawupdate", "pointermove"]) window.addEventListener(name, (event) => {
    if (nmm.gizmos.held && moved === null) [moved, longest] = [event.timeStamp, 0];
  }, true);
  const pose = nmm.hooks.pose;
  nmm.hooks.pose = (command) => {
    pose(command);
    const now = JSON.stringify(command.transforms);
    if (moved > 0 && now !== before) {
      const [took, since] = [performance.now() - moved, performance.now() - last];
      moved = -1;
      window.told.push([took, Math.max(longest, since)]);
    }
    before = now;
  };
  window.again = () => (moved = null);
}"""
BALL = """() => {
  const { place } = nmm.gizmos.all[0];
  const p = new MeshCat.THREE.Vector3(place.x, place.z, -place.y).project(viewer.camera);
  const box = document.getElementById("view").getBoundingClientRect();
  return [box.left + (0.5 + 0.5 * p.x) * box.width, box.top + (0.5 - 0.5 * p.y) * box.height];
}"""


def main() -> None:
    robot = nmm.load("unicycle_3r")
    setup = RobotSetup(robot, [nmm.Position("ee")], robot.q({"q2": 0.8, "q3": 0.5}))
    session = DriveSession(Driven(setup))
    options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with session, sync_playwright() as playwright:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        page = playwright.chromium.launch(executable_path=path, args=options).new_page()
        page.set_viewport_size({"width": 900, "height": 500})
        page.goto(session.url)
        page.wait_for_function("window.nmm && nmm.drive && nmm.drive.time > 1 && nmm.gizmos.all.length > 0")
        page.evaluate(WATCH)
        print(f"control period {1e3 * setup.dt:g} ms, {DRAGS} drags each")
        for drawn in (True, False):
            if not drawn:
                page.evaluate("nmm.viewer.renderer.render = () => {}")
            told = dragged(page)
            enough = np.mean(told[:, 0] <= 2e3 * setup.dt + told[:, 1])
            print("drawn by the processor:" if drawn else "nothing drawn:")
            for name, times in zip(("to the pose", "a frame"), told.T, strict=True):
                print(f"  {name:12} median {np.median(times):5.1f} ms, most {times.max():5.1f} ms")
            print(f"  within two periods and a frame: {enough:.0%}")


def dragged(page: Page) -> np.ndarray:
    """Of each drag: from the event to the pose, and the longest frame meanwhile, ms."""
    page.evaluate("told.length = 0")
    for k in range(DRAGS):
        page.keyboard.press("t")
        page.wait_for_timeout(400.0 + 7.0 * k)  # at rest, and at another phase of the pictures
        page.evaluate("again()")
        x, y = page.evaluate(BALL)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 6.0, y + 4.0)
        page.wait_for_function(f"told.length > {k}", timeout=20000.0)
        page.mouse.up()
    return np.array(page.evaluate("told"))


if __name__ == "__main__":
    main()
