"""The effect of limits and distances on the inputs of a controller's last call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.control.functions.program import Program
from nmm.control.limits.limits import LimitsOn
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.control.step.equations import ControlStep
from nmm.model.collisions.scene import Scene
from nmm.model.robots.robot import Robot


class LimitReport:
    """What limits and distances did in the last call of one controller.

    Parameters
    ----------
    kept, scene : its limits, and the distances that it keeps
    step, program : the controller's records in memory

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [9.0, 1.0])
    >>> limits = nmm.Limits(velocity={"v": 0.1, "omega": 0.1, "q1": 0.1, "q2": 0.1})
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits)
    >>> u = controller(0.0, robot.q({"q2": 0.5}))
    >>> report = controller.report
    >>> isinstance(report, nmm.extending.LimitReport), report.beyond(), report.contradiction()
    (True, {}, ())
    """

    def __init__(
        self, robot: Robot, kept: LimitsOn, scene: Scene | None, step: ControlStep, program: Program
    ) -> None:
        self._robot, self._kept, self._scene = robot, kept, scene
        self._step, self._program = step, program

    def beyond(self) -> dict[str, float]:
        """The limits of wheels and functions that the last call's inputs violate, and by what rate."""
        problem = self._step.problem
        rates = problem.limit_rows @ self._step.answer.u
        excess = self._step.second.share * np.maximum(rates - problem.upper, problem.lower - rates)
        by_name: dict[str, float] = {}
        for name, by in zip(self._row_names, excess, strict=True):
            if by > 1e-9:
                by_name[name] = max(float(by), by_name.get(name, 0.0))
        return by_name

    def contradiction(self) -> tuple[str, ...]:
        """The limits that contradict each other in the last call; () where some inputs satisfy all."""
        return contradicting(self._step.problem, self._robot.u_names, self._row_names)

    @property
    def _row_names(self) -> tuple[str, ...]:
        if self._scene is None:
            return self._kept.rows
        pairs = self._step.near.pair.tolist()
        return (*self._kept.rows, *(f"distance of {self._scene.words(pair)}" for pair in pairs))

    def blocking(self) -> tuple[str, ...]:
        """The pairs, by name, that the last call's inputs could not bring closer together."""
        if self._scene is None:
            return ()
        problem, near, first = self._step.problem, self._step.near, len(self._kept.rows)
        count = int(near.used)
        rates = problem.limit_rows[first : first + count] @ self._step.answer.u
        tight = rates - problem.lower[first : first + count] < 1e-6
        still = near.d[:count] < self._scene.distance + 0.01
        pairs = near.pair[:count][tight & still].tolist()
        return tuple(dict.fromkeys(self._scene.words(pair) for pair in pairs))


def contradicting(problem: ProblemArrays, inputs: Sequence[str], rows: Sequence[str]) -> tuple[str, ...]:
    """Names of limits that no u (m,) satisfies together; () where some u satisfies all.

    Rows are widened by the least number that admits a u within the limits of the inputs; the limits with a
    nonzero multiplier in this linear program contradict each other (Farkas).
    """
    from scipy.optimize import linprog  # here, as the import takes a quarter of a second

    m, count = len(inputs), len(rows)
    if not count:
        return ()
    ones = np.ones((count, 1))
    A = np.vstack([np.hstack([problem.limit_rows, -ones]), np.hstack([-problem.limit_rows, -ones])])
    b = np.concatenate([problem.upper, -problem.lower])
    some = np.isfinite(b)
    bounds = [*zip(problem.u_lower, problem.u_upper, strict=True), (0.0, None)]
    solution = linprog(np.append(np.zeros(m), 1.0), A[some], b[some], bounds=bounds)
    if solution.x is None or solution.x[-1] <= 0.0:
        return ()
    prices = np.zeros(2 * count)
    prices[some] = np.abs(solution.ineqlin.marginals)
    of_rows = prices.reshape(2, count).max(axis=0)
    of_inputs = np.abs(solution.lower.marginals[:m]) + np.abs(solution.upper.marginals[:m])
    priced = zip([*rows, *inputs], [*of_rows, *of_inputs], strict=True)
    return tuple(dict.fromkeys(name for name, price in priced if price > 1e-9))
