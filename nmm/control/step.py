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
    was taken; added_residual, how far the added task's rows are from their rate, 0 where rounding hides it.
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
