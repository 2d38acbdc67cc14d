"""Logs of simulated drives: a robot with true numbers, wheels that slip, a late and noisy reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

import nmm
from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.stretches import stretches
from nmm.plugins.robot.odometry import Counters, counted_wheels

#: Inputs (N, p) at times (N,), s.
Inputs = Callable[[Array], Array]


def wander(p: int, seed: int = 0) -> Inputs:
    """Inputs that come and go: sums of two slow sines each."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.uniform(0.05, 0.3, (2, p)), rng.uniform(0.0, 2.0 * np.pi, (2, p))

    def inputs(t: Array) -> Array:
        angles = 2.0 * np.pi * frequencies[:, np.newaxis] * t[:, np.newaxis] + phases[:, np.newaxis]
        return np.sin(angles[0]) + 0.7 * np.sin(angles[1])

    return inputs


def two_wheels(t: Array) -> Array:
    """Rates of two wheels (N, 2), rad/s, for curves to both sides, ahead and back."""
    left = np.sin(0.3 * t) + 1.2 * np.sin(0.11 * t) + 0.3
    return 5.0 * np.stack([left, np.sin(0.24 * t + 1.0) + 1.2 * np.sin(0.13 * t) + 0.3], axis=1)


def steered(t: Array) -> Array:
    """Speed, m/s, and rate of a steering angle, rad/s."""
    return np.stack([0.6 + 0.3 * np.sin(0.2 * t), 0.25 * np.cos(0.45 * t)], axis=1)


def every_way(t: Array) -> Array:
    """Inputs of mecanum wheels, rad/s: drive, strafe and turn."""
    return np.stack([3.0 * np.sin(0.3 * t) + 2.0, 3.0 * np.cos(0.2 * t), 2.0 * np.sin(0.35 * t)], axis=1)


def tractor(t: Array) -> Array:
    """Speed, m/s, and rate of turning, rad/s, of what pulls a trailer."""
    return np.stack([0.5 + 0.3 * np.sin(0.5 * t), 0.4 * np.sin(0.3 * t)], axis=1)


def placed(poses: Array, mount: Sequence[float]) -> Array:
    """Where a point of the body at `mount` (3,) is, (M, 3), while the body is at poses (M, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, yaw = mount
    return poses + np.stack([c * x - s * y, s * x + c * y, np.full(len(poses), yaw)], axis=1)


def composed(motions: Array) -> Array:
    """Poses (M, 3) from the origin on, by motions (M - 1, 3) in the axes of where each begins."""
    heading = np.concatenate([[0.0], np.cumsum(motions[:, 2])])
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    steps = np.stack([c * motions[:, 0] - s * motions[:, 1], s * motions[:, 0] + c * motions[:, 1]], axis=1)
    return np.column_stack([np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), heading])


def drive(
    robot: nmm.Robot,
    truth: Mapping[str, float] | None = None,
    *,
    inputs: Inputs | None = None,
    seconds: float = 60.0,
    rate: float = 50.0,
    looks: float = 10.0,
    mount: Sequence[float] = (0.2, 0.05, 0.1),
    delay: float = 0.03,
    place: float = 0.003,
    heading: float = 0.003,
    slip: float = 0.01,
    seed: int = 0,
    kind: str = "poses",
    name: str = "drive",
) -> nmm.DriveLog:
    """A log of the robot whose numbers are `truth` where it is told.

    inputs : by default `wander`; rate, looks : of encoders and of the reference, 1/s
    mount : where the reference is on the robot, m, m, rad; delay : of its stamps, s
    place, heading : standard deviations of the reference, m and rad
    slip : of a wheel for a rad that it turns, rad: the ground and hitches see it, its counter does not
    """
    truth = dict(truth or {})
    moves = {n: v for n, v in truth.items() if n.partition(".")[0] not in ("offset", "ratio")}
    true, rng = nmm.with_numbers(robot, moves), np.random.default_rng(seed)
    names = counted_wheels(true) or [*true.platform.inputs]
    counters = Counters(true, dict.fromkeys(names, 0.0), name)
    t = np.arange(round(seconds * rate) + 1) / rate
    u = (inputs or wander(true.platform.p, seed))(0.5 * (t[1:] + t[:-1]))
    slips = rng.normal(size=(len(t) - 1, len(names))) * slip
    own, counts, rolled = _integrated(true, counters, u, 1.0 / rate, slips)
    poses = composed(stretches(counters.record, t, rolled, own, t).motions)
    every = round(rate / looks)
    seen = placed(poses[::every], mount)
    seen = seen + rng.normal(size=seen.shape) * [place, place, heading]
    readings = {n: counts[:, i] for i, n in enumerate(names)}
    for i, n in enumerate(true.q_names[3 : true.platform.n_p]):
        readings[n] = (own[:, i] - truth.get(f"offset.{n}", 0.0)) / truth.get(f"ratio.{n}", 1.0)
    columns = 2 if kind == "positions" else 3
    return nmm.DriveLog(name, t, readings, t[::every] + delay, seen[:, :columns], kind)  # type: ignore[arg-type]


def _integrated(
    robot: nmm.Robot, counters: Counters, u: Array, dt: float, slips: Array
) -> tuple[Array, Array, Array]:
    """Own joints (N, n_p - 3), counters (N, k) and how far they rolled (N, k), by inputs (N - 1, p), each for
    dt, s, with slips (N - 1, k) for a rad that they count (and with its root)."""
    n_p, steered = robot.platform.n_p, counters.steered.values()
    qp, own = np.zeros(n_p), np.zeros((len(u) + 1, n_p - 3))
    counts, rolled = np.zeros((2, len(u) + 1, len(counters.names)))
    if n_p == 3:
        counted = dt * u @ counters.matrix(qp[3:])[0].T
        counts[1:] = np.cumsum(counted, axis=0)
        rolled[1:] = counts[1:] + np.cumsum(slips * np.sqrt(np.abs(counted)), axis=0)
        return own, counts, rolled
    free = [i for i in range(robot.platform.p) if i not in steered]  # steering joints turn as they are told
    for n, un in enumerate(u):
        M = counters.matrix((qp + 0.5 * dt * robot.platform.G(qp) @ un)[3:])[0]
        counted = dt * M @ un
        slipped = slips[n] * np.sqrt(np.abs(counted))
        counts[n + 1], rolled[n + 1] = counts[n] + counted, rolled[n] + counted + slipped
        moved = un.copy()
        moved[free] += np.linalg.lstsq(M[:, free], slipped / dt, rcond=None)[0]
        qp = qp + dt * robot.platform.G(qp + 0.5 * dt * robot.platform.G(qp) @ moved) @ moved
        own[n + 1] = qp[3:]
    return own, counts, rolled


def write(log: nmm.DriveLog, path: Path, *, turn: float = 2.0 * np.pi) -> tuple[Path, Path]:
    """Two tables: counters, `turn` of a wheel's revolution (2 pi: rad; 1000: ticks), and the reference, m and
    rad; its path."""
    reference = path.with_name(f"{path.stem}_seen.csv")
    ticks = [values * turn / (2.0 * np.pi) for values in log.readings.values()]
    header = ",".join(["t", *log.readings])
    np.savetxt(path, np.column_stack([log.t, *ticks]), "%.9g", ",", header=header, comments="")
    columns = "t,x,y,theta" if log.kind == "poses" else "t,x,y"
    seen = np.column_stack([log.reference_t, log.reference])
    np.savetxt(reference, seen, "%.9g", ",", header=columns, comments="")
    return path, reference
