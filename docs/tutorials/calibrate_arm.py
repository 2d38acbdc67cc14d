"""An arm that is not quite the one of its file, and a laser tracker: a table for `nmm calibrate`."""

import numpy as np
from scipy.optimize import least_squares

import nmm

#: The arm that stands there: zeros, m and rad, that are off, and links that are. Only this file knows.
THERE = {
    "offset.q2": 0.021,
    "offset.q3": -0.034,
    "offset.q4": 0.015,
    "origin.q3.z": 0.0021,
    "origin.q4.z": -0.0013,
    "origin.q3.yaw": 0.008,
}
JOINTS = ("q1", "q2", "q3", "q4", "q5")
#: Where the ball sits on the hand, m, and the tracker in the hall: m, and turned by rad about the vertical.
BALL, TRACKER, TURNED = np.array([0.03, 0.02, 0.01]), np.array([2.4, -1.1, 0.9]), 2.2
#: Points to touch with the tip, m.
POINTS = [[0.35 * np.cos(a), 0.35 * np.sin(a), z] for a in (-0.8, -0.2, 0.4, 1.0) for z in (0.25, 0.45)]


def tip(robot, q):
    """Where an arm's tip is (3,), m."""
    return nmm.Configuration(robot, q).placement("ee").translation


def there(readings):
    """The configuration in which the arm that stands there is, as its encoders read so, by joint."""
    robot = nmm.with_numbers(nmm.load("small_arm"), THERE)
    return robot, robot.q_from(readings, base=[0.0, 0.0, 0.0])


def touched(robot):
    """How far from each point the tip ends, mm, if the arm is moved by a robot's numbers."""
    off, free = [], [robot.coordinate(name) for name in JOINTS]
    for point in POINTS:

        def missed(x, point=point):
            q = robot.rest.copy()
            q[free] = x
            return np.concatenate([tip(robot, q) - point, 1e-6 * x])

        x = least_squares(missed, [np.arctan2(point[1], point[0]), 0.4, 0.8, 0.3, 0.0]).x
        readings = {name: robot.reading(name, value) for name, value in zip(JOINTS, x, strict=True)}
        off.append(1000.0 * np.linalg.norm(tip(*there(readings)) - point))
    return f"{len(off)} points are missed by {np.mean(off):.1f} mm, {np.max(off):.1f} mm at most"


def table(count=60):
    """touched.csv: what encoders read, in degrees, and where the tracker sees the ball, in mm."""
    robot, rng = nmm.load("small_arm"), np.random.default_rng(4)
    limits = robot.q_limits[[robot.coordinate(name) for name in JOINTS]].clip(-1.9, 1.9)
    c, s = np.cos(TURNED), np.sin(TURNED)
    turn, rows = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), []
    for row in np.round(np.degrees(rng.uniform(*limits.T, (count, 5))), 3):
        at = nmm.Configuration(*there(dict(zip(JOINTS, np.radians(row), strict=True)))).placement("ee")
        seen = turn.T @ (at.act(BALL) - TRACKER) + 1e-4 * rng.normal(size=3)
        rows.append([*row, *(1000.0 * seen)])
    rows[17][5] += 40.0  # the beam was broken
    np.savetxt("touched.csv", rows, "%.3f", ",", header=",".join([*JOINTS, "x", "y", "z"]), comments="")


if __name__ == "__main__":
    print("by the file's numbers", touched(nmm.load("small_arm")))
    table()
    print("written: touched.csv")
