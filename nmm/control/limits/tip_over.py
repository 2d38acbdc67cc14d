"""Tipping over, as a limit: the zero-moment point stays within the polygon of the wheels.

At the inputs u of a sample, with u_dot = (u - u_before) / dt, the ground's force and its moment about a point
on the ground are

    F = Σ m (a + g z),   M = Σ [(c - o) x m (a + g z) + I ω_dot + ω x I ω],   ZMP = o + (-M_y, M_x) / F_z,

sums over the bodies, with centre c, its acceleration a, angular velocity ω. They are linear in u_dot and
quadratic in u, which is linearised about the previous inputs. So "the ZMP is inside an edge by a margin" is a
row in u. A mass that leans out can stop only if the row of its capture point, c + √(z / g) c_dot, is kept,
too (Pratt et al. 2006).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nmm.base.arrays import Array, scalar
from nmm.base.convex_hull import convex_corners
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import clear, compiled, kernel, scratch
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.records import Frames
from nmm.base.kernels.rotations import compose3, cross3
from nmm.base.kernels.velocity_map import to_coordinates
from nmm.control.limits.limit import (
    LIMIT_ROWS,
    LIMIT_VALUES,
    Limit,
    LimitRows,
    LimitSample,
    LimitStage,
    RowLimit,
    by_inputs,
    checked_priority,
)
from nmm.model.dynamics.support import Support
from nmm.model.robots.robot import Robot

#: Numbers before those of bodies: gravity, height of the ground over the main body, margin, bodies, corners.
HEAD = 5
#: Of each body: mass, centre (3), inertia about it (6): xx, xy, yy, xz, yz, zz, in its frame's axes.
BODY = 10
#: A wheel on a part that turns may move so far on the main body, m.
STILL = 1e-3


@compiled
def turned_inertia(R: Array, numbers: Array, first: int, out: Array) -> None:
    """out (3, 3) = R I Rᵀ, I from its six numbers."""
    own, half = scratch((3, 3)), scratch((3, 3))
    k = first
    for i in range(3):
        for j in range(i + 1):
            own[i, j] = own[j, i] = numbers[k]
            k += 1
    compose3(R, own, half)
    for i in range(3):
        for j in range(3):
            out[i, j] = half[i, 0] * R[j, 0] + half[i, 1] * R[j, 1] + half[i, 2] * R[j, 2]


@compiled
def add_moment(lever: Array, force: Array, couple: Array, k: int, out: Array) -> None:
    """Add to column k of out (3, n): F_z, M_x, M_y of a force (3,) at a lever (3,) and a couple (3,)."""
    out[0, k] += force[2]
    out[1, k] += lever[1] * force[2] - lever[2] * force[1] + couple[0]
    out[2, k] += lever[2] * force[0] - lever[0] * force[2] + couple[1]


@compiled
def ground_force(
    frames: Frames, numbers: Array, q_dot: Array, o: Array, by_a: Array, by_v: Array, centre: Array
) -> float:
    """F_z, M_x, M_y about o (3,) by q_ddot and by q_dot, by_a and by_v (3, n): the force at rest apart it is
    by_a q_ddot + by_v q_dot / 2. Also n columns of the centre of mass, (3, n + 1), the last its place
    relative to o; returns the mass."""
    n = q_dot.shape[0]
    clear(by_a)
    clear(by_v)
    clear(centre)
    lever, arm, inertia = scratch(3), scratch(3), scratch((3, 3))
    J, w = scratch((n, 3)), scratch((n, 3))
    omega, before, ahead, spin = scratch(3), scratch(3), scratch(3), scratch(3)
    a, b, alpha, couple, part = scratch(3), scratch(3), scratch(3), scratch(3), scratch(3)
    total = 0.0
    for body in range(int(numbers[3])):
        at, frame = HEAD + BODY * body, frames.slots[body + 1]
        mass, R = numbers[at], frames.placements[frame]
        for i in range(3):
            arm[i] = R[i, 0] * numbers[at + 1] + R[i, 1] * numbers[at + 2] + R[i, 2] * numbers[at + 3]
            lever[i] = R[i, 3] + arm[i] - o[i]
            centre[i, n] += mass * lever[i]
        total += mass
        turned_inertia(R, numbers, at + 4, inertia)
        clear(omega)
        clear(ahead)
        for k in range(n):
            for i in range(3):
                w[k, i] = frames.jacobians[frame, 3 + i, k]
            cross3(w[k], arm, part)
            for i in range(3):
                J[k, i] = frames.jacobians[frame, i, k] + part[i]
                centre[i, k] += mass * J[k, i]
                omega[i] += w[k, i] * q_dot[k]
                ahead[i] += J[k, i] * q_dot[k]
        for i in range(3):
            spin[i] = dot(inertia[i], omega)
        clear(before)
        for k in range(n):
            # by q_dot_k: twice ω_before x J + w x (what this joint and those after it move)
            cross3(before, J[k], a)
            cross3(w[k], ahead, b)
            for i in range(3):
                part[i] = 2.0 * mass * (a[i] + b[i])
            cross3(before, w[k], a)
            for i in range(3):
                alpha[i] = omega[i] - before[i] - w[k, i] * q_dot[k]
            cross3(w[k], alpha, b)
            for i in range(3):
                alpha[i] = a[i] + b[i]
            for i in range(3):
                couple[i] = dot(inertia[i], alpha)
            cross3(w[k], spin, a)
            for i in range(3):
                alpha[i] = dot(inertia[i], w[k])
            cross3(omega, alpha, b)
            for i in range(3):
                couple[i] += a[i] + b[i]
            add_moment(lever, part, couple, k, by_v)
            for i in range(3):
                part[i] = mass * J[k, i]
            add_moment(lever, part, alpha, k, by_a)
            for i in range(3):
                before[i] += w[k, i] * q_dot[k]
                ahead[i] -= J[k, i] * q_dot[k]
    return total


@compiled
def to_rows(sample: LimitSample, by_a: Array, by_v: Array, A: Array, constant: Array) -> None:
    """F_z, M_x, M_y as A (3, m) u + constant (3,), without gravity, from their rows by q_ddot and q_dot:
    q_ddot = (S u - S u_before) / dt + S_dot u."""
    n, n_p, p = sample.q.shape[0], sample.G.shape[0], sample.G.shape[1]
    h, q_dot, u = sample.elapsed, sample.q_dot, sample.before
    gradient = scratch((1, n))
    for row in range(3):
        constant[row] = 0.0
        for k in range(n):
            gradient[0, k] = by_a[row, k] / h + by_v[row, k]
            constant[row] -= (by_a[row, k] / h + 0.5 * by_v[row, k]) * q_dot[k]
        for k in range(n_p):
            for i in range(n_p):
                for j in range(p):
                    gradient[0, k] += by_a[row, i] * sample.G_q[i, j, k] * u[j]
        by_inputs(sample, gradient, A[row])
        for j in range(p):
            for i in range(n_p):
                for k in range(n_p):
                    turned = by_a[row, i] * sample.G_q[i, j, k] * q_dot[k]
                    A[row, j] += turned
                    constant[row] -= turned * u[j]


@compiled
def write_edges(frames: Frames, numbers: Array, edges: Array) -> None:
    """edges (E, 3): of each side of the polygon its inward normal (x, y) in the world, and how far a point
    on it is along the normal from the main body's origin, m."""
    base, corners, first = frames.placements[frames.slots[0]], int(numbers[4]), HEAD + BODY * int(numbers[3])
    for k in range(corners):
        corner, next_corner = first + 2 * k, first + 2 * ((k + 1) % corners)
        x, y = numbers[corner], numbers[corner + 1]
        n_x, n_y = y - numbers[next_corner + 1], numbers[next_corner] - x
        length = math.sqrt(n_x * n_x + n_y * n_y)
        edges[k, 0] = (base[0, 0] * n_x + base[0, 1] * n_y) / length
        edges[k, 1] = (base[1, 0] * n_x + base[1, 1] * n_y) / length
        edges[k, 2] = (n_x * x + n_y * y) / length


