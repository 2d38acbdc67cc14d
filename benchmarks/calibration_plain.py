"""A calibration by a plain model: innovations of a filter in NumPy, for `scipy.optimize.least_squares` by
numeric derivatives. `python benchmarks/calibration_plain.py` prints its answer and its time beside those of
`nmm.calibrate`, whose looks and noise it takes, for ten minutes of a differential drive and a car at 100 Hz.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import warnings
from pathlib import Path

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))
from simulated_drives import drive  # after the path

import nmm  # after the path
from nmm.plugins.robot.calibration.fit import solve  # after the path
from nmm.plugins.robot.calibration.innovations import BEGINS, TAKEN  # after the path
from nmm.plugins.robot.calibration.sides import WINDOW  # after the path

Array = np.ndarray
#: Numbers and inputs of the robots that are driven, and which of their wheels are counted.
LEFT, RIGHT = "radius.left_wheel_joint", "radius.right_wheel_joint"
REAR = ("rear_left_wheel_joint", "rear_right_wheel_joint")
#: Where Gauss and Legendre look in a step, for two looks.
NODES = 0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0
#: How long counters are taken as linear at most, s.
LONGEST = 0.05


def two_wheels(t: Array) -> Array:
    left = np.sin(0.3 * t) + 1.2 * np.sin(0.11 * t) + 0.3
    return 5.0 * np.stack([left, np.sin(0.24 * t + 1.0) + 1.2 * np.sin(0.13 * t) + 0.3], axis=1)


def steered(t: Array) -> Array:
    return np.stack([0.6 + 0.3 * np.sin(0.2 * t), 0.25 * np.cos(0.45 * t)], axis=1)


def log_of(name: str, seconds: float, looks: float = 100.0) -> tuple[nmm.Robot, nmm.DriveLog]:
    """A simulated log at 100 Hz of a robot whose numbers are others than its file's."""
    robot = nmm.load(name)
    if name == "differential_base":
        truth = {LEFT: 0.097, RIGHT: 0.102, "track": 0.56}
        return robot, drive(robot, truth, inputs=two_wheels, seconds=seconds, rate=100.0, looks=looks)
    truth = {"wheelbase": 0.74, "track": 0.58, "offset.steering": 0.03, "ratio.steering": 1.04}
    log = drive(robot, truth, inputs=steered, seconds=seconds, rate=100.0, looks=looks)
    kept = {key: values for key, values in log.readings.items() if key in (*REAR, "steering")}
    return robot, nmm.DriveLog(log.name, log.t, kept, log.reference_t, log.reference, log.kind)


