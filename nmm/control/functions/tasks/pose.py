"""Pose and orientation of a frame, in world axes or in another frame's, compared as rigid motions."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.base.kernels.compiled import compiled, kernel, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.rotations import (
    between3,
    cross3,
    exp3,
    left_jacobian3,
    left_jacobian_inverse3,
    log3,
    log6,
    log6_jacobian,
    times3,
    transposed_times3,
)
from nmm.control.functions.function import Function, Row, Shown, Stage
from nmm.model.robots.robot import Robot

#: Rows of a pose and their units: position over rotation vector.
PARTS = ("x", "y", "z", "rx", "ry", "rz")
UNITS = ("m", "m", "m", "rad", "rad", "rad")


@compiled
def relative_motion(
    a: int, b: int, placements: Array, jacobians: Array, R: Array, p: Array, velocity: Array
) -> None:
    """Frame a as frame b sees it: R = R_bᵀ R_a, p = R_bᵀ (p_a - p_b), and its velocity (6, n) in b's axes,
    p_dot = R_bᵀ (v_a - v_b - ω_b × (p_a - p_b)) over ω = R_bᵀ (ω_a - ω_b)."""
    base = placements[b]
    d = scratch(3)
    for i in range(3):
        d[i] = placements[a, i, 3] - base[i, 3]
    between3(base, placements[a], R)
    transposed_times3(base, d, p)
    x = scratch(3)
    for k in range(velocity.shape[1]):
        wx, wy, wz = jacobians[b, 3, k], jacobians[b, 4, k], jacobians[b, 5, k]
        x[0] = jacobians[a, 0, k] - jacobians[b, 0, k] - (wy * d[2] - wz * d[1])
        x[1] = jacobians[a, 1, k] - jacobians[b, 1, k] - (wz * d[0] - wx * d[2])
        x[2] = jacobians[a, 2, k] - jacobians[b, 2, k] - (wx * d[1] - wy * d[0])
        for i in range(3):
            velocity[i, k] = base[0, i] * x[0] + base[1, i] * x[1] + base[2, i] * x[2]
        for i in range(3):
            x[i] = jacobians[a, 3 + i, k] - jacobians[b, 3 + i, k]
        for i in range(3):
            velocity[3 + i, k] = base[0, i] * x[0] + base[1, i] * x[1] + base[2, i] * x[2]


@kernel(FUNCTION)
def frame_pose(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Rows of [p, φ], φ = log R, picked by `numbers` (0 to 5); φ_q = J(φ)⁻¹ ω_q, J the left Jacobian.
    slots = [frame], in world axes, or [frame, the frame that sees it]."""
    n = at.q.shape[0]
    R = scratch((3, 3))
    p = scratch(3)
    velocity = scratch((6, n))
    if frames.slots.shape[0] == 2:
        relative_motion(frames.slots[0], frames.slots[1], frames.placements, frames.jacobians, R, p, velocity)
    else:
        for i in range(3):
            p[i] = frames.placements[frames.slots[0], i, 3]
            for j in range(3):
                R[i, j] = frames.placements[frames.slots[0], i, j]
        for i in range(6):
            copied(frames.jacobians[frames.slots[0], i], velocity[i])
    phi = scratch(3)
    J = scratch((3, 3))
    log3(R, phi)
    left_jacobian_inverse3(phi, J)
    for row in range(numbers.shape[0]):
        part = int(numbers[row])
        if part < 3:
            rows.value[row] = p[part]
            copied(velocity[part], rows.value_q[row])
        else:
            i = part - 3
            rows.value[row] = phi[i]
            for k in range(n):
                rows.value_q[row, k] = (
                    J[i, 0] * velocity[3, k] + J[i, 1] * velocity[4, k] + J[i, 2] * velocity[5, k]
                )


class PartsOfPose(Function):
    """Some parts of a frame's pose, in world axes or as the frame `relative_to` sees it."""

    parts: tuple[str, ...] = PARTS

    def __init__(self, frame: str, relative_to: str | None = None) -> None:
        self.frame = frame
        self.relative_to = relative_to

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        where = ""
        if self.relative_to is not None:
            moves = robot.frame_id(self.relative_to) != robot.frame_id(self.frame)
            expect(moves, "relative_to", f"another frame than {self.frame!r}, which is at rest in itself")
            where = f" in {self.relative_to}"
        return tuple(Row(f"{self.frame}.{part}{where}", UNITS[PARTS.index(part)]) for part in self.parts)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        frames = (self.frame,) if self.relative_to is None else (self.frame, self.relative_to)
        picked = np.array([float(PARTS.index(part)) for part in self.parts])
        return (Stage(frame_pose, len(self.parts), frames, picked),)

    def shown(self) -> Shown:
        if self.relative_to is not None:
            return Shown()
        rows = {part: row for row, part in enumerate(self.parts)}
        axes = {part: rows[part] for part in PARTS[:3] if part in rows}
        rotation = tuple(rows[part] for part in PARTS[3:] if part in rows)
        turns = self.frame if rotation else None
        return Shown(self.frame if axes else None, axes, turns, rotation if len(rotation) == 3 else ())


