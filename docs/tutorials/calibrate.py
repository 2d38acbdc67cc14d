"""Drives of a robot that is not quite the one of its file: two tables for `nmm calibrate`, and a square."""

import numpy as np

import nmm

WHEELS = ("left_wheel_joint", "right_wheel_joint")
#: The robot that stands there: worn wheels, and a track that is wider on the ground. Only this file knows.
THERE = {"radius.left_wheel_joint": 0.0986, "radius.right_wheel_joint": 0.0994, "track": 0.54}
#: Where motion capture has its marker on the robot, m, m, rad, and how late it stamps, s.
MARKER, LATE = (0.18, -0.06, 0.05), 0.04
TICKS = 2048


def turns(robot, ways, headings):
    """Angles of both wheels (N, 2), rad, for ways (N,), m, and headings (N,), rad, by a robot's numbers."""
    left, right, track = (nmm.robot_numbers(robot)[name].value for name in THERE)
    return np.stack([(ways - headings * track / 2) / left, (ways + headings * track / 2) / right], axis=1)


def driven(angles, slip=0.01, seed=1):
    """Where the robot that stands there goes (N, 3), x, y, heading, as its wheels turn, which slip a bit."""
    rng = np.random.default_rng(seed)
    steps = np.diff(angles, axis=0)
    steps += slip * np.sqrt(np.abs(steps)) * rng.normal(size=steps.shape)
    rolled = angles[0] + np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    robot = nmm.with_numbers(nmm.load("differential_base"), THERE)
    odometry = robot.odometry(robot.rest, dict(zip(WHEELS, rolled[0], strict=True)))
    return np.array([odometry.update(dict(zip(WHEELS, row, strict=True))) for row in rolled])[:, :3]


def square(robot, side=3.0):
    """Wheels' angles for a square: four sides, with a quarter turn to the left after each."""
    share = np.linspace(0.0, 1.0, 101)[1:]
    ways, headings = [0.0], [0.0]
    for _ in range(4):
        ways += [*(ways[-1] + side * share), *[ways[-1] + side] * 100]
        headings += [*[headings[-1]] * 100, *(headings[-1] + np.pi / 2 * share)]
    return turns(robot, np.array(ways), np.array(headings))


def told(path):
    """How far from where it began a square ends, in words."""
    off, turned = np.hypot(*path[-1, :2]), np.degrees(path[-1, 2] - 2 * np.pi)
    far = "far" if turned > 0 else "little"
    return f"ends {1000 * off:.0f} mm from where it began, turned {abs(turned):.1f}° too {far}"


def logs():
    """drive.csv: both encoders at 50 Hz, ms and ticks; seen.csv: motion capture at 10 Hz."""
    t = np.linspace(0.0, 90.0, 4501)
    speed = 0.4 + 0.2 * np.sin(0.5 * t)
    rate = 0.5 * np.cos(0.35 * t) + 0.4 * np.sin(0.9 * t)
    angles = turns(nmm.load("differential_base"), np.cumsum(speed) * 0.02, np.cumsum(rate) * 0.02)
    x, y, heading = driven(angles)[::5].T
    c, s = np.cos(heading), np.sin(heading)
    seen = np.stack(
        [x + c * MARKER[0] - s * MARKER[1], y + s * MARKER[0] + c * MARKER[1], heading + MARKER[2]]
    )
    seen += np.random.default_rng(2).normal(size=seen.shape) * [[0.003], [0.003], [0.004]]
    table = np.column_stack([1000 * t, np.round(angles * TICKS / (2 * np.pi))])
    np.savetxt("drive.csv", table, "%d", ",", header=",".join(["ms", *WHEELS]), comments="")
    mocap = np.column_stack([t[::5] + LATE, *seen])
    np.savetxt("seen.csv", mocap, "%.5f", ",", header="t,x,y,theta", comments="")


if __name__ == "__main__":
    print("a square by the file's numbers", told(driven(square(nmm.load("differential_base")))))
    logs()
    print("written: drive.csv, seen.csv")
