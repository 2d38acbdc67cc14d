"""The numbers of a case: what both runs came to, and what the paper claims of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from nmm.arrays import Array
from nmm.paper.results import Row
from nmm.runs.summary import lateral_slip
from nmm.words import number_text

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.runs.trajectory import Trajectory

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
#: Centre (m) and radius (m) of the circle of eq. (16).
CENTER, RADIUS = (2.0, 2.0), 3.0
#: Step size of both methods and gain of all tasks in the paper's runs, 1/s.
ALPHA, GAIN = 10.0, 1.0


def input_symbol(name: str) -> str:
    """An input as the paper writes it: ω, q̇₁."""
    return {"omega": "ω"}.get(name, f"q̇{name[1:].translate(_SUBSCRIPTS)}" if name[:1] == "q" else name)


def decay_deviation(trajectory: Trajectory) -> float:
    """The largest component of e(t) - e(0) exp(-K t) in the run, in the rows' units."""
    exact = trajectory.error[0] * np.exp(-GAIN * (trajectory.t - trajectory.t[0]))[:, None]
    return float(np.abs(trajectory.error - exact).max())


def decay_rate(t: Array, values: Array, above: float) -> float:
    """Rate of exp(-rate t), 1/s, fitted to the first stretch of `values` above a fraction of the first."""
    end = int(np.argmax(values <= above * values[0])) or len(values)
    return float(-np.polyfit(t[:end], np.log(values[:end]), 1)[0])


def settling_time(trajectory: Trajectory, fraction: float) -> float | None:
    """When H stays below a fraction of H(0) for good, s; None when it does not."""
    above = np.flatnonzero(trajectory.objective > fraction * trajectory.objective[0])
    last = int(above[-1]) + 1 if above.size else 0
    return float(trajectory.t[last]) if last < len(trajectory) else None


def second_half(trajectory: Trajectory) -> Array:
    """H in the second half of the run, where the motion is steady."""
    return np.asarray(trajectory.objective[trajectory.t >= 0.5 * (trajectory.t[0] + trajectory.t[-1])])


def ripple(trajectory: Trajectory) -> float:
    """Largest less smallest H in the second half of the run."""
    return float(np.ptp(second_half(trajectory)))


def backing_up(trajectory: Trajectory) -> float:
    """How long the platform drives backwards from the start, s."""
    forward = np.flatnonzero(trajectory.u[:, 0] >= 0.0)
    return float(trajectory.t[forward[0]] if forward.size else trajectory.t[-1])


def smallest_determinant(trajectory: Trajectory, controller: Controller) -> float | None:
    """The smallest |det Ja| along RG's motion, Ja the columns of J_bar in use; None for other resolvers."""
    if np.any(trajectory.partition < 0):
        return None
    found = []
    for t, q, columns in zip(trajectory.t, trajectory.q, trajectory.partition, strict=True):
        found.append(abs(float(np.linalg.det(controller.evaluate(float(t), q).J[:, columns]))))
    return min(found)


def table(rg: Trajectory, pg: Trajectory, determinant: float | None) -> list[Row]:
    """The numbers of both runs of a case."""

    def row(name: str, unit: str, number: Callable[[Trajectory], float | None], digits: int = 3) -> Row:
        return Row(name, unit, number_text(number(rg), digits), number_text(number(pg), digits))

    units = ", ".join(dict.fromkeys(rg.r_units))
    rows = [
        row("‖e‖ at the start", units, lambda run: float(run.error_norm[0]), 4),
        row("‖e‖ at the end", units, lambda run: float(run.error_norm[-1])),
        row("largest |e(t) − e(0) exp(−K t)|", units, decay_deviation),
        Row(
            "fitted rate of decay of ‖e‖",
            "1/s",
            *(f"{decay_rate(run.t, run.error_norm, 1e-9):.5f}" for run in (rg, pg)),
        ),
        row("H at the start", "1", lambda run: float(run.objective[0]), 4),
        row("H below 10 % of that for good after", "s", lambda run: settling_time(run, 0.1)),
        row("H below 1 % of that for good after", "s", lambda run: settling_time(run, 0.01)),
        row("H below 0.1 % of that for good after", "s", lambda run: settling_time(run, 0.001)),
        row("mean H in the second half", "1", lambda run: float(second_half(run).mean())),
        row("largest H in the second half", "1", lambda run: float(second_half(run).max())),
        row("ripple (largest less smallest H) there", "1", ripple),
        row("smallest singular value of J̄", "mixed", lambda run: float(run.sigma_min.min())),
        Row("smallest |det Ja|", "mixed", number_text(determinant), "–"),
        Row("switches of partition", "1", str(rg.switches), "–"),
        row("smallest θ", "rad", lambda run: float(run.q[:, 2].min())),
        row("largest θ", "rad", lambda run: float(run.q[:, 2].max()), 4),
        row("largest ‖J̄ u − rate‖", "mixed", lambda run: float(run.residual.max()), 2),
        row("largest sideways velocity", "m/s", lateral_slip, 2),
    ]
    robot = rg.robot
    for column, (name, unit) in enumerate(zip(robot.u_names, robot.u_units, strict=True)):
        sizes = (float(np.abs(run.u[:, column]).max()) for run in (rg, pg))
        rows.append(Row(f"largest |{input_symbol(name)}|", unit, *(number_text(size) for size in sizes)))
    return rows
