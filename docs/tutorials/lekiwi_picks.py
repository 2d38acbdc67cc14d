"""50 episodes in which a robot like LeKiwi drives up to a cube and picks it up: a data set of LeRobot's.

python lekiwi_picks.py [FOLDER] [EPISODES] (docs/data_sets.md)
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

import nmm

ROBOT = nmm.load(Path(__file__).with_name("lekiwi.urdf.xacro"))
OPEN, CLOSED, CUBE = 1.2, 0.25, 0.02  # rad; the cube's middle above the floor, m
#: Where the arm rests: folded over the base, the gripper ahead and down.
REST = {"arm_shoulder_lift": -0.9, "arm_elbow_flex": 1.2, "arm_wrist_flex": 0.7, "arm_gripper": CLOSED}


def through(times: list[float], points: list, unit: str) -> nmm.extending.PiecewisePolynomial:
    """By way of the points, and between any two of them not beyond them: a jaw has an end."""
    path = PchipInterpolator(times, points)
    return nmm.extending.PiecewisePolynomial(path.x, path.c, unit)


def controller(cube: np.ndarray) -> nmm.Controller:
    """The gripper's tip goes above the cube, down to it and up with it; the jaw opens and closes."""
    tip = nmm.Configuration(ROBOT, ROBOT.q(REST)).placement("tip").translation
    above = cube + np.array([0.0, 0.0, 0.1])
    path = through([0.0, 5.0, 6.5, 7.5, 9.0], [tip, above, cube, cube, above], "m")
    jaw = through([0.0, 3.0, 6.5, 7.3, 9.0], [[CLOSED], [OPEN], [OPEN], [CLOSED], [CLOSED]], "rad")
    pitch = dict.fromkeys(("arm_shoulder_lift", "arm_elbow_flex", "arm_wrist_flex"), 1.0)
    tasks = [
        nmm.Task(nmm.Position("tip", "xyz"), path, gain=2.0),
        nmm.Task(nmm.LinearCoordinates("arm_gripper"), jaw, gain=2.0),
        nmm.Task(nmm.LinearCoordinates(pitch), [1.2], gain=2.0),
    ]
    return nmm.Controller(
        ROBOT, tasks, nmm.ProjectedGradient(alpha=1.0), nmm.PreferredPosture(REST), limits=nmm.Limits()
    )


def picks(count: int) -> Iterator[nmm.Trajectory]:
    rng = np.random.default_rng(0)
    for _ in range(count):
        cube = np.array([rng.uniform(0.5, 0.9), rng.uniform(-0.3, 0.3), CUBE])
        yield nmm.simulate(controller(cube), ROBOT.q(REST), 9.0, 1 / 60, "zoh")


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "picks"
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    nmm.write_lerobot(picks(count), folder, task="drive up to the cube and pick it up", fps=30)
    print(f"{count} episodes in {folder}")
