"""Whether a robot in its loop is where it can be, gets where it wants, and keeps to its task."""

from __future__ import annotations

import math
from collections import Counter

from nmm.base.arrays import Array, positive, scalar
from nmm.control.controller import Controller
from nmm.control.goal import norms, unit_codes
from nmm.plugins.robot.far_limits import FarLimits
from nmm.plugins.robot.loop_log import LoopFindings
from nmm.plugins.robot.measured_state import Jump, MeasuredState, Refused

#: Of its rate the task gets less than that share for so long, s: distances block the robot.
BLOCKED, BLOCKED_FOR = 0.1, 0.5
#: Measurements that did not come, or came again, are no fault: a sensor may be slower than the loop.
QUIET = Refused.LOST, Refused.REPEATED


class LoopWatch:
    """Adds to a loop's findings, counts measurements `refused`; `outside` and `error` as `Loop` has them."""

    def __init__(
        self,
        controller: Controller,
        found: LoopFindings,
        outside: float | None,
        error: tuple[float, float] | None,
    ) -> None:
        solver = controller.solver
        share = math.inf if outside is None else scalar(outside, "outside", least=0.0)
        self._far = FarLimits(controller.robot, solver.limits_on.coordinates, share)
        self._error = None if error is None else tuple(positive(most, "error") for most in error)
        self._controller, self._found = controller, found
        self._free_at = 0.0
        self.refused: Counter[str] = Counter()

    def look_at_measurement(self, t: float, refused: Refused | None, jump: Jump | None) -> None:
        """Whether it was none, or has the platform elsewhere."""
        if refused is not None:
            self.refused[refused] += 1
            if refused not in QUIET:
                self._found.add("measurement_refused", t, reason=str(refused))
        if jump is not None:
            self._found.add("relocated", t, m=jump.m, rad=jump.rad)

    def is_outside(self, t: float, q: Array) -> bool:
        """Whether a joint is measured far outside its limits, q (n,)."""
        beyond = self._far.beyond(q)
        for values in beyond:
            self._found.add("outside_limits", t, **values)
        return bool(beyond)

    def contradicts(self, t: float, measured: MeasuredState) -> bool:
        """Whether the robot is not measured to move as its inputs ask it to."""
        one = measured.contradiction
        if one is not None:
            robot = self._controller.robot
            name, unit = robot.q_names[one.coordinate], robot.q_units[one.coordinate]
            self._found.add("not_following", t, name=name, unit=unit, apart=one.apart, way=one.way)
        return one is not None

    def look_for_blocking(self, t: float, running: bool) -> None:
        """Whether distances have blocked the robot for long, which runs, or has yet to."""
        solver = self._controller.solver
        if not running or solver.scene is None or solver.step_memory.answer.nu.min() >= BLOCKED:
            self._free_at = t
        elif t - self._free_at > BLOCKED_FOR:
            for pair in self._controller.report.blocking():
                self._found.add("blocked", t, BLOCKED_FOR, pairs=[pair])

    def is_off_task(self, t: float) -> bool:
        """Whether the task error is larger than it may be."""
        if self._error is None:
            return False
        solver = self._controller.solver
        m, rad = norms(solver.step_memory.task.error, unit_codes(solver.rows))
        off = m > self._error[0] or rad > self._error[1]
        if off:
            self._found.add("off_task", t, m=m, rad=rad)
        return off