@kernel(FUNCTION)
def orientation_error(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """e = log(RᵀR_d), R = exp(φ), R_d = exp(g), from the rows [φ, g, e]: see `Orientation`. With the body
    rates ω = J(φ)ᵀ φ_dot and ω_d = J(g)ᵀ g_dot: e_dot = Jr(e)⁻¹ ω_d - Jl(e)⁻¹ ω, Jr(e) = Jl(e)ᵀ."""
    R, target, turn = scratch((3, 3)), scratch((3, 3)), scratch((3, 3))
    J, J_target, J_error = scratch((3, 3)), scratch((3, 3)), scratch((3, 3))
    exp3(rows.value[:3], R)
    exp3(rows.value[3:6], target)
    between3(R, target, turn)
    log3(turn, rows.value[6:])
    left_jacobian3(rows.value[:3], J)
    left_jacobian3(rows.value[3:6], J_target)
    left_jacobian_inverse3(rows.value[6:], J_error)
    rate, omega, omega_target = scratch(3), scratch(3), scratch(3)
    forward, backward = scratch(3), scratch(3)
    for k in range(-1, at.q.shape[0]):  # -1: the time
        for i in range(3):
            rate[i] = rows.value_t[i] if k < 0 else rows.value_q[i, k]
        transposed_times3(J, rate, omega)
        for i in range(3):
            rate[i] = rows.value_t[3 + i] if k < 0 else rows.value_q[3 + i, k]
        transposed_times3(J_target, rate, omega_target)
        transposed_times3(J_error, omega_target, forward)
        times3(J_error, omega, backward)
        for i in range(3):
            if k < 0:
                rows.value_t[6 + i] = forward[i] - backward[i]
            else:
                rows.value_q[6 + i, k] = forward[i] - backward[i]


class Orientation(PartsOfPose):
    """Orientation of a frame as its rotation vector φ (3,), rad: R = exp(φ^), |φ| at most π.

    φ jumps where the angle passes π; the task does not: its error is not g - φ but e = log(RᵀR_d), the
    rotation vector of the turn that is left, in the frame's own axes (in which e and RᵀR_d e are the same).
    Any three numbers are a reference g, and all that stand for the same rotation give the same error. With a
    scalar gain K the frame turns about one axis onto a target at rest and e decays as exp(-K t).

    Parameters
    ----------
    frame : a frame of the robot
    relative_to : a frame of the robot from which, in its axes, it is measured; the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> here = nmm.Configuration(robot, robot.q({"theta": 0.5}))
    >>> nmm.evaluate(nmm.Orientation("base_footprint"), 0.0, here).value.round(3)
    array([0. , 0. , 0.5])
    """

    comparison = orientation_error
    parts = PARTS[3:]

    def shown(self) -> Shown:
        return super().shown()._replace(turns=self.frame)


@kernel(FUNCTION)
def pose_error(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """e = log6(T⁻¹T_d) from the rows [p, φ, p_d, g, e]: see `Pose`. Body velocities [Rᵀ p_dot, J(φ)ᵀ φ_dot],
    V and V_d, give E = T⁻¹T_d the velocity V_E = V_d - Ad(E⁻¹) V, and e_dot = Jlog6(E) V_E."""
    R, target, turn = scratch((3, 3)), scratch((3, 3)), scratch((3, 3))
    exp3(rows.value[3:6], R)
    exp3(rows.value[9:12], target)
    between3(R, target, turn)
    shift, x, y = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        x[i] = rows.value[6 + i] - rows.value[i]
    transposed_times3(R, x, shift)  # E = (turn, shift)
    log6(turn, shift, rows.value[12:])
    J, J_target, A, B = scratch((3, 3)), scratch((3, 3)), scratch((3, 3)), scratch((3, 3))
    left_jacobian3(rows.value[3:6], J)
    left_jacobian3(rows.value[9:12], J_target)
    log6_jacobian(rows.value[12:], shift, A, B)
    v, w, v_target, w_target = scratch(3), scratch(3), scratch(3), scratch(3)
    rate = scratch(12)
    for k in range(-1, at.q.shape[0]):  # -1: the time
        for i in range(12):
            rate[i] = rows.value_t[i] if k < 0 else rows.value_q[i, k]
        transposed_times3(R, rate[:3], v)
        transposed_times3(J, rate[3:6], w)
        transposed_times3(target, rate[6:9], v_target)
        transposed_times3(J_target, rate[9:], w_target)
        cross3(shift, w, x)  # Ad(E⁻¹) [v, w] = [turnᵀ (v - shift × w), turnᵀ w]
        for i in range(3):
            x[i] = v[i] - x[i]
        transposed_times3(turn, x, y)
        transposed_times3(turn, w, x)
        for i in range(3):
            v[i] = v_target[i] - y[i]
            w[i] = w_target[i] - x[i]
        for i in range(3):
            linear = 0.0
            angular = 0.0
            for j in range(3):
                linear += A[i, j] * v[j] + B[i, j] * w[j]
                angular += A[i, j] * w[j]
            if k < 0:
                rows.value_t[12 + i] = linear
                rows.value_t[15 + i] = angular
            else:
                rows.value_q[12 + i, k] = linear
                rows.value_q[15 + i, k] = angular


class Pose(PartsOfPose):
    """Pose T of a frame, (6,): position p (m) over rotation vector φ (rad), R = exp(φ^), |φ| at most π.

    The task's error is e = log6(T⁻¹T_d): the body velocity, linear (m) over angular (rad) in the frame's
    axes, that carries the frame onto its target in unit time. Its rate takes the right Jacobian of the
    logarithm; with a scalar gain K, e decays exactly as exp(-K t), along one screw motion if the target is at
    rest. (For a straight line use `Position` beside `Orientation`.) The reference has six rows, [p_d, g]; see
    `PoseReference`.

    Parameters
    ----------
    frame : a frame of the robot
    relative_to : a frame of the robot from which, in its axes, it is measured; the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> here = nmm.Configuration(robot, robot.q({"x": 1, "theta": 0.5}))
    >>> nmm.evaluate(nmm.Pose("base_footprint"), 0.0, here).value.round(3)
    array([1. , 0. , 0. , 0. , 0. , 0.5])
    """

    comparison = pose_error
