"""Where a frame is, and how it moves with the coordinates, at many configurations."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, kernel, scratch, view
from nmm.base.kernels.kinematics import Kinematics, compose, place_frames, place_joints
from nmm.base.kernels.record_layout import Memory, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.base.progress import Progress
from nmm.model.robots.joint_table import frame_table
from nmm.model.robots.robot import CENTER_OF_MASS, Robot

AT_ONCE = 10_000


@kernel(
    void(
        *(int64[::1], float64[::1], float64[:, ::1]),
        *(float64[:, ::1], float64[:, :, ::1]),
    )
)
def follow_frame(integers: Integers, floats: Array, q: Array, points: Array, jacobians: Array) -> None:
    """points (N, 3) of the one frame at q (N, n), and, if there is room for them, jacobians (N, 3, n)."""
    here = views(Kinematics, integers, floats, 0)
    n = q.shape[1]
    placement, J, none = scratch((1, 3, 4)), scratch((1, 6, n)), scratch((0, 6, n, n))
    carrier = here.frames.carrier[0]
    if carrier >= 0 and jacobians.shape[0] == 0:
        places, place = scratch((here.joints.parent.shape[0], 12)), scratch((1, 12))
        for k in range(q.shape[0]):
            place_joints(here.joints, view(q, k * n, (n,)), places)
            compose(places, carrier, here.frames.placement, 0, place, 0)
            for i in range(3):
                points[k, i] = place[0, 9 + i]
        return
    clear(J)
    for k in range(q.shape[0]):
        place_frames(here.joints, here.frames, view(q, k * n, (n,)), placement, J, none)
        for i in range(3):
            points[k, i] = placement[0, i, 3]
        if jacobians.shape[0] > 0:
            for i in range(3):
                for j in range(n):
                    jacobians[k, i, j] = J[0, i, j]


class FramePath:
    """The kinematics of one frame's origin, or of the centre of mass, a fraction of a microsecond each.

    Attributes
    ----------
    blocks : where its `Kinematics` lie, at 0, for compiled code that follows it

    Raises
    ------
    InputError : the robot has no frame of that name
    """

    def __init__(self, robot: Robot, frame: str) -> None:
        self.robot, self.frame = robot, frame
        ids = [None if frame == CENTER_OF_MASS else robot.frame_id(frame)]
        memory = Memory()
        memory.add(Kinematics(robot.joints, frame_table(robot.model, robot.joint_axes, ids)))
        self.blocks = memory.blocks()

    def positions(self, q: Array, progress: Progress | None = None) -> Array:
        """Where the origin is (N, 3), m in the world, at q (N, n)."""
        found, none = np.empty((len(q), 3)), np.empty((0, 3, self.robot.n))
        for first in range(0, len(q), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            follow_frame(*self.blocks, np.ascontiguousarray(q[some]), found[some], none)
            if progress is not None:
                progress(min(1.0, (first + AT_ONCE) / len(q)))
        return found

    def jacobians(self, q: Array) -> tuple[Array, Array]:
        """Where the origin is (N, 3), and ∂p/∂q (N, 3, n), world axes, at q (N, n)."""
        points, found = np.empty((len(q), 3)), np.empty((len(q), 3, self.robot.n))
        follow_frame(*self.blocks, np.ascontiguousarray(q), points, found)
        return points, found