@compiled
def place_of_ground(frames: Frames, numbers: Array, o: Array) -> None:
    """o (3,): the point of the ground under the main body's origin."""
    for i in range(3):
        o[i] = frames.placements[frames.slots[0], i, 3]
    o[2] += numbers[1]


@kernel(LIMIT_ROWS)
def tip_over(sample: LimitSample, frames: Frames, numbers: Array, rows: LimitRows) -> None:
    """Of E edges: rows of the ZMP, then of the capture point, as distances inside the margin, m; last the
    force on the ground, as a share of the weight."""
    n, n_p, m = sample.q.shape[0], sample.G.shape[0], sample.before.shape[0]
    g, margin, corners = numbers[0], numbers[2], int(numbers[4])
    o, edges = scratch(3), scratch((corners, 3))
    by_a, by_v, centre = scratch((3, n)), scratch((3, n)), scratch((3, n + 1))
    A, constant, gradient = scratch((3, m)), scratch(3), scratch((1, n))
    place_of_ground(frames, numbers, o)
    write_edges(frames, numbers, edges)
    mass = ground_force(frames, numbers, sample.q_dot, o, by_a, by_v, centre)
    to_rows(sample, by_a, by_v, A, constant)
    constant[0] += mass * g
    constant[1] += g * centre[1, n]
    constant[2] -= g * centre[0, n]
    ahead, weight = math.sqrt(max(centre[2, n] / mass, 0.0) / g), mass * g
    for k in range(corners):
        n_x, n_y, inside = edges[k, 0], edges[k, 1], edges[k, 2] + margin
        rows.lower[k] = -(n_y * constant[1] - n_x * constant[2] - inside * constant[0]) / weight
        for j in range(m):
            rows.A[k, j] = (n_y * A[1, j] - n_x * A[2, j] - inside * A[0, j]) / weight
        for j in range(n):  # the polygon moves with the platform
            gradient[0, j] = 0.0
            if j >= n_p:
                gradient[0, j] = ahead * (n_x * centre[0, j] + n_y * centre[1, j]) / mass
        by_inputs(sample, gradient, rows.A[corners + k])
        rows.lower[corners + k] = inside - (n_x * centre[0, n] + n_y * centre[1, n]) / mass
    for j in range(m):
        rows.A[2 * corners, j] = A[0, j] / weight
    rows.lower[2 * corners] = -constant[0] / weight


