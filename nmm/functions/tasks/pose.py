"""Pose of a frame: position and orientation as one motion of space."""

from __future__ import annotations

from nmm.arrays import Array
from nmm.functions.tasks.frame_pose import PartsOfPose
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.kernels.rotations import (
    between3,
    cross3,
    exp3,
    left_jacobian3,
    log6,
    log6_jacobian,
    transposed_times3,
)


@kernel(FUNCTION)
def pose_error(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """e = log6(T⁻¹T_d) from the rows [p, φ, p_d, g, e]: see `Pose`.

    Each pose moves with a body velocity [Rᵀ p_dot, J(φ)ᵀ φ_dot] in its own axes; that of E = T⁻¹T_d is
    V_E = V_d - Ad(E⁻¹) V, and e_dot = Jlog6(E) V_E.
    """
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

    The task's error is e = log6(T⁻¹T_d): the body velocity, linear (m) over angular (rad) in the frame's own
    axes, that kept up for unit time carries the frame onto its target. Its rate takes the right Jacobian
    of the logarithm; with a gain K that is a number, e decays exactly as exp(-K t), along one screw motion
    when the target is at rest. (A position that shall move in a straight line is another task: `Position`
    beside `Orientation`.) The reference has six rows, [p_d, g]; see `PoseReference`.

    An angle between T and T_d of π exactly has two shortest ways; one of them is taken.

    Parameters
    ----------
    frame : a frame of the robot
    relative_to : a frame of the robot that sees it (two arms that hold one thing); the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> here = nmm.Configuration(robot, robot.q({"x": 1, "theta": 0.5}))
    >>> nmm.evaluate(nmm.Pose("base_footprint"), 0.0, here).value.round(3)
    array([1. , 0. , 0. , 0. , 0. , 0.5])
    """

    comparison = pose_error

    def __init__(self, frame: str, relative_to: str | None = None) -> None:
        self.frame = frame
        self.relative_to = relative_to
