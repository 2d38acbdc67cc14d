"""A run in numbers, for summary.json and the command line's table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.findings import Finding
from nmm.base.findings.run import MOTORS
from nmm.control.step.quantities import Number, placed
from nmm.model.collisions.obstacle import obstacle_as_json
from nmm.model.robots.wheel_rates import inputs_held_by
from nmm.motion.diagnosis.limits import fast_wheels
from nmm.motion.diagnosis.motors import motor_findings
from nmm.motion.margins import at_limits, nearest_limits

if TYPE_CHECKING:
    from nmm.motion.trajectory import Trajectory

FORMAT = "nmm run 1"
#: The settling band, as a share of the initial error.
BAND = 0.02
#: A run that starts with an error this small has nothing to settle from, m and rad.
NO_ERROR = 1e-6


def summarise(trajectory: Trajectory, motors: bool = True) -> dict[str, Any]:
    """`motors`: also what motors and wheels find, which takes longer than a short run does."""
    robot, count = trajectory.robot, len(trajectory)
    rows = len(trajectory.r_names)
    if np.isnan(trajectory.error).any():  # of tasks that come and go: the most at one time
        rows = int(np.isfinite(trajectory.error).sum(axis=1).max())
    redundancy = {"static": robot.n_independent - rows, "kinematic": robot.n_u - rows}
    off = None if np.isnan(trajectory.kinematics_off) else trajectory.kinematics_off
    summary: dict[str, Any] = {
        "format": FORMAT,
        "made_with": dict(trajectory.made_with),
        "outcome": str(trajectory.outcome),
        "complete": trajectory.complete,
        "message": trajectory.message,
        "warnings": list(trajectory.warnings),
        "findings": trajectory.verdict.as_json(),
        "robot": {
            "name": robot.name,
            "source": robot.source,
            "arguments": dict(robot.arguments),
            "fingerprint": robot.fingerprint,
            **({"numbers": dict(robot.changed_numbers)} if robot.changed_numbers else {}),
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
        "kinematics": "pinocchio" if off is None else "compiled",
        "kinematics_off": off,
        "redundancy": redundancy,
        "r_names": list(trajectory.r_names),
        "r_units": list(trajectory.r_units),
        "frame": trajectory.frame,
        "events": [event._asdict() for event in trajectory.events],
        "obstacles": [
            {"name": obstacle.name, "moves": obstacle.moves, "shape": obstacle_as_json(obstacle.shape)[0]}
            for obstacle in trajectory.obstacles
        ],
    }
    if trajectory.cameras:
        summary["cameras"] = [camera.as_json() for camera in trajectory.cameras]
    if count:
        if trajectory.clearance_names:
            summary["clearance_names"] = list(trajectory.clearance_names)
            summary["clearance_asked"] = trajectory.clearance_asked
        summary |= _numbers(trajectory)
    if redundancy["kinematic"] == 0 and not any(
        finding.code == "no_redundancy" for finding in trajectory.findings
    ):
        finding = Finding("no_redundancy")
        summary["findings"].append({**finding.as_json(), "line": f"warnings.{len(summary['warnings'])}"})
        summary["warnings"].append(str(finding))
    if motors:
        summary["findings"] += [
            {**finding.as_json(), "line": MOTORS} for finding in motor_findings(trajectory)
        ]
    return summary


def without_velocity_limit(trajectory: Trajectory) -> list[str]:
    """The inputs without a velocity limit in a limited run, except those that never change: equal limits,
    which hold an input at one value, have no range."""
    if not trajectory.limited or not len(trajectory):
        return []
    named, moved = {*trajectory.limit_names}, np.ptp(trajectory.u, axis=0) > 0.0
    named |= {f"u_{name}" for name in inputs_held_by(trajectory.robot, trajectory.limit_names)}
    names = trajectory.robot.u_names
    return [name for name, moves in zip(names, moved, strict=True) if moves and f"u_{name}" not in named]


def _numbers(trajectory: Trajectory) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for series in placed():
        numbers = [*series.numbers, *(number for number in RUN_NUMBERS if number.after == series.name)]
        x = trajectory[series.name] if numbers else ()
        for number in numbers if len(x) else ():
            if number.after:
                values[number.key] = number.of(trajectory)
            else:
                values[number.key] = np.asarray(number.of(trajectory.t, x)).item()
    return values


def _nearest_pair(run: Trajectory) -> str:
    pair = int(run.clearance_pairs[np.argmin(run.clearance_between)])
    return run.clearance_names[pair] if pair >= 0 else ""


def _input_peaks(run: Trajectory) -> dict[str, float]:
    return dict(zip(run.robot.u_names, np.abs(run.u).max(axis=0).tolist(), strict=True))


def settling_time(trajectory: Trajectory) -> float | None:
    """Time until ‖e‖ last falls to 2 % of ‖e(t0)‖, s, with log-linear interpolation; ln 50 / K for exp(-K t).
    None if it does not stay there, was 0 at the start, or for tasks that come and go."""
    t, norm = trajectory.t, trajectory.error_norm
    if not len(t) or trajectory.events or not NO_ERROR < norm[0] < np.inf:
        return None
    band = BAND * float(norm[0])
    last = int(np.flatnonzero(norm > band)[-1])
    if last == len(t) - 1:
        return None
    before, after = float(norm[last]), max(float(norm[last + 1]), np.finfo(float).tiny)
    share = math.log(before / band) / math.log(before / after)
    return float(t[last] - t[0] + share * (t[last + 1] - t[last]))


#: Numbers of a run as a whole, from the trajectory.
RUN_NUMBERS = (
    Number("clearance_min_pair", _nearest_pair, after="clearance_between"),
    Number(
        "settling_time", settling_time, "‖e‖ down to 2 % after", r"$\|e\|$ down to 2\,\% after", "",
        "s", "error_norm",
    ),
    Number("unmet_samples", lambda run: run.unmet.samples, after="residual"),
    Number(
        "unmet_share", lambda run: run.unmet.share,
        about="share of the samples at which J u was not the rate", after="residual",
    ),
    Number("unmet_largest", lambda run: run.unmet.largest, after="residual"),
    Number("unmet_relative", lambda run: run.unmet.relative, after="residual"),
    Number("unmet_t", lambda run: run.unmet.t, after="residual"),
    Number("margin_of", lambda run: nearest_limits(run.robot, run.limit_names, run.shares), after="margin"),
    Number(
        "standing_at_limits", lambda run: at_limits(run.robot, run.limit_names, run.shares), after="margin"
    ),
    Number(
        "fast_wheels", lambda run: fast_wheels(run.robot, run.q, run.q_dot, run.limit_names), after="margin"
    ),
    Number("u_max", _input_peaks, "|{}|, largest", "{}, largest", "", "inputs", "input_norm"),
)  # fmt: skip
