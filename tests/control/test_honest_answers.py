"""No answer flatters: 10,000 problems of robots at, near and far from singular configurations.

Whatever is called solved has J u = rate to rounding, and inputs no larger than the matrix inverted makes
them; whatever is not says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import pi

import numpy as np
from numpy.typing import NDArray
from robot_grid import built, frame_of

import nmm
from nmm.control.functions.function import row_scales
from nmm.control.resolvers import Status

Array = NDArray[np.float64]

PROBLEMS = 4_000
ROBOTS = (
    ("unicycle_2r", "ee"),
    ("unicycle_3r", "ee"),
    (("fixed", "UR5"), ""),
    (("unicycle", "UR5"), ""),
    (("car", "Panda"), ""),
    (("second trailer", "small arm"), ""),
    (("mecanum", "Kinova"), ""),
    (("fixed", "small arm"), ""),
)


def tasks(robot: nmm.Robot, frame: str) -> Iterator[list[nmm.extending.Function]]:
    """Tasks of 1 to 6 rows, in metres, in radians and in both."""
    yield [nmm.Position(frame, "z")]
    yield [nmm.Position(frame, "x")]
    yield [nmm.Position(frame, "xy")]
    yield [nmm.Position(frame, "xyz")]
    yield [nmm.Position(frame, "xy"), nmm.Heading(frame)]
    yield [nmm.Orientation(frame)]
    yield [nmm.Pointing(frame, [3.0, 1.0, 0.5])]
    yield [nmm.Position(frame, "xz"), nmm.Orientation(frame)]
    yield [nmm.Pose(frame)]


def controllers(name: str | tuple[str, str], frame: str) -> Iterator[nmm.Controller]:
    robot = nmm.load(name) if isinstance(name, str) else built(*name)
    frame = frame or frame_of(*name)
    arm = robot.u_names[robot.platform.p :]
    for functions in tasks(robot, frame):
        rows = [len(function.rows(robot)) for function in functions]
        s, m = sum(rows), robot.n_u
        if s > m:
            continue
        stack = [
            nmm.Task(function, np.linspace(0.3, 0.7, count))
            for function, count in zip(functions, rows, strict=True)
        ]
        added = (
            nmm.Task(nmm.Posture(*robot.q_names[robot.n - (m - s) :]), np.full(m - s, 0.2)) if m > s else None
        )
        yield nmm.Controller(robot, stack, nmm.ProjectedGradient(), steering=False)
        yield nmm.Controller(robot, stack, nmm.ProjectedGradient(weights={arm[0]: 30.0}), steering=False)
        yield nmm.Controller(robot, stack, nmm.ReducedGradient(), steering=False)
        yield nmm.Controller(
            robot, stack, nmm.ReducedGradient(partitions=[robot.u_names[m - s :]]), steering=False
        )
        if m - s <= len(arm):
            yield nmm.Controller(robot, stack, nmm.ExtendedJacobian(), added_task=added, steering=False)


def configurations(robot: nmm.Robot, rng: np.random.Generator, count: int) -> Iterator[Array]:
    """Anywhere; at quarter turns, where arms are stretched and axes meet; and at all distances from there."""
    lower, upper = np.clip(robot.q_limits, -pi, pi).T
    for k in range(count):
        special = rng.integers(-2, 3, robot.n) * (pi / 2)
        if k % 3 == 0:
            yield rng.uniform(lower, upper)
        elif k % 3 == 1:
            yield special
        else:
            yield special + 10.0 ** rng.uniform(-17, -1) * rng.normal(size=robot.n)


def inverted(controller: nmm.Controller, step: nmm.extending.Step) -> tuple[Array, Array]:
    """The matrix that the resolver inverts, and its right-hand side, rows in their natural scales."""
    scales = row_scales(controller.rows, controller.robot)
    J, rate = step.J / scales[:, None], step.rate / scales
    if controller.resolver.name == "rg":
        return J[:, step.partition], rate
    if controller.resolver.name == "pg":
        return J, rate
    rows = controller.given.added_task.rows(controller.robot)
    own = row_scales(rows, controller.robot)
    problem = controller.solver.step_memory.problem
    return (
        np.vstack([J, problem.added_J / own[:, None]]),
        np.concatenate([rate, problem.added_rate / own]),
    )


def test_what_is_solved_is_solved(rng: np.random.Generator) -> None:
    every = [controller for robot in ROBOTS for controller in controllers(*robot)]
    each = -(-PROBLEMS // len(every))
    seen: Counter[Status] = Counter()
    for controller in every:
        for q in configurations(controller.robot, rng, each):
            controller.reset()
            step = controller.evaluate(0.3, q)
            seen[step.status] += 1
            if step.status is not Status.SOLVED:
                assert step.status is Status.INEXACT or np.all(np.isnan(step.u))
                continue
            true = np.linalg.norm(step.J @ step.u - step.rate)
            assert true <= 1.01e-9 * (1.0 + np.linalg.norm(step.rate))
            matrix, rate = inverted(controller, step)
            least = np.linalg.svd(matrix, compute_uv=False)[-1]
            weights = getattr(controller.resolver, "weights", None)
            stretch = 1.0 if weights is None else np.sqrt(max(weights.values()))
            assert np.linalg.norm(step.u) <= stretch * np.linalg.norm(rate) / least * (1.0 + 1e-5)
    assert sum(seen.values()) >= PROBLEMS
    # The problems are hard enough to mean something, and not all of them are lost.
    assert seen[Status.SOLVED] > 0.5 * PROBLEMS
    assert seen[Status.SINGULAR_J] > 0.05 * PROBLEMS
    assert seen[Status.SINGULAR_JA] > 0
    assert seen[Status.SINGULAR_JE] > 0
