"""Orientation of a frame, compared on the rotations themselves."""

from __future__ import annotations

from nmm.arrays import Array
from nmm.functions.function import Shown
from nmm.functions.tasks.frame_pose import PARTS, PartsOfPose
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.kernels.rotations import (
    between3,
    exp3,
    left_jacobian3,
    left_jacobian_inverse3,
    log3,
    times3,
    transposed_times3,
)


@kernel(FUNCTION)
def orientation_error(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """e = log(RᵀR_d), R = exp(φ), R_d = exp(g), from the rows [φ, g, e]: see `Orientation`.

    With the body rates ω = J(φ)ᵀ φ_dot and ω_d = J(g)ᵀ g_dot, each in its own axes:
    e_dot = Jr(e)⁻¹ ω_d - Jl(e)⁻¹ ω, of which Jr(e) = Jl(e)ᵀ.
    """
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
    It depends on the rotations R = exp(φ^) and R_d = exp(g^) only, so any three numbers are a
    reference: g and another vector of the same rotation give the same error. With a gain K that is a number,
    the frame turns about one axis onto a target at rest and e decays as exp(-K t).

    An error of π exactly has two shortest ways; one of them is taken.

    Parameters
    ----------
    frame : a frame of the robot
    relative_to : a frame of the robot that sees it, in its axes; the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> here = nmm.Configuration(robot, robot.q({"theta": 0.5}))
    >>> nmm.evaluate(nmm.Orientation("base_footprint"), 0.0, here).value.round(3)
    array([0. , 0. , 0.5])
    """

    comparison = orientation_error
    parts = PARTS[3:]

    def __init__(self, frame: str, relative_to: str | None = None) -> None:
        self.frame = frame
        self.relative_to = relative_to

    def shown(self) -> Shown:
        return Shown(turns=self.frame)
