"""A run in numbers: what summary.json holds and the command line's table shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import Array
from nmm.collisions.recorded import described
from nmm.robots.wheel_rates import inputs_held_by
from nmm.runs.broken_limits import fast_wheels
from nmm.runs.margins import at_limits, nearest
from nmm.runs.settling import settling_time

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory

#: Marks a folder as one of ours.
FORMAT = "nmm run 1"


def summarise(trajectory: Trajectory) -> dict[str, Any]:
    """Numbers of a run, ready for JSON: outcome, errors, objective, singular values, lateral slip."""
    robot, count = trajectory.robot, len(trajectory)
    rows = len(trajectory.r_names)
    if np.isnan(trajectory.error).any():  # of tasks that come and go: the most at one time
        rows = int(np.isfinite(trajectory.error).sum(axis=1).max())
    redundancy = {"static": robot.n_independent - rows, "kinematic": robot.n_u - rows}
    summary: dict[str, Any] = {
        "format": FORMAT,
        "made_with": dict(trajectory.made_with),
        "outcome": str(trajectory.outcome),
        "complete": trajectory.complete,
        "message": trajectory.message,
        "warnings": list(trajectory.warnings),
        "robot": {
            "name": robot.name,
            "source": robot.source,
            "arguments": dict(robot.arguments),
            "fingerprint": robot.fingerprint,
        },
        "platform": robot.platform.name,
        "resolver": trajectory.resolver,
        "label": trajectory.label,
        "method": trajectory.method,
        "dt": trajectory.dt,
        "limited": trajectory.limited,
        "limit_names": list(trajectory.limit_names),
        "without_velocity_limit": without_velocity_limit(trajectory),
        "samples": count,
        "kinematics": "pinocchio" if np.isnan(trajectory.kinematics_off) else "compiled",
        "kinematics_off": None if np.isnan(trajectory.kinematics_off) else trajectory.kinematics_off,
        "redundancy": redundancy,
        "r_names": list(trajectory.r_names),
        "r_units": list(trajectory.r_units),
        "frame": trajectory.frame,
        "events": [event._asdict() for event in trajectory.events],
        "obstacles": [
            {"name": one.name, "moves": one.moves, "shape": described(one.shape)[0]}
            for one in trajectory.obstacles
        ],
    }
    if count:
        norm, sizes = trajectory.error_norm, np.linalg.norm(trajectory.u, axis=1)
        half = trajectory.t >= 0.5 * (trajectory.t[0] + trajectory.t[-1])
        limited = (robot, trajectory.limit_names, trajectory.shares)
        summary |= _clearance(trajectory)
        summary |= {
            "t_end": float(trajectory.t[-1]),
            "error_initial": float(norm[0]),
            "error_final": float(norm[-1]),
            "error_max_second_half": float(norm[half].max()),
            "error_rms": _rms(norm),
            "error_max": float(norm.max()),
            "settling_time": settling_time(trajectory),
            "objective_initial": float(trajectory.objective[0]),
            "objective_final": float(trajectory.objective[-1]),
            "objective_mean_second_half": float(trajectory.objective[half].mean()),
            "objective_max_second_half": float(trajectory.objective[half].max()),
            "objective_integral": float(np.trapezoid(trajectory.objective, trajectory.t)),
            "sigma_min": float(trajectory.sigma_min.min()),
            "residual_max": float(trajectory.residual.max()),
            **{f"unmet_{name}": value for name, value in trajectory.unmet._asdict().items()},
            "scale_min": float(trajectory.scale.min()),
            "scaled_share": float(np.mean(np.any(trajectory.scale < 1.0, axis=1))),
            "step_size_min": float(trajectory.step_size.min()),
            "step_size_mean": float(trajectory.step_size.mean()),
            "margin_min": float(trajectory.margin.min()) if np.all(np.isfinite(trajectory.margin)) else None,
            "margin_of": nearest(*limited),
            "standing_at_limits": at_limits(*limited),
            "fast_wheels": fast_wheels(robot, trajectory.q, trajectory.q_dot, trajectory.limit_names),
            "lateral_slip_max": lateral_slip(trajectory),
            "sliding_max": sliding(trajectory),
            "partition_switches": trajectory.switches,
            "input_rms": _rms(sizes),
            "input_peak": float(sizes.max()),
            "u_max": {
                name: float(value)
                for name, value in zip(robot.u_names, np.abs(trajectory.u).max(axis=0), strict=True)
            },
        }
    if redundancy["kinematic"] == 0:
        summary["warnings"].append(
            "the task has as many rows as there are inputs: no redundancy is left to resolve"
        )
    return summary


def without_velocity_limit(trajectory: Trajectory) -> list[str]:
    """The inputs that limits of velocity say nothing of, where limits were kept: its file has none, say.

    An input that equal limits hold at one value has no range: one that never changes is not named.
    """
    if not trajectory.limited or not len(trajectory):
        return []
    named, moved = {*trajectory.limit_names}, np.ptp(trajectory.u, axis=0) > 0.0
    named |= {f"u_{name}" for name in inputs_held_by(trajectory.robot, trajectory.limit_names)}
    names = trajectory.robot.u_names
    return [name for name, moves in zip(names, moved, strict=True) if moves and f"u_{name}" not in named]


def _clearance(trajectory: Trajectory) -> dict[str, Any]:
    """The least distance of a run that kept some: m, when, between what."""
    if not trajectory.clearance_names:
        return {}
    k = int(np.argmin(trajectory.clearance_between))
    pair, least = int(trajectory.clearance_pairs[k]), float(trajectory.clearance_between[k])
    return {
        "clearance_names": list(trajectory.clearance_names),
        "clearance_asked": trajectory.clearance_asked,
        "clearance_min": least if np.isfinite(least) else None,
        "clearance_min_t": float(trajectory.t[k]),
        "clearance_min_pair": trajectory.clearance_names[pair] if pair >= 0 else "",
    }


def _rms(sizes: Array) -> float:
    return float(np.sqrt(np.mean(sizes**2)))


def lateral_slip(trajectory: Trajectory) -> float:
    """The largest |A(qp) qp_dot| of the run, m/s: how much the motion violates the wheels' constraints."""
    platform = trajectory.robot.platform
    n_p = platform.n_p
    return float(np.abs(platform.sideways(trajectory.q[:, :n_p], trajectory.q_dot[:, :n_p])).max(initial=0.0))


def sliding(trajectory: Trajectory) -> float:
    """The most that a wheel slides over the ground by design during the run, m/s: see `Platform.sliding`."""
    platform = trajectory.robot.platform
    return float(platform.sliding(trajectory.u[:, : platform.p]).max(initial=0.0))
