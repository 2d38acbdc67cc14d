"""What a plan costs that does not exist, and what is said:

python benchmarks/planning_impossible.py [SECONDS]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from planning import DISTANCE, LIMITS, UP, Scene, box, u_shaped_wall, ur5_on
from planning import table as beneath_table

import nmm


def closed(x: float, half: float) -> list[nmm.Obstacle]:
    """Four walls about (x, 0)."""
    return [
        box("front", (x - half - 0.1, -half, 0.0), (x - half, half, 2.0)),
        box("back", (x + half, -half, 0.0), (x + half + 0.1, half, 2.0)),
        box("left", (x - half, half, 0.0), (x + half, half + 0.1, 2.0)),
        box("right", (x - half, -half - 0.1, 0.0), (x + half, -half, 2.0)),
    ]


def scenes() -> dict[str, Scene]:
    robot, there = ur5_on("differential_base"), {"x": 5.0, "y": 0.0, "theta": 0.0}
    covered = nmm.Task(nmm.Position("ur5_ee_link"), [3.0, 0.0, 0.4])
    block = box("table", (2.5, -0.5, 0.0), (3.5, 0.5, 0.7))
    far = nmm.Task(nmm.Position("ur5_ee_link"), [3.0, 0.0, 3.0])
    wall = box("wall", (4.8, -0.2, 0.0), (5.2, 0.2, 1.0))
    return {
        "walls around the goal": Scene(robot, UP, there, closed(5.0, 1.2)),
        "walls around the start": Scene(robot, UP, there, closed(0.0, 1.2)),
        "a target inside a table": Scene(robot, UP, covered, [block]),
        "a target out of reach": Scene(robot, UP, far, [block]),
        "a wall where the platform shall stand": Scene(robot, UP, there, [wall]),
    }


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    for kind in (u_shaped_wall, beneath_table):  # what is compiled once is no part of a plan
        nmm.plan(*kind(np.random.default_rng(0)))
    for name, scene in scenes().items():
        begin = time.process_time()
        try:
            nmm.plan(*scene, nmm.Collisions(DISTANCE), LIMITS, seconds=seconds)
            said = "a plan"
        except nmm.NmmError as error:
            said = str(error)
        print(f"{name:38}{time.process_time() - begin:7.2f} s  {said}", flush=True)


if __name__ == "__main__":
    main()
