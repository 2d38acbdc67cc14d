"""What limits and distances did to the inputs of a controller's last call."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.collisions.setting import Setting
from nmm.control.contradiction import contradicting
from nmm.control.equations import ControlStep
from nmm.control.limits import LimitsOn
from nmm.functions.program import Program
from nmm.robots.robot import Robot


class LimitReport:
    """Of one controller; all is about its last call.

    Parameters
    ----------
    kept, setting : its limits, and the distances that it keeps
    step, program : what it computes with, in memory

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [9.0, 1.0])
    >>> limits = nmm.Limits(velocity={"v": 0.1, "omega": 0.1, "q1": 0.1, "q2": 0.1})
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits)
    >>> u = controller(0.0, robot.q({"q2": 0.5}))
    >>> report = controller.report
    >>> isinstance(report, nmm.LimitReport), report.beyond(), report.contradiction()
    (True, {}, ())
    """

    def __init__(
        self, robot: Robot, kept: LimitsOn, setting: Setting | None, step: ControlStep, program: Program
    ) -> None:
        self._robot, self._kept, self._setting = robot, kept, setting
        self._step, self._program = step, program

    def beyond(self) -> dict[str, float]:
        """The limits of wheels and functions that the last call's inputs break, and by what rate."""
        problem = self._step.problem
        rates = problem.limit_rows @ self._step.answer.u
        excess = np.maximum(rates - problem.upper, problem.lower - rates)
        found: dict[str, float] = {}
        for name, by in zip(self._row_names, excess, strict=True):
            if by > 1e-9:
                found[name] = max(float(by), found.get(name, 0.0))
        return found

    def contradiction(self) -> tuple[str, ...]:
        """The limits that leave no inputs between them in the last call; () where there are some."""
        return contradicting(self._step.problem, self._robot.u_names, self._row_names)

    @property
    def _row_names(self) -> tuple[str, ...]:
        """What each row of the limits is about, in the last call."""
        if self._setting is None:
            return self._kept.rows
        pairs = self._step.near.pair.tolist()
        return (*self._kept.rows, *(f"distance of {self._setting.words(pair)}" for pair in pairs))

    def blocking(self) -> tuple[str, ...]:
        """What the last call's inputs could not come nearer to: pairs whose rows hold them back, by name."""
        if self._setting is None:
            return ()
        problem, near, first = self._step.problem, self._step.near, len(self._kept.rows)
        count = int(near.used)
        rates = problem.limit_rows[first : first + count] @ self._step.answer.u
        tight = rates - problem.lower[first : first + count] < 1e-6
        still = near.d[:count] < self._setting.distance + 0.01
        pairs = near.pair[:count][tight & still].tolist()
        return tuple(dict.fromkeys(self._setting.words(pair) for pair in pairs))

    def row_values(self) -> Array:
        """What `kept.rows` names, in the last call: rates of wheels, rad/s, and values of functions."""
        limits, wheels = self._step.limits, len(self._step.limits.spin)
        rates = self._step.problem.limit_rows[:wheels] @ self._step.answer.u
        return np.concatenate([rates, self._program.buffers.value[limits.rows]])