class Plain:
    """Residuals of numbers by name, of one drive whose looks and noise a calibration has settled.

    names : of the numbers; first : where they begin; scales : how far they may plausibly be off
    """

    def __init__(self, found: nmm.Calibration) -> None:
        model = found.model
        self.noise, self.used = found.noise, model.drives[0]
        self.names = [model.learned[i].name for i in found.fit.free]
        self.held = dict(zip([one.name for one in model.learned], found.fit.values.tolist(), strict=True))
        self.first, self.scales = model.first[found.fit.free], model.scales[found.fit.free]
        self.delay = float(model.first[model.index("delay")])
        self.steered = self.used.own.shape[1] > 0

        self.weigh(found.fit.values[found.fit.free])

    def told(self, values: Array) -> dict[str, float]:
        """All numbers, by name."""
        return self.held | dict(zip(self.names, values.tolist(), strict=True))

    def residuals(self, values: Array) -> Array:
        numbers = self.told(values)
        parts = [self.filtered(numbers, self.steps(numbers, noise=False)[0])]
        if self.steered:
            parts.append(self.agreement(numbers))
        return np.concatenate(parts)

    def cut(self, times: Array) -> tuple[Array, Array]:
        """Steps of equal times in each stretch, (S + 1,), and how many in each."""
        many = np.maximum(np.ceil(np.diff(self.used.at) / LONGEST - 1e-3).astype(int), 1)
        ends = np.concatenate([[0], np.cumsum(many)])
        return np.interp(np.arange(ends[-1] + 1), ends, times), many

    def inputs(self, numbers: dict[str, float], times: Array) -> tuple[Array, Array, Array, Array]:
        """Of each step: how far wheels turned (S, 2), the platform's twist for each rad of it (S, 3, 2), what
        they say beyond a motion (S, 2), and where steps end (M,)."""
        grid, many = self.cut(times)
        used, ends = self.used, np.concatenate([[0], np.cumsum(many)])
        by = np.diff(np.stack([np.interp(grid, used.t, column) for column in used.counts.T], axis=1), axis=0)
        twist = np.zeros((len(by), 3, 2))
        if not self.steered:
            twist[:, 0] = 0.5 * numbers[LEFT], 0.5 * numbers[RIGHT]
            twist[:, 2] = -numbers[LEFT] / numbers["track"], numbers[RIGHT] / numbers["track"]
            return by, twist, np.zeros_like(by), ends
        angle = np.interp(grid, used.t, used.own[:, 0])
        angle = numbers["ratio.steering"] * angle + numbers["offset.steering"]
        curve, rates, bends = 0.0, 0.0, []
        for node in NODES:
            bent = np.tan(angle[:-1] + node * np.diff(angle)) / numbers["wheelbase"]
            side = 0.5 * numbers["track"] * bent
            left, right = (numbers[f"radius.{name}"] for name in REAR)
            bends.append(bent)
            curve = curve + 0.5 * bent
            rates = rates + 0.5 * np.stack([(1.0 - side) / left, (1.0 + side) / right], axis=1)
        ahead = rates / np.sum(rates**2, axis=1, keepdims=True)
        went = np.sum(ahead * by, axis=1)
        bracket = math.sqrt(3.0) / 12.0 * went * (bends[0] - bends[1])  # of Magnus' series
        twist[:, 0], twist[:, 2] = ahead, ahead * curve[:, np.newaxis]
        twist[:, 1] = ahead * bracket[:, np.newaxis]
        return by, twist, by - rates * np.sum(ahead * by, axis=1, keepdims=True), ends

    def steps(self, numbers: dict[str, float], noise: bool = True) -> tuple[Array, Array, Array]:
        """Of each stretch between looks its motion (M - 1, 3) and its noise (M - 1, 3, 3); speeds at looks
        (M, 3)."""
        times = self.used.at - numbers["delay"] - numbers["clock"] * (self.used.at - self.used.middle)
        by, slopes, _, ends = self.inputs(numbers, times)
        twists = np.einsum("sij,sj->si", slopes, by)
        motions, Q = np.zeros((len(ends) - 1, 3)), np.zeros((len(ends) - 1, 3, 3))
        for k in range(int(np.diff(ends).max())):
            some = np.flatnonzero(np.diff(ends) > k)
            at = ends[some] + k
            step = exponential(twists[at])
            motions[some] = composed(motions[some], step)
            if not noise:
                continue
            right, back = right_jacobians(twists[at]), adjoints(step)
            J = right @ slopes[at]
            variances = self.noise.counters**2 * np.abs(by[at])
            more = np.einsum("sic,sc,sjc->sij", J, variances, J)
            for axis, size in (
                (1, self.noise.across**2 * np.abs(twists[at, 0])),
                (2, self.noise.turns**2 * np.abs(twists[at, 2])),
            ):
                more += (
                    size[:, np.newaxis, np.newaxis]
                    * right[:, :, axis, np.newaxis]
                    * right[:, np.newaxis, :, axis]
                )
            Q[some] = back @ Q[some] @ back.transpose(0, 2, 1) + more
        speeds = motions / np.diff(self.used.at)[:, np.newaxis]
        return motions, Q, np.concatenate([speeds[:1], 0.5 * (speeds[1:] + speeds[:-1]), speeds[-1:]])

    def weigh(self, values: Array) -> None:
        """Gains and weights (M, 3, 3) of a Kalman filter of poses, errors along the body's axes, by these
        numbers; they stay."""
        numbers, used, noise = self.told(values), self.used, self.noise
        motions, Q, speeds = self.steps(numbers)
        R = np.array([noise.place**2, noise.place**2, noise.heading**2]) + (noise.jitter * speeds) ** 2
        x, y = numbers["reference.x"], numbers["reference.y"]
        H = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        back, A = np.linalg.inv(H), adjoints(motions)
        self.gains, self.weights = np.zeros((len(R), 3, 3)), np.zeros((len(R), 3, 3))
        P = np.zeros((3, 3))
        for m, taken in enumerate(used.taken):
            if m > 0:
                P = A[m - 1] @ P @ A[m - 1].T + Q[m - 1]
            if taken == BEGINS:
                P = back @ np.diag(R[m]) @ back.T
                continue
            S = H @ P @ H.T + np.diag(R[m])
            self.weights[m] = np.linalg.inv(np.linalg.cholesky(S))
            if taken == TAKEN:
                self.gains[m] = np.linalg.solve(S, H @ P).T
                P = P - self.gains[m] @ H @ P

    def filtered(self, numbers: dict[str, float], motions: Array) -> Array:
        """Innovations over their deviations, of looks that are taken."""
        used, found = self.used, []
        mx, my, yaw = (numbers[f"reference.{name}"] for name in ("x", "y", "yaw"))
        px = py = heading = 0.0
        rows = zip(
            used.z.tolist(), used.taken.tolist(), [[0.0] * 3, *motions.tolist()], self.gains, strict=True
        )
        for (zx, zy, zh), taken, (sx, sy, turn), gain in rows:
            c, s = math.cos(heading), math.sin(heading)
            px, py, heading = px + c * sx - s * sy, py + s * sx + c * sy, heading + turn
            if taken == BEGINS:
                heading = zh - yaw
                c, s = math.cos(heading), math.sin(heading)
                px, py = zx - c * mx + s * my, zy - s * mx - c * my
            if taken != TAKEN:
                found.append((0.0, 0.0, 0.0))
                continue
            c, s = math.cos(heading), math.sin(heading)
            x, y = zx - px, zy - py
            nu = c * x + s * y - mx, c * y - s * x - my, math.remainder(zh - heading - yaw, 2.0 * math.pi)
            found.append(nu)
            ex, ey, et = (gain @ nu).tolist()
            a = math.sin(et) / et if et else 1.0
            b = (1.0 - math.cos(et)) / et if et else 0.0
            ex, ey = a * ex - b * ey, b * ex + a * ey
            px, py, heading = px + c * ex - s * ey, py + s * ex + c * ey, heading + et
        return np.einsum("mij,mj->mi", self.weights, np.array(found)).ravel()

    def agreement(self, numbers: dict[str, float]) -> Array:
        """What counters say beyond motions, over its deviation."""
        by, _, spare, ends = self.inputs(numbers, self.used.at - self.delay)
        spacing = float(self.used.at[-1] - self.used.at[0]) / (len(ends) - 1)
        windows = ends[: -1 : max(1, round(WINDOW / spacing))]
        sums = np.add.reduceat(np.concatenate([spare, np.abs(by)], axis=1), windows, axis=0)
        went = sums[:, 2:].mean(axis=1, keepdims=True)
        return (sums[:, :2] / (self.noise.agreement * np.sqrt(np.maximum(went, 1e-12)))).ravel()

    def solved(self) -> OptimizeResult:
        """Least squares by numeric derivatives, from where `nmm.calibrate` began."""
        return least_squares(self.residuals, self.first, x_scale=self.scales, method="trf")


