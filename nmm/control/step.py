"""What a controller found in one call."""

from __future__ import annotations

from dataclasses import dataclass

from nmm.arrays import Array, Integers
from nmm.resolvers.answer import Status


@dataclass(frozen=True, eq=False)
class Step:
    """Everything that a controller found at (t, q): copies, in the units of the task's rows.

    r, r_d, error, rate (s,), J (s, m) of J_bar u = rate; objective H and gradient h (m,);
    u (m,), q_dot = S u (n,); status, scale (levels,), residual ‖J u - rate‖, measure, excess: see `Answer`;
    partition (s,) the columns of Ja, -1 where there is none; retreats so far; step_size, the share of α that
    was taken; added_residual, how far the added task's rows are from their rate, 0 where rounding hides it;
    side, the sign of det J_e where the extended Jacobian inverted it, else 0.

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
