"""What keeps distances beyond the rows: the motion that the inputs make is looked at before it is made.

Rows are linear, the motion is not, and nearest points jump. So where a pair could come too near within the
sample, or while the robot then brakes (all inputs alike, as hard as accelerations let it), distances are
measured along that way. Where one falls short, a row for the points that do is added and the problem is
answered again; after a few rounds the inputs go towards those of braking, as little as can be. The way on
which the robot brakes was found clear a sample before, so that there always is one where obstacles stand.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.collisions.lookout import Lookout, Short
from nmm.collisions.setting import Setting
from nmm.control.equations import ControlStep, drive
from nmm.functions.program import BESIDE, Program
from nmm.resolvers.answer import RELAXED, Status
from nmm.resolvers.within import LEFT

#: Rows keep distances by MARGIN more than asked for, m; ways have to keep them by SLACK more: between
#: looks they may dip.
MARGIN, SLACK = 5e-4, 5e-5
#: Rows for these are kept free; how often the problem is answered again.
CUTS, ROUNDS = 8, 5
#: Shares of the way from braking to what was asked that are tried, then.
SHARES = (0.75, 0.5, 0.25, 0.1, 0.0)


class Counts(NamedTuple):
    """How often a guard had to do something since its controller was reset, in samples.

    looked : it looked along the way; added : rows were added; braked : the inputs went towards braking;
    short : no inputs that it tried keep the distance
    """

    looked: int = 0
    added: int = 0
    braked: int = 0
    short: int = 0


class Guard:
    """A controller's part for distances.

    Parameters
    ----------
    setting : what is kept apart
    step, program : what the controller computes with, in memory
    again : again(q) -> status: the inputs for the equations that are there, once more

    Attributes
    ----------
    counts : what it had to do
    held : whether it looked along the way of the last sample, which then is one with inputs that are held
    """

    def __init__(
        self,
        setting: Setting,
        step: ControlStep,
        program: Program,
        again: Callable[[Array], float],
    ) -> None:
        self._setting, self._queries = setting, setting.queries
        self._near, self._keep, self._step = step.near, step.clearance, step
        self._program, self._again = program, again
        self._lookout = Lookout(
            setting.queries, step.limits.acceleration, setting.distance, setting.distance + SLACK
        )
        self._cut = False
        self.reset()

    def reset(self) -> None:
        """Count anew."""
        self.counts = Counts()
        self.held = False

    def look(self, t: float, q: Array) -> None:
        """Measure distances at (t, q) and write their rows."""
        if self._cut:
            self._keep.least[:] = -np.inf
            self._cut = False
        self._queries.update(t, q, *self._program.blocks, BESIDE)

    def clear(self, moved: float) -> bool:
        """Whether nothing comes too near while coordinates move by no more than this, m and rad together."""
        room = float(self._queries.scene.bounds.min(initial=np.inf)) - self._setting.distance
        return moved * (1.0 + self._setting.robot.reach) < room

    def _count(self, what: str) -> None:
        self.counts = self.counts._replace(**{what: getattr(self.counts, what) + 1})

    def certify(self, t: float, q: Array, before: Array) -> None:
        """Look along the way that the inputs found make, and change them where it comes too near.

        before (m,) : the inputs of the sample before, from which accelerations count
        """
        self.held = False
        found, dt = self._step, float(self._step.problem.dt)
        u = found.answer.u
        if not self._lookout.list_risky(found.q_dot, u, dt, anew=True):
            return
        self.held = True
        self._count("looked")
        short = self._lookout.first_short(t, q, u, dt)
        for round_ in range(ROUNDS):
            if short is None:
                return
            if not self._add_row(t, q, short):
                break
            if round_ == 0:
                self._count("added")
            found.problem.before[:] = before
            if self._again(q) >= Status.SINGULAR_J:
                break
            self._lookout.list_risky(found.q_dot, u, dt, anew=False)
            short = self._lookout.first_short(t, q, u, dt)
        if short is not None:
            self._count("braked")
            self._brake(t, q, before, short)

    def _brake(self, t: float, q: Array, before: Array, short: Short) -> None:
        """From braking towards what was asked, the last inputs that keep the distances; else the best."""
        problem = self._step.problem
        dt = float(problem.dt)
        wanted = self._step.answer.u.copy()
        if not np.isfinite(wanted).all():
            wanted = before.copy()
        slower = (1.0 - self._lookout.slower(before, dt)) * before
        rest = np.clip(slower, problem.u_lower, problem.u_upper)
        best, least = wanted, short.by
        for share in SHARES:
            tried = rest + share * (wanted - rest)
            found = self._lookout.first_short(t, q, tried, dt)
            if found is None:
                best, least = tried, 0.0
                break
            if found.by < least:
                best, least = tried, found.by
        if least > 0.0:
            self._count("short")
        self._instead(best)

    def _instead(self, wanted: Array) -> None:
        """These inputs, which are within the limits of inputs, and none other."""
        found, problem = self._step, self._step.problem
        rows = problem.limit_rows @ wanted
        found.answer.u[:] = wanted
        found.answer.scale[:] = 0.0
        found.answer.status[()] = RELAXED
        found.answer.residual[()] = np.linalg.norm(problem.J @ wanted - found.task.full)
        beyond = np.maximum(rows - problem.upper, problem.lower - rows).max(initial=0.0)
        found.answer.excess[()] = beyond if beyond > LEFT else 0.0
        drive(wanted, self._program.buffers.G, found.arm, found.q_dot)
        problem.before[:] = wanted

    def _add_row(self, t: float, q: Array, short: Short) -> bool:
        """A row for the points that come too near; whether there was room for it."""
        near, keep = self._near, self._keep
        slot = int(near.used)
        if slot == len(near.d):
            self._queries.place(t, q)  # looking along the way has moved the shapes
            return False
        self._queries.carry(short.pair, (t, q), (t + short.after, short.q), near, slot)
        near.used[()] = slot + 1
        rate = float(near.d_q[slot] @ self._step.q_dot + near.d_t[slot])
        keep.least[slot] = rate + (short.by + 1e-6) / short.weight
        self._cut = True
        return True
