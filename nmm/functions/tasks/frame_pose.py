"""Poses: position and rotation vector of a frame, in world axes or in another frame's."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Shown, Stage
from nmm.kernels.compiled import compiled, kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.kernels.rotations import between3, left_jacobian_inverse3, log3, transposed_times3
from nmm.robots.robot import Robot

#: Rows of a pose and their units: position over rotation vector.
PARTS = ("x", "y", "z", "rx", "ry", "rz")
UNITS = ("m", "m", "m", "rad", "rad", "rad")


@compiled
def relative_motion(
    a: int, b: int, placements: Array, jacobians: Array, R: Array, p: Array, velocity: Array
) -> None:
    """Frame a as frame b sees it: R = R_bᵀ R_a, p = R_bᵀ (p_a - p_b), and its velocity (6, n) in b's axes.

    p_dot = R_bᵀ (v_a - v_b - ω_b × (p_a - p_b)), ω = R_bᵀ (ω_a - ω_b).
    """
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

    slots = [frame], in world axes, or [frame, the frame that sees it].
    """
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
            for k in range(n):
                velocity[i, k] = frames.jacobians[frames.slots[0], i, k]
    phi = scratch(3)
    J = scratch((3, 3))
    log3(R, phi)
    left_jacobian_inverse3(phi, J)
    for row in range(numbers.shape[0]):
        part = int(numbers[row])
        if part < 3:
            rows.value[row] = p[part]
            for k in range(n):
                rows.value_q[row, k] = velocity[part, k]
        else:
            i = part - 3
            rows.value[row] = phi[i]
            for k in range(n):
                rows.value_q[row, k] = (
                    J[i, 0] * velocity[3, k] + J[i, 1] * velocity[4, k] + J[i, 2] * velocity[5, k]
                )


class PartsOfPose(Function):
    """Some parts of a frame's pose, in world axes or as another frame, `relative_to`, sees it."""

    frame: str
    relative_to: str | None
    parts: tuple[str, ...] = PARTS

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        where = ""
        if self.relative_to is not None:
            if robot.frame_id(self.relative_to) == robot.frame_id(self.frame):
                raise InputError(
                    f"relative_to: expected another frame than {self.frame!r}, which is at rest in itself"
                )
            where = f" in {self.relative_to}"
        return tuple(Row(f"{self.frame}.{part}{where}", UNITS[PARTS.index(part)]) for part in self.parts)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        frames = (self.frame,) if self.relative_to is None else (self.frame, self.relative_to)
        picked = np.array([float(PARTS.index(part)) for part in self.parts])
        return (Stage(frame_pose, len(self.parts), frames, picked),)

    def shown(self) -> Shown:
        if self.relative_to is not None:
            return Shown()
        return Shown(self.frame, {part: row for row, part in enumerate(self.parts) if part in PARTS[:3]})
