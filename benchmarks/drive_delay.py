"""How long it takes from a pointer's event in `nmm drive` to the first pose that shows it, on this machine.

A robot that rests is driven in a window of Chromium; its ball is pressed and moved by a mouse, 30 times. The
time runs from the event to the first pose that differs, and to the picture that draws it.

    python benchmarks/drive_delay.py
"""

from __future__ import annotations

import shutil
import threading

import numpy as np
from playwright.sync_api import sync_playwright

import nmm
from nmm.driving import RobotSetup
from nmm.driving.driven import Driven
from nmm.driving.session import DriveSession

DRAGS = 30
#: Told of each drag: ms from the event to the pose, and to the next animation frame after it.
WATCH = """() => {
  window.told = [];
  let [moved, before] = [null, ""];
  document.getElementById("view").addEventListener("pointermove", (event) => {
    if (nmm.gizmos.held && moved === null) moved = event.timeStamp;
  }, true);
  const pose = nmm.hooks.pose;
  nmm.hooks.pose = (command) => {
    pose(command);
    const now = JSON.stringify(command.transforms);
    if (moved > 0 && now !== before) {
      const [at, from] = [performance.now(), moved];
      moved = -1;
      requestAnimationFrame(() => window.told.push([at - from, performance.now() - from]));
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
        for k in range(DRAGS):
            page.keyboard.press("t")
            page.wait_for_timeout(400.0 + 7.0 * k)  # at rest, and at another phase of the pictures
            page.evaluate("again()")
            x, y = page.evaluate(BALL)
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 6.0, y + 4.0)
            page.wait_for_function(f"told.length > {k}", timeout=5000.0)
            page.mouse.up()
        told = np.array(page.evaluate("told"))
    print(f"control period {1e3 * setup.dt:g} ms, {threading.active_count()} threads, {DRAGS} drags")
    for name, times in zip(("to the pose", "to the picture"), told.T, strict=True):
        print(f"{name:16} median {np.median(times):5.1f} ms, most {times.max():5.1f} ms")


if __name__ == "__main__":
    main()
