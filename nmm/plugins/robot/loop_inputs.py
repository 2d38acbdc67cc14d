"""The inputs of a robot's loop, which there are whatever the resolver and a user's functions do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nmm.base.arrays import Array
from nmm.control.controller import Controller
from nmm.control.step.step_solver import StepSolver


class LoopInputs:
    """u (m,), the last inputs: the controller's, a share of them, held ones or a stop's, within limits; at
    order 2 those that accelerations lead to in a period."""

    def __init__(self, controller: Controller, period: float) -> None:
        self._controller, self._period = controller, period
        self._earlier, self._q = self._solver.before.copy(), controller.robot.rest
        self.u = np.zeros(controller.robot.n_u)

    @property
    def _solver(self) -> StepSolver:
        """That of the tasks that are active now."""
        return self._controller.solver

    def _accept(self) -> None:
        """The inputs that the solver has just computed become u."""
        solver, second = self._solver, self._solver.step_memory.second
        if not solver.second:
            self.u = solver.step_memory.answer.u.copy()
            return
        self.u = solver.before + self._period * second.u_dot
        if np.isfinite(self.u).all():
            self._write(self.u, self._q)

    def compute(self, t: float, q: Array) -> str:
        """Those of the controller at (t, q); what it raised where it has none, and then all is as before."""
        self._earlier[:] = self._solver.before
        self._q = q
        try:
            self._controller(t, q)
            self._accept()
        except Exception as error:  # a user's function may raise anything
            self._solver.before[:] = self._earlier
            return type(error).__name__
        return ""

    def soften(self, t: float, q: Array, share: float) -> None:
        """A share of those just computed."""
        self._solver.before[:] = self._earlier
        wanted = share * self.u
        self._within(q, lambda: self._solver.take_nearest(t, q, wanted))

    def hold(self, t: float, q: Array) -> None:
        """The last ones."""
        self._within(q, lambda: self._solver.take_nearest(t, q, self.u))

    def brake(self, t: float, q: Array) -> None:
        """Those that stop soonest."""
        self._within(q, lambda: self._solver.take_stop(t, q))

    def rest(self, q: Array) -> None:
        self._write(np.zeros_like(self.u), q)

    def _within(self, q: Array, take: Callable[[], None]) -> None:
        """Inputs that the solver brings within the limits; where a function of the user raises, what limits
        of acceleration allow towards rest."""
        earlier = self._solver.before.copy()
        self._q = q
        try:
            take()
            self._accept()
        except Exception:
            self.u = np.full_like(earlier, np.nan)
        if not np.isfinite(self.u).all():
            least, most = self._solver.limits_on.changes.T * self._period
            self._write(earlier + np.clip(-earlier, least, most), q)

    def _write(self, u: Array, q: Array) -> None:
        """u (m,) in place of the solver's."""
        solver = self._solver
        self.u = u.copy()
        solver.step_memory.answer.u[:] = solver.before[:] = u
        solver.step_memory.second.u_dot[:] = 0.0
        solver.step_memory.q_dot[:] = solver.robot.S(q) @ u
