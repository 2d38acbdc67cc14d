"""How fast legs are taken to be, and where configurations are drawn, when a plan is searched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.control.functions.tasks.task import Task
from nmm.control.limits.limits import LimitsOn
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.shapes import HalfSpace
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.goals import Wanted, alternatives

#: Speeds where inputs have no limits, m/s and rad/s; the stop between legs where accelerations have none, s.
USUAL, PAUSE = 1.0, 0.2
#: Around start, goals and obstacles there is this much room to drive, in sizes of the robot and in m.
AROUND = 1.0


def usual_speeds(robot: Robot, limits: LimitsOn) -> Array:
    """Speeds (3 + n,) of a leg's numbers whose inputs have no limits: USUAL in the platform's frame, as
    inputs may be rates of wheels; infinite for the others."""
    usual = np.full(3 + robot.n, np.inf)
    free = np.asarray(np.isinf(limits.inputs).any(axis=1))
    coordinates = np.asarray(robot.rate_coordinates)
    usual[3 + coordinates[free & (coordinates >= 0)]] = USUAL
    if robot.platform.n_p >= 3 and np.any(free[: robot.platform.p]):
        usual[:3] = USUAL
    return usual


def leg_speeds(robot: Robot, limits: LimitsOn, usual: Array) -> Array:
    """How fast each number of a leg goes, (3 + n,), to weigh them."""
    speeds = usual.copy()
    top = np.abs(limits.inputs).max(axis=1)
    for j, i in enumerate(robot.rate_coordinates):
        if i >= 0:
            speeds[3 + i] = min(speeds[3 + i], top[j])
    if robot.platform.n_p >= 3:
        G = np.abs(robot.platform.G(np.zeros(robot.platform.n_p))[:3])
        driven = [np.sum(row[row > 0.0] * top[: robot.platform.p][row > 0.0]) for row in G]
        speeds[:3] = np.minimum(speeds[:3], [max(driven[0], 1e-3), np.inf, driven[2] or USUAL])
        speeds[1] = speeds[0]
    return speeds


def pause_between(limits: LimitsOn) -> float:
    """What a stop between two legs takes, about, s."""
    finite = limits.accelerations[np.isfinite(limits.accelerations)]
    return float(np.clip(USUAL / finite.min(), PAUSE, 2.0)) if len(finite) else PAUSE


def allowed(robot: Robot, limits: LimitsOn) -> Array:
    """Where coordinates may be, (n, 2): within the robot's limits and those asked for; infinite for none."""
    own, asked = np.where(robot.limited, robot.q_limits, [-np.inf, np.inf]), limits.coordinates
    return np.column_stack([np.maximum(own[:, 0], asked[:, 0]), np.minimum(own[:, 1], asked[:, 1])])


def drawn_within(
    robot: Robot, start: Array, goals: Sequence[Wanted], obstacles: Sequence[Obstacle], within: Array
) -> tuple[Array, Array]:
    """Where configurations are drawn, (n,) each: joints within limits (n, 2), the platform around all that is
    known."""
    low, high = np.where(np.isfinite(within), within, [-np.pi, np.pi]).T.copy()
    # What goes round and starts far from 0 is drawn all round.
    far_round = robot.continuous & (np.abs(start) > 0.5 * np.pi)
    low = np.where(far_round, start - np.pi, np.maximum(low, start - np.pi))
    high = np.where(far_round, start + np.pi, np.minimum(high, start + np.pi))
    if robot.platform.n_p >= 3:
        points = [start[:2]]
        for obstacle in obstacles:
            geometry, place = obstacle.shape.geometry(), obstacle.at(0.0)
            if isinstance(obstacle.shape, HalfSpace):
                continue
            geometry.computeLocalAABB()
            radius = geometry.aabb_radius
            middle = place.act(geometry.aabb_center)[:2]
            points += [middle - radius, middle + radius]
        for wanted in goals:
            for goal in alternatives(wanted):
                if isinstance(goal, Mapping) and {"x", "y"} <= goal.keys():
                    points.append(np.array([goal["x"], goal["y"]], dtype=np.float64))
                elif not isinstance(goal, Mapping | Task):
                    points.append(robot.q(goal)[:2])
        around = AROUND + 2.0 * robot.reach
        low[:2], high[:2] = np.min(points, axis=0) - around, np.max(points, axis=0) + around
        middle = start[2] if np.isfinite(within[2]).any() else 0.0
        low[2], high[2] = middle - np.pi, middle + np.pi
    return np.maximum(low, within[:, 0]), np.minimum(high, within[:, 1])
