"""Findings of a run about limits and distances: exceeded limits, collisions, limits that bind."""

from collections.abc import Collection, Iterable, Iterator
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.text_format import listed
from nmm.control.controller import Controller
from nmm.control.limits.limits import LimitsOn
from nmm.control.step.safety_filter import Counts
from nmm.model.collisions.scene import Scene
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import turning_wheels
from nmm.motion.clearance import ROUNDING, Swept
from nmm.motion.margins import standing
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory

#: Exceeding a limit by less than this part of it is rounding.
SLACK = 1e-6
#: A quantity is at its limit within this share of its range.
AT_LIMIT = 1e-6
_SHOWN = 3
#: Below this ratio of its singular values J has lost rank.
LOST = 1e-9


def broken_limits(robot: Robot, t: Array, q: Array, u: Array) -> Iterator[Finding]:
    """Coordinates and inputs beyond their limits along t (N,), s, q (N, n), u (N, n_u)."""
    coordinates = []
    for i in robot.following.independent:  # what follows one of these has its limits, too
        lower, upper = robot.q_limits[i]
        size = max(1.0, abs(lower), abs(upper))
        coordinates += _left(
            robot.q_names[i], robot.q_units[i], t, q[:, i], lower, upper, size if np.isfinite(size) else 1.0
        )
    if coordinates:
        yield Finding("coordinates_beyond_limits", {"coordinates": coordinates})
    largest = np.abs(u).max(axis=0, initial=0.0)
    inputs = [
        {"name": name, "largest": float(most), "unit": unit, "limit": float(limit)}
        for name, most, unit, limit in zip(robot.u_names, largest, robot.u_units, robot.u_limits, strict=True)
        if most - limit > SLACK * (limit if np.isfinite(limit) else 1.0)
    ]
    if inputs:
        yield Finding("inputs_beyond_limits", {"inputs": inputs})


def fast_wheels(robot: Robot, q: Array, q_dot: Array, kept: Collection[str]) -> dict[str, float]:
    """The largest rates, rad/s, of wheels beyond their file's limit, except `kept`; q, q_dot (N, n)."""
    names, rates = turning_wheels(robot, q, q_dot)
    own = {wheel.joint: wheel.velocity for wheel in robot.wheels}
    largest = dict(zip(names, np.abs(rates).max(axis=0, initial=0.0).tolist(), strict=True))
    return {
        name: rate for name, rate in largest.items() if name not in kept and rate > own[name] * (1.0 + SLACK)
    }


def broken_rows(kept: LimitsOn, t: Array, rows: Array) -> Iterator[Finding]:
    """Functions beyond their limits; rows (N, rows), as `kept.rows` names them."""
    broken = []
    for row, x in zip(kept.row_limits, rows.T, strict=False):
        size = max([1.0, *(abs(end) for end in (row.lower, row.upper) if np.isfinite(end))])
        for place in _left(row.name, row.unit, t, x, row.lower, row.upper, size):
            beyond = np.maximum(x - row.upper, row.lower - x)
            samples = int(np.count_nonzero(beyond > SLACK * size))
            broken.append({**place, "beyond": float(beyond.max()), "samples": samples, "of": len(t)})
    if broken:
        yield Finding("functions_beyond_limits", {"functions": broken})


def _left(
    name: str, unit: str, t: Array, x: Array, lower: float, upper: float, size: float
) -> list[dict[str, Any]]:
    """Where x (N,) first leaves its limits, of that size, for JSON (None: no such limit); empty if never."""
    (beyond,) = np.nonzero(np.maximum(x - upper, lower - x) > SLACK * size)
    ends = {"lower": lower, "upper": upper}
    known = {side: float(end) if np.isfinite(end) else None for side, end in ends.items()}
    return [{"name": name, "t": float(t[k]), "value": float(x[k]), "unit": unit, **known} for k in beyond[:1]]