def exponential(twists: Array) -> Array:
    """Motions (S, 3) of twists (S, 3)."""
    v, w, turn = twists.T
    a, b = np.sinc(turn / np.pi), np.sin(0.5 * turn) * np.sinc(0.5 * turn / np.pi)
    return np.stack([a * v - b * w, b * v + a * w, turn], axis=1)


def right_jacobians(twists: Array) -> Array:
    """(S, 3, 3) with exp(twist + d) = exp(twist) exp(J d)."""
    v, w, turn = twists.T
    small = np.abs(turn) < 1e-5
    safe = np.where(small, 1.0, turn)
    made = np.zeros((len(twists), 3, 3))
    made[:, 0, 0] = made[:, 1, 1] = np.sinc(turn / np.pi)
    made[:, 0, 1] = np.sin(0.5 * turn) * np.sinc(0.5 * turn / np.pi)
    made[:, 1, 0], made[:, 2, 2] = -made[:, 0, 1], 1.0
    p = np.where(small, turn / 6.0, (safe - np.sin(safe)) / safe**2)
    q = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    made[:, 0, 2], made[:, 1, 2] = p * v - q * w, q * v + p * w
    return made


def adjoints(motions: Array) -> Array:
    """Adjoints (S, 3, 3) of the inverses of motions (S, 3)."""
    x, y, turn = motions.T
    c, s = np.cos(turn), np.sin(turn)
    made = np.zeros((len(motions), 3, 3))
    made[:, 0, 0] = made[:, 1, 1] = c
    made[:, 0, 1], made[:, 1, 0], made[:, 2, 2] = s, -s, 1.0
    made[:, 0, 2], made[:, 1, 2] = s * x - c * y, c * x + s * y
    return made


def composed(poses: Array, motions: Array) -> Array:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, turn = motions.T
    return poses + np.stack([c * x - s * y, s * x + c * y, turn], axis=1)


def beside(name: str, seconds: float, looks: float = 100.0) -> dict[str, float]:
    """Processor time of both, s, and how far their answers are apart, in deviations."""
    robot, log = log_of(name, seconds, looks)
    short = log_of(name, 10.0)[1]
    nmm.calibrate(robot, short)  # what is compiled or loaded once
    begin = time.process_time()
    found = nmm.calibrate(robot, log)
    whole = time.process_time() - begin
    plain, model, fitted = Plain(found), found.model, found.fit
    values = fitted.values.copy()
    values[fitted.free] = plain.first
    model.forget()
    begin = time.process_time()
    solve(model, values, fitted.free, fitted.noise)
    ours = time.process_time() - begin
    begin = time.process_time()
    solved = plain.solved()
    theirs = time.process_time() - begin
    off = np.abs(solved.x - found.fit.values[found.fit.free]) / found.fit.deviations
    return {"whole": whole, "nmm": ours, "scipy": theirs, "ratio": ours / theirs, "apart": float(off.max())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    told = parser.parse_args()
    columns = "robot | nmm, least squares | scipy | ratio | apart, deviations | nmm.calibrate, all of it"
    print(f"| {columns} |\n|" + "---|" * 6)
    for name in ("differential_base", "car_base"):
        one = beside(name, told.seconds)
        times = f"{one['nmm']:.2f} s | {one['scipy']:.2f} s | {one['ratio']:.3f}"
        print(f"| {name} | {times} | {one['apart']:.3f} | {one['whole']:.2f} s |")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