@kernel(LIMIT_VALUES)
def zmp_inside(sample: LimitSample, frames: Frames, numbers: Array, u_dot: Array, values: Array) -> None:
    """How far the ZMP is inside the polygon, m: its least distance from an edge, below 0 outside. Where the
    ground would have to pull it is nowhere: the width of the polygon outside."""
    n, n_p, p = sample.q.shape[0], sample.G.shape[0], sample.G.shape[1]
    g, corners, q_dot = numbers[0], int(numbers[4]), sample.q_dot
    o, edges, force, q_ddot = scratch(3), scratch((corners, 3)), scratch(3), scratch(n)
    by_a, by_v, centre = scratch((3, n)), scratch((3, n)), scratch((3, n + 1))
    place_of_ground(frames, numbers, o)
    write_edges(frames, numbers, edges)
    mass = ground_force(frames, numbers, q_dot, o, by_a, by_v, centre)
    clear(q_ddot)
    to_coordinates(u_dot, sample.G, p, sample.moved, sample.mimic_joints, q_ddot)
    for i in range(n_p):
        for j in range(p):
            for k in range(n_p):
                q_ddot[i] += sample.G_q[i, j, k] * q_dot[k] * sample.before[j]
    for i in range(3):
        force[i] = dot(by_a[i], q_ddot) + 0.5 * dot(by_v[i], q_dot)
    force[0] += mass * g
    force[1] += g * centre[1, n]
    force[2] -= g * centre[0, n]
    values[0], width = math.inf, 0.0
    for k in range(corners):
        inside = (edges[k, 1] * force[1] - edges[k, 0] * force[2]) / force[0] - edges[k, 2]
        values[0], width = min(values[0], inside), max(width, 2.0 * abs(edges[k, 2]))
    if not force[0] > 0.0:
        values[0] = -width


