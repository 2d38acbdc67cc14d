"""The columns of a sweep's table: what is measured of each rollout, in its unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nmm.sweeps.definition import Definition

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory

#: ‖e‖ has settled where it stays below this share of its start.
SETTLED = 0.02


class Column(NamedTuple):
    """A column: its name, its type ("number", "count" or "text"), its unit, and what it is."""

    name: str
    kind: str
    unit: str
    about: str


MEASURED = (
    Column(
        "outcome", "text", "", "how the rollout ended (docs/outcomes.md); refused: what varies is no input"
    ),
    Column("message", "text", "", "why"),
    Column("warnings", "count", "", "how many things the run warned of"),
    Column("t_end", "number", "s", "its last instant"),
    Column(
        "arrival",
        "number",
        "s",
        "with `until` when it was there; without, from when on ‖e‖ < 2 % of its start",
    ),
    Column("error_initial", "number", "", "‖e‖ at the start, rows in m and rad"),
    Column("error_final", "number", "", "‖e‖ at the end"),
    Column("error_max", "number", "", "largest ‖e‖"),
    Column("error_max_second_half", "number", "", "largest ‖e‖ of the second half"),
    Column("error_rms", "number", "", "root mean square of ‖e‖"),
    Column("objective_initial", "number", "", "H at the start"),
    Column("objective_final", "number", "", "H at the end"),
    Column("objective_mean_second_half", "number", "", "mean H of the second half"),
    Column("objective_max_second_half", "number", "", "largest H of the second half"),
    Column("objective_integral", "number", "", "∫ H dt"),
    Column("scale_min", "number", "", "least λ: the share of the task's rate that limits left"),
    Column("scaled_share", "number", "", "share of the time with λ < 1"),
    Column("sigma_min", "number", "", "least singular value of J"),
    Column("residual_max", "number", "", "largest ‖J u - rate‖"),
    Column("unmet_share", "number", "", "share of the samples at which J u was not the rate"),
    Column("margin_min", "number", "", "least distance to a limit, as a share of its range"),
    Column("clearance_min", "number", "m", "least distance of what is kept apart"),
    Column("effort", "number", "", "∫ ‖u‖² dt"),
    Column("input_rms", "number", "", "root mean square of ‖u‖"),
    Column("input_peak", "number", "", "largest ‖u‖"),
    Column("partition_switches", "count", "", "how often RG changed its partition"),
    Column("step_size_min", "number", "", "least share of α that was taken"),
    Column("lateral_slip_max", "number", "m/s", "largest slip of the wheels"),
)


def columns_of(definition: Definition) -> list[Column]:
    """All columns of a sweep: the row's number, what varies, what is measured, the inputs' largest values."""
    parameters = [
        Column(one.key, "number" if one.numeric else "text", "", "varied") for one in definition.vary
    ]
    peaks = [
        Column(f"u_max.{name}", "number", "", f"largest |{name}|, per second") for name in definition.inputs
    ]
    return [Column("index", "count", "", "the row's number"), *parameters, *MEASURED, *peaks]


def measured(trajectory: Trajectory) -> dict[str, Any]:
    """What is measured of a rollout, by column: the run's summary, and when it arrived, at what effort."""
    summary = trajectory.summary()
    found = {column.name: summary.get(column.name) for column in MEASURED}
    found["warnings"] = len(summary["warnings"])
    if len(trajectory):
        found["arrival"] = _arrival(trajectory, summary)
        found["effort"] = float(np.trapezoid(np.sum(trajectory.u**2, axis=1), trajectory.t))
    return found | {f"u_max.{name}": value for name, value in summary.get("u_max", {}).items()}


def failed(outcome: str, message: str) -> dict[str, Any]:
    """The same of a rollout of which there is nothing but why."""
    return {column.name: None for column in MEASURED} | {
        "outcome": outcome,
        "message": message,
        "warnings": 0,
    }


def _arrival(trajectory: Trajectory, summary: dict[str, Any]) -> float | None:
    """When the target was reached, s, or ‖e‖ settled; None where it never did."""
    until = (trajectory.scenario or {}).get("until")
    if until is not None:
        return summary["t_end"] if trajectory.complete else None
    above = np.flatnonzero(trajectory.error_norm > SETTLED * summary["error_initial"])
    first = int(above[-1]) + 1 if len(above) else 0
    return float(trajectory.t[first]) if first < len(trajectory) else None
