"""Whether tasks hold a platform at a pose to which no smooth feedback brings it."""

from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.control.functions.function import Evaluation, Function
from nmm.control.functions.program import Program
from nmm.control.step.step_solver import StepSolver
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

#: Singular values below this share of the largest are zero.
ZERO = 1e-9
#: A target that moves less than this per second stands.
STANDS = 1e-9
#: A platform whose error is at most this, m and rad, is to stay where it is, which feedback does.
AT_TARGET = 1e-4


def standing_pose(solver: StepSolver, q: Array, times: Array) -> Finding | None:
    """A finding where the tasks decide x, y and θ of a platform whose inputs span fewer directions of these,
    whatever the arm does, and their targets stand at all times (N,), s, elsewhere than the robot at q (n,).

    q̇ = S(q) u with fewer inputs than coordinates has no smooth feedback that brings all of them to a point
    (R. W. Brockett, Asymptotic stability and feedback stabilization, 1983).
    """
    robot = solver.robot
    configuration = Configuration(robot, q)
    if robot.platform.n_p < 3 or _rank(configuration.S[:3]) == 3:
        return None
    try:
        targets = _evaluated(robot, [task.reference for task in solver.task], times, q)
        (functions,) = _evaluated(robot, [task.function for task in solver.task], times[:1], q)
        J = np.vstack([function.value_q for function in functions])
        error = solver.errors(times[:1], q[np.newaxis])[0][0]
    except Exception:  # a user's function may raise anything where it is not defined
        return None
    if any(np.abs(each.value_t).max() > STANDS or each.value_q.any() for at in targets for each in at):
        return None
    if not np.isfinite(J).all():
        return None
    left, sizes, _ = np.linalg.svd(J[:, 3:])
    free = left[:, np.count_nonzero(sizes > ZERO * max(1.0, sizes.max(initial=0.0))) :]
    if _rank(free.T @ J[:, :3]) < 3 or not np.linalg.norm(free.T @ error) > AT_TARGET:
        return None
    return Finding("pose_without_feedback", {"platform": robot.platform.name})


def _evaluated(robot: Robot, functions: Sequence[Function], times: Array, q: Array) -> list[list[Evaluation]]:
    program = Program(robot, functions)
    program.lay_out()
    return [program.evaluate(float(t), q) for t in times]


def _rank(matrix: Array) -> int:
    return int(np.linalg.matrix_rank(matrix, ZERO))