class TipOver(Limit):
    """The robot does not tip over: its zero-moment point (ZMP) stays within the wheels' polygon by a margin.

    The ZMP is where the ground's force acts. Its rows bound how fast inputs change; rows of the capture point
    keep an arm that leans out so slow that it can still be stopped. They are exact to first order in the
    change of inputs within a sample, so limits of acceleration should be given, too. Left out are the wheels'
    own spin, and loads that the robot's file does not have. Inputs count from rest at a run's start.

    Parameters
    ----------
    margin : how far the ZMP stays inside the polygon, m, at least 0
    priority : None for a limit that is kept before any task; 1, 2, ... for one that is kept as far as tasks
        of a lower number allow

    Raises
    ------
    InputError : a margin below 0; on a robot, one that leaves nothing of the polygon, fewer than three
        wheels, wheels of a trailer, no mass

    Examples
    --------
    >>> robot = nmm.mount(nmm.load("differential_base"), nmm.load("small_arm"), prefix="small_")
    >>> (row,) = nmm.TipOver(0.05).rows(robot)
    >>> row.name, row.unit, row.lower
    ('ZMP inside the wheels', 'm', 0.05)
    """

    def __init__(self, margin: float = 0.02, priority: int | None = None) -> None:
        self.margin = scalar(margin, "tip over: margin, m", least=0.0)
        self.priority = checked_priority(priority)

    def rows(self, robot: Robot) -> tuple[RowLimit, ...]:
        self._size(robot)
        return (RowLimit("ZMP inside the wheels", "m", self.margin, np.inf),)

    def _size(self, robot: Robot) -> float:
        """Twice how far the ZMP can be inside the margin, m."""
        widest = _inner_radius(_polygon(robot)[0])
        if self.margin >= widest:
            raise InputError(
                where="tip over: margin, m",
                expected=f"below {widest:.4g}, the most that a point is inside the wheels of {robot.name}",
                got=self.margin,
            )
        return 2.0 * (widest - self.margin)

    def stage(self, robot: Robot) -> LimitStage:
        model = robot.model
        corners, height = _polygon(robot)
        names = [robot.q_names[2]]
        bodies: list[float] = []
        for joint in range(1, model.njoints):
            inertia = model.inertias[joint]
            if inertia.mass > 0.0:
                name, place = _frame_on(robot, joint)
                own = place.actInv(inertia)
                names.append(name)
                bodies += [own.mass, *own.lever, *own.inertia[np.tril_indices(3)]]
        g = float(np.linalg.norm(model.gravity.linear))
        head = [g, height, self.margin, len(names) - 1, len(corners)]
        numbers = np.array([*head, *bodies, *corners.ravel()], dtype=np.float64)
        rows = 2 * len(corners) + 1
        return LimitStage(tip_over, zmp_inside, rows, "m", tuple(names), numbers, (self._size(robot),))


def _frame_on(robot: Robot, joint: int) -> tuple[str, Any]:
    """A frame that a joint of the model carries, by a name that finds it, and its place there."""
    for name in (robot.model.names[joint], *robot.frames):
        if robot.model.existFrame(name):
            frame = robot.model.frames[robot.frame_id(name)]
            if frame.parentJoint == joint:
                return name, frame.placement
    raise InputError(f"no frame is on joint {robot.model.names[joint]}", where=robot.name)


def _polygon(robot: Robot) -> tuple[Array, float]:
    """Corners of the wheels' polygon on the main body, counterclockwise, (E, 2) m, and the ground's height
    over the main body's frame, m."""
    support = Support(robot)
    if not support.names:
        raise InputError(
            f"{robot.name} has {len(robot.wheels)} known wheels, or a main body without mass",
            where="tip over",
            expected="three wheels or more on a body with mass",
        )
    rest = np.zeros(robot.n)
    points = support.points(rest)
    for j in range(3, robot.platform.n_p):
        turned = support.points(rest + 0.3 * np.eye(robot.n)[j])
        far = np.linalg.norm(turned - points, axis=1)
        if far.max() > STILL:
            wheel = support.names[int(far.argmax())]
            raise InputError(
                f"{robot.q_names[j]} moves wheel {wheel} of {robot.name} against the main body",
                where="tip over",
                expected="wheels that are one polygon",
            )
    return points[convex_corners(points, least=1e-12)], support.height


def _inner_radius(corners: Array) -> float:
    """The most that a point is inside all edges of a convex polygon, counterclockwise, (E, 2), m."""
    from scipy.optimize import linprog  # here, as the import takes a quarter of a second

    along = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, np.newaxis]
    A = np.hstack([-normals, np.ones((len(corners), 1))])
    solution = linprog([0.0, 0.0, -1.0], A, -np.sum(normals * corners, axis=1), bounds=[(None, None)] * 3)
    return float(np.asarray(solution.x)[2])
