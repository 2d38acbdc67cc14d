"""The result of one call of a controller."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import expect_known
from nmm.control.resolvers.answer import Status
from nmm.control.step.quantities import QUANTITIES, Record
from nmm.model.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Step:
    """All quantities of a controller at (t, q): copies, in the units of the task's rows.

    r, r_d, error, rate (s,), J (s, m) of J_bar u = rate; objective H and gradient h (m,);
    u (m,), q_dot = S u (n,); status, scale (levels,), residual ‖J u - rate‖, measure, excess: see `Answer`;
    partition (s,) the columns of Ja, -1 for none; retreats so far; step_size, the share of α used;
    added_residual, of the added task's rows, 0 where rounding hides it;
    u_dot (m,) at order 2, not numbers at order 1;
    side, the sign of det J_e where the extended Jacobian inverted it, else 0;
    more, further recorded quantities by name: `step[name]` is any of them.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> step = nmm.Controller(robot, task, nmm.ProjectedGradient()).evaluate(0.0, robot.q({"q2": 0.5}))
    >>> step.J.shape, step.error.round(3), step.residual < 1e-12
    ((2, 4), array([0.937, 0.856]), True)
    """

    t: float
    q: Array
    r: Array
    r_d: Array
    error: Array
    rate: Array
    J: Array
    objective: float
    h: Array
    u: Array
    q_dot: Array
    status: Status
    scale: Array
    residual: float
    measure: float
    partition: Integers
    excess: float = 0.0
    retreats: int = 0
    step_size: float = 1.0
    added_residual: float = 0.0
    side: int = 0
    u_dot: Array = field(default_factory=lambda: np.zeros(0))

    robot: Robot = field(kw_only=True, repr=False)
    more: dict[str, Any] = field(default_factory=dict, kw_only=True, repr=False)

    @property
    def by_name(self) -> dict[str, Any]:
        """All that it has."""
        return {**vars(self), **self.more}

    def __getitem__(self, name: str) -> Any:
        """A recorded quantity of this sample by name, computed where it needs no other samples."""
        own = self.by_name
        known = {
            quantity.name: quantity.of
            for quantity in QUANTITIES.values()
            if quantity.name in own or quantity.of
        }
        expect_known("quantity", name, known)
        of = known[name]
        if name in own or of is None:
            return own[name]
        alone = {each: np.asarray(own[each])[np.newaxis] for each in known if each in own}
        return of(Record(self.robot, alone))[0]
