"""What visual servoing with a pan-tilt camera on wheels bears: `python benchmarks/seeing.py [--only NAME]`.

starts   of 200 random starts with a board in view, how many bring it to the middle, 1 m ahead, in 15 s or
         60 s; how many keep it in the picture, and the joints within limits
faults   of 12 of these, with measured points: by the depth that is believed over the true one at first, given
         and observed, and by what the camera does
depth    the error of an observed depth after 10 s, in the mean of 100 runs, by three estimators
delay    K tau from which a head that turns to a ball is unstable without foresight, and with it
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np

import nmm
from nmm.control.functions.tasks.depth_estimate import DepthEstimate

Array = np.ndarray
PIXELS, SIZE = [525.0, 525.0, 319.5, 239.5], np.array([640.0, 480.0])
ROBOT = nmm.load("unicycle_pan_tilt")
BOARD = [[2.0, y, 0.6 + z] for y, z in ((0.15, 0.15), (-0.15, 0.15), (-0.15, -0.15), (0.15, -0.15))]
GOAL = np.array([*PIXELS[2:], np.log(PIXELS[0] * np.sqrt(2.0) * 0.15)])
POINTS = nmm.ImagePoints(BOARD, intrinsics=PIXELS)
MOMENTS = nmm.ImageMoments(BOARD, intrinsics=PIXELS)


def value(function: nmm.extending.Function, q: Array) -> Array:
    return nmm.evaluate(function, 0.0, nmm.Configuration(ROBOT, q)).value


def in_view(q: Array, margin: float = 0.0) -> bool:
    seen = value(POINTS, q).reshape(-1, 2)
    return bool(np.all((seen >= margin) & (seen <= SIZE - margin)))  # not numbers are not in view


def random_starts(count: int) -> Array:
    """Up to 3 m from the board, 1 rad to its side, whatever the platform's heading and the head's angles."""
    rng, starts = np.random.default_rng(0), []
    while len(starts) < count:
        d, b = rng.uniform(0.9, 3.0), rng.uniform(-1.0, 1.0)
        turned = rng.uniform(-np.pi, np.pi), rng.uniform(-2.5, 2.5), rng.uniform(-0.6, 0.6)
        q = np.array([2.0 - d * np.cos(b), d * np.sin(b), *turned])
        if in_view(q, 20.0):
            starts.append(q)
    return np.array(starts)


def controller(points: Any, limits: nmm.Limits | None = None) -> nmm.Controller:
    task = nmm.Task(nmm.ImageMoments(points, intrinsics=PIXELS), GOAL, gain=0.7)
    straight = nmm.Quadratic(nmm.QuadraticTerm("pan", 0.0))
    return nmm.Controller(ROBOT, task, nmm.ReducedGradient(alpha=1.0), straight, limits=limits, dt=0.02)


def runs(
    points: Any, starts: Array, limits: nmm.Limits | None = None, seconds: float = 15.0
) -> tuple[int, int, int]:
    """How many reach it (3 px, 3 % of its size), lose a corner on the way, or leave joint limits."""
    found = nmm.rollout(controller(points, limits), starts, seconds, 0.02, "zoh", keep=["q"])
    reached = lost = beyond = 0
    for q, samples in zip(found["q"], found.samples, strict=True):
        off = np.abs(value(MOMENTS, q[samples - 1]) - GOAL)
        reached += samples == len(found.t) and off[:2].max() < 3.0 and off[2] < 0.03
        lost += not all(in_view(one) for one in q[:samples:5])
        beyond += bool(np.any(ROBOT.outside(q[:samples][np.abs(q[:samples, 3:]).max(axis=1).argmax()])))
    return int(reached), lost, beyond


def starts() -> None:
    given = random_starts(200)
    edge = nmm.Bound(POINTS, np.tile([10.0, 10.0], 4), np.tile(SIZE - 10.0, 4))
    for name, limits, seconds in (
        ("no limits", None, 15.0),
        ("the robot's own", nmm.Limits(), 15.0),
        ("and the picture's edge", nmm.Limits(bounds=edge), 15.0),
        ("and accelerations of 4", nmm.Limits(acceleration=4.0, bounds=edge), 15.0),
        ("the same, 60 s", nmm.Limits(acceleration=4.0, bounds=edge), 60.0),
    ):
        print(
            f"{name:24} reached {{}}, corner lost {{}}, joint limits left {{}}".format(
                *runs(BOARD, given, limits, seconds)
            )
        )


def faults() -> None:
    given = random_starts(12)
    cameras: dict[str, dict[str, Any]] = {
        "30 Hz": {},
        "0.2 s late": {"latency": 0.2},
        "0.5 s late, 10 Hz": {"latency": 0.5, "rate": 10.0},
        "2 px, 30 % dropped": {"noise": 2.0, "dropped": 0.3},
        "all of that, 1 px": {"latency": 0.2, "noise": 1.0, "dropped": 0.3, "whole": True},
    }
    shares = (0.3, 0.5, 0.7, 1.0, 1.5, 3.0)
    for observed in (False, True):
        print("depth observed from" if observed else "depth given as", "times 1.5 m:", *shares)
        for name, camera in cameras.items():
            counts = []
            for share in shares:
                seen = nmm.CameraFaults(**camera)
                points = nmm.MeasuredPoints(
                    BOARD, intrinsics=PIXELS, depth=1.5 * share, observed=observed, faults=seen
                )
                counts.append(runs(points, given)[0])
            print(f"  {name:20}", *counts)


class WorldPoint:
    """An extended Kalman filter whose state is the point."""

    def __init__(self, depth: float, noise: float) -> None:
        self.depth, self.noise, self.p = depth, noise, None

    def update(self, t: float, x: float, y: float, R: Array, c: Array) -> Array:
        ray = R @ [x, y, 1.0]
        if self.p is None:
            along = np.outer(ray, ray) / (ray @ ray)
            self.P = (0.5 * self.depth) ** 2 * along + (self.noise * self.depth) ** 2 * (np.eye(3) - along)
            self.p = c + self.depth * ray
            return self.p
        X, Y, Z = R.T @ (self.p - c)
        Z = max(Z, 0.05 * self.depth)
        H = np.array([[1.0, 0.0, -X / Z], [0.0, 1.0, -Y / Z]]) @ R.T / Z
        gain = np.linalg.solve(H @ self.P @ H.T + self.noise**2 * np.eye(2), H @ self.P).T
        self.p = self.p + gain @ [x - X / Z, y - Y / Z]
        kept = np.eye(3) - gain @ H
        self.P = kept @ self.P @ kept.T + self.noise**2 * gain @ gain.T
        return self.p


class Observer:
    """A. De Luca, G. Oriolo, P. Robuffo Giordano, Feature depth observation for image-based visual servoing,
    IJRR 27 (2008): a copy of the motion of (x, y, 1/Z), with feedback of x and y. The camera does not turn
    here."""

    def __init__(self, depth: float, noise: float, k1: float = 10.0, k2: float = 60.0) -> None:
        self.k1, self.k2, self.z, self.depth = k1, k2, None, depth

    def update(self, t: float, x: float, y: float, R: Array, c: Array) -> Array:
        if self.z is None:
            self.z = np.array([x, y, 1.0 / self.depth])
        else:
            v, h = R.T @ (c - self.c) / (t - self.t), (t - self.t) / 20
            for _ in range(20):
                a, b, chi = self.z
                flow, off = np.array([a * v[2] - v[0], b * v[2] - v[1]]), np.array([x - a, y - b])
                rate = [*(flow * chi + self.k1 * off), v[2] * chi**2 + self.k2 * flow @ off]
                self.z = self.z + h * np.array(rate)
            self.z[2] = min(max(self.z[2], 0.02 / self.depth), 50.0 / self.depth)
        self.t, self.c = t, c
        return c + R @ [x, y, 1.0] / self.z[2]


def depth() -> None:
    made: dict[str, Callable[[float, float], Any]] = {
        "inverse depth": DepthEstimate,
        "point": WorldPoint,
        "observer, k2 60": Observer,
        "observer, k2 2000": lambda depth, noise: Observer(depth, noise, 30.0, 2000.0),
    }
    speeds = {"across": [0.1, 0.03, 0.0], "ahead": [0.0, 0.0, 0.1], "still": [0.0, 0.0, 0.0]}
    for name, make in made.items():
        print(name)
        for motion, v in speeds.items():
            row = []
            for guess in (0.5, 1.5):
                off = []
                for seed in range(100):
                    rng = np.random.default_rng(seed)
                    point = np.array([0.3, 0.1, 2.0]) + rng.uniform(-0.2, 0.2, 3)
                    estimate = make(guess * point[2], 1e-3)
                    for k in range(300):
                        c = np.array(v) * k / 30.0
                        seen = (point - c)[:2] / (point - c)[2] + 1e-3 * rng.standard_normal(2)
                        found = estimate.update(k / 30.0, *seen, np.eye(3), c)
                    off.append(abs((found - c)[2] / (point - c)[2] - 1.0))
                row.append(f"{100 * np.mean(off):.2f} % (at most {100 * np.max(off):.2f})")
            print(f"  {motion:8} from 0.5: {row[0]}, from 1.5: {row[1]}")


def last_over_first(product: float, compensated: bool, gain: float = 2.0, dt: float = 0.005) -> float:
    head = nmm.load("unicycle_pan_tilt", platform="fixed")
    ball, seen = nmm.MeasuredPoints([[2.0, 0.5, 0.6]]), nmm.ImagePoints([[2.0, 0.5, 0.6]])
    task = nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0], gain=gain)
    turning, late = nmm.Controller(head, task, nmm.ProjectedGradient()), round(product / gain / dt)
    q, places, error = np.array([0.24, 0.05]), [], []
    for k in range(round(20.0 / dt)):
        error.append(nmm.evaluate(seen, 0.0, nmm.Configuration(head, q)).value)
        places.append(q)
        then = max(k - late, 0)
        ball.set(error[then], dt * then, places[then] if compensated else q)
        q, _ = turning.step(dt * k, q, dt, "zoh")
    return float(np.abs(error[-1000:]).max() / np.abs(error[:1000]).max())


def delay() -> None:
    low, high = 1.0, 2.2
    while high - low > 0.02:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if last_over_first(middle, False) > 1.0 else (middle, high)
    print(f"unstable from K tau = {0.5 * (low + high):.2f} on (pi / 2 = {np.pi / 2:.2f}) without foresight")
    print("with it, K tau = 6: the last error over the first is", f"{last_over_first(6.0, True):.1e}")


if __name__ == "__main__":
    every: dict[str, Callable[[], None]] = {
        "starts": starts,
        "faults": faults,
        "depth": depth,
        "delay": delay,
    }
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=every)
    only = parser.parse_args().only
    for key, run in every.items():
        if only in (None, key):
            print(key)
            run()