def binding(trajectory: Trajectory, kept: LimitsOn) -> Iterator[Finding]:
    """The three limits that most often bind where λ < 1."""
    moving = ~standing(trajectory.robot, trajectory.limit_names, trajectory.shares)
    relaxed = np.any(trajectory.scale < 1.0, axis=1)
    if not relaxed.any() or not moving.any():
        return
    shares = trajectory.shares[relaxed]
    lost = {name: loss / kept.sizes[name] for name, loss in kept.losses.items()}
    near = AT_LIMIT + np.array([lost.get(name, 0.0) for name in trajectory.limit_names])
    often = np.where(moving, np.mean(np.minimum(shares, 1.0 - shares) <= near, axis=0), 0.0)
    order = [i for i in np.argsort(-often, kind="stable")[:_SHOWN] if often[i] > 0.0]
    if order:
        limits = {trajectory.limit_names[i]: float(often[i]) for i in order}
        yield Finding("limits_binding", {"limits": limits})


def not_kept(recorder: Recorder, controller: Controller) -> Iterator[Finding]:
    """Contradictory limits, retreats, an added task not done, a resolver without an answer."""
    times, recorded = recorder.t, recorder.so_far
    units = controller.solver.limits_on.rate_units
    excesses = recorder.beyond
    for name in dict.fromkeys(name for beyond in excesses.values() for name in beyond):
        broken = {k: beyond[name] for k, beyond in excesses.items() if name in beyond}
        values = {
            "name": name,
            "samples": len(broken),
            "beyond": max(broken.values()),
            "unit": units.get(name, "m/s"),  # no row's is a distance
            "against": list(recorder.against[name]),
        }
        yield Finding("limit_contradicted", values, {"t": float(times[min(broken)])})
    backed_off = times[np.diff(recorder.retreats[: len(times)], prepend=recorder.backed_off) > 0]
    if len(backed_off):
        yield Finding("backed_off", {"times": backed_off.tolist()})
    missed = times[recorded.added_residual > 0.0]
    if len(missed):
        values = {
            "samples": len(missed),
            "end": float(missed[-1]),
            "again": bool(missed[-1] < recorder.reached),
            "largest": float(recorded.added_residual.max()),
            "unit": _of_rates(row.unit for row in controller.solver.added_on.rows),
        }
        yield Finding("added_task_missed", values, {"t": float(missed[0])})
    unanswered = times[recorded.unanswered > 0]
    if len(unanswered):
        singular = recorder.singular_values[recorded.unanswered > 0]
        lost = bool(np.any(singular[:, -1] <= LOST * singular[:, 0]))
        values = {"samples": len(unanswered), "lost_rank": lost}
        yield Finding("no_answer", values, {"t": float(unanswered[0])})


def _of_rates(units: Iterable[str]) -> str:
    return listed([f"{unit}/s" for unit in dict.fromkeys(units)])


def distances_short(setting: Scene, found: Swept, t: Array, counts: Counts) -> Iterator[Finding]:
    """Findings on distances at times t (N,), s: pairs left out, distances that fell short, braking."""
    yield from (Finding("distances_note", {"text": note}) for note in setting.notes)
    if not len(t):
        return
    asked = setting.distance
    (clear,) = np.nonzero(found.clearance >= asked - ROUNDING)
    first = int(clear[0]) if clear.size else len(t)
    if first > 0:
        values = {
            "distance": asked,
            "name": setting.words(int(found.pairs[0])),
            "own": setting.names[int(found.pairs[0])][1]
            not in {obstacle.name for obstacle in setting.obstacles},
            "clearance": float(found.clearance[0]),
            "back": float(t[first]) if clear.size else None,
        }
        yield Finding("start_too_near", values, {"t": float(t[0])})
    short = np.flatnonzero(found.between[first:] < asked - ROUNDING) + first
    if short.size:
        k = int(short[np.argmin(found.between[short])])
        values = {
            "distance": asked,
            "samples": len(short),
            "name": setting.words(int(found.between_pairs[k])),
            "clearance": float(found.between[k]),
        }
        yield Finding("distance_not_kept", values, {"t": float(t[k])})
    if counts.braked:
        yield Finding("braked", {"samples": counts.braked, "in_vain": counts.short})


def ran_into(setting: Scene, found: Swept, t: Array) -> Finding | None:
    """The collision of a run that was clear before, and its time; such a run is not completed."""
    within = found.between < -ROUNDING
    into = np.flatnonzero(within & np.logical_or.accumulate(~within))
    if not into.size:
        return None
    begun, worst = int(into[0]), int(into[np.argmin(found.between[into])])
    values = {"name": setting.words(int(found.between_pairs[worst])), "depth": float(-found.between[worst])}
    return Finding("collided", values, {"t": float(t[begun])})
