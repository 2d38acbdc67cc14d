"""Time to load robots, and what their meshes take once something draws or collides, all in one run:

    python benchmarks/loading.py

In ms of processor time, which other programs' work does not change much:

load    nmm.load, the best of five after the first, which has the imports
ready   a controller made and its first step taken, on top of that
meshes  the first robot.visual_model and robot.collision_model, and how many mesh files they hold
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import nmm
from nmm.model.robots.meshes import is_unread
from nmm.model.robots.reach import first_tip

PUBLIC = "package://example-robot-data/robots"
ROBOTS = {
    "unicycle_2r (xacro)": "unicycle_2r",
    "UR5": f"{PUBLIC}/ur_description/urdf/ur5_robot.urdf",
    "TIAGo without hand": f"{PUBLIC}/tiago_description/robots/tiago_no_hand.urdf",
    "TIAGo": f"{PUBLIC}/tiago_description/robots/tiago.urdf",
    "Kinova": f"{PUBLIC}/kinova_description/robots/kinova.urdf",
    "Z1": f"{PUBLIC}/z1_description/urdf/z1.urdf",
    "Go1": f"{PUBLIC}/go1_description/urdf/go1.urdf",
}
TIMES = 5

Made = TypeVar("Made")


def timed(make: Callable[[], Made]) -> tuple[float, Made]:
    """How long it takes this process, ms, and what it makes."""
    start = time.process_time()
    made = make()
    return 1e3 * (time.process_time() - start), made


def first_step(robot: nmm.Robot) -> None:
    """A controller that holds the end effector where it is, and one step of it."""
    frame = first_tip(robot) or robot.frames[-1]
    task = nmm.Task(nmm.Position(frame, "xy"), [0.0, 0.0], 1.0)
    nmm.Controller(robot, task, nmm.ProjectedGradient())(0.0, robot.rest)


def row(name: str, source: str) -> str:
    """A robot's line of the table."""
    first_step(nmm.load(source))  # imports and compiled code are others' time
    tries = [timed(lambda: nmm.load(source)) for _ in range(TIMES)]
    load, robot = min(tries, key=lambda pair: pair[0])
    ready, _ = timed(lambda: first_step(robot))
    shapes = [shape for model in robot.shapes for shape in model.geometryObjects]
    files = {shape.meshPath for shape in shapes if is_unread(shape)}
    meshes, _ = timed(lambda: (robot.visual_model, robot.collision_model))
    return f"{name:<22}{robot.n:>4}{load:>10.1f}{ready:>10.1f}{meshes:>10.1f}{len(files):>7}"


def main() -> None:
    print(f"{'robot':<22}{'n':>4}{'load':>10}{'ready':>10}{'meshes':>10}{'files':>7}")
    for name, source in ROBOTS.items():
        print(row(name, source))


if __name__ == "__main__":
    main()
