"""A plan that goes on from where the robot is: what is left of another, joined, or a search grown from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, counted, positive, scalar
from nmm.base.errors import InputError, expect_kind
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.platforms.tractor import Tractor
from nmm.plugins.planning.plan import Found, Plan
from nmm.plugins.planning.planned import finished
from nmm.plugins.planning.prepared import STEP
from nmm.plugins.planning.search import PlanSearch

#: Times at which the plan's nearest point is looked for, s apart.
NEAR = 0.05


def replan(
    plan: Plan,
    q: ArrayLike | Mapping[str, float],
    obstacles: Sequence[Obstacle] | None = None,
    t: float | None = None,
    seconds: float = 10.0,
    seed: int = 0,
    *,
    shorten: int = 50,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """A plan from where the robot is now to where another leads.

    What is left of the other plan is looked at first: where it is free it is kept, with the way that joins
    it soonest. Else the search begins with the parts of it that are free. Way-points (`through`) that are
    still ahead are passed where the plan is kept, and not asked for otherwise.

    Parameters
    ----------
    plan : of `nmm.plan` or this
    q : where the robot is, (n,) or by name, m and rad
    obstacles : that stand now, in place of all that the plan knew; these where they are now when None
    t : how much of the plan is gone, s; that of its point nearest to q when None
    seconds, seed, shorten, progress : as of `nmm.plan`; a plan that is kept is not shortened

    Returns
    -------
    Plan, whose `motions` and `postures` count what was looked at now.

    Raises
    ------
    InputError, RunError : as `nmm.plan`

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
    >>> plan = nmm.plan(robot, robot.rest, {"x": 6.0, "y": 0.0, "theta": 0.0}, [wall])
    >>> (half,), _ = plan(0.5 * plan.duration)
    >>> on = nmm.replan(plan, half + 0.02)
    >>> np.allclose(on.end, plan.end), on.duration < plan.duration, on.motions < plan.motions
    (True, True, True)
    """
    expect_kind(plan, Plan, "replan", "a Plan, as nmm.plan returns it")
    robot, old = plan.robot, plan.found
    if isinstance(robot.platform, Tractor):
        raise InputError(
            "a tractor with trailers is not replanned for", where="replan: plan", expected="another nmm.plan"
        )
    if old.asked.hold is not None:
        raise InputError("a plan that holds something is not replanned", where="replan: plan")
    start = robot.following.placed(robot.q(q))
    robot.check_limits(start)
    if obstacles is None:
        obstacles = old.asked.collisions.obstacles
    if any(obstacle.moves for obstacle in obstacles):
        what = "obstacles that move along a path are not replanned for"
        raise InputError(what, where="replan: obstacles", expected="nmm.Horizon, which steps aside")
    prepared = old.prepared.among(obstacles)
    with prepared.lock:
        search = PlanSearch(prepared, start, [old.goal], seed, "replan: q", _nearer(old))
        search.begin(positive(seconds, "seconds"), progress)
        return _joined(search, plan, t, counted(shorten, "shorten", 0))


def _nearer(old: Found) -> dict[tuple[str, str], float]:
    """How near pairs of the robot's own shapes may be, m, by name: as in the plan before, else the way to its
    end may be closed."""
    others = {obstacle.name for obstacle in old.asked.collisions.obstacles}
    return {pair: near for pair, near in old.nearer.items() if others.isdisjoint(pair)}


def _joined(search: PlanSearch, plan: Plan, t: float | None, shorten: int) -> Plan:
    """The plan from a search's start on: the rest of another, joined, or what is found from its parts."""
    start = search.start
    rest = _rest(plan, start, t)
    if search.check.too_near(rest[-1]) < 0:
        search.widen(start, rest[-1])
    ways = [search.guide.way(a, b) for a, b in pairwise(rest)]
    free = [search.blocked(a, way) < 0 for a, way in zip(rest, ways, strict=False)]
    first = free.index(False) if False in free else len(free)
    last = len(free) - free[::-1].index(False) if False in free else 0
    # What is joined is what begins free: all of it, or up to where something is in the way.
    joined, join = _join(search, start, rest[: first + 1], ways)
    if joined is not None and first == len(free):
        return finished(search, np.vstack([join, *ways[joined:]]))
    ahead: list[Array] = [] if joined is None else rest[joined : first + 1]
    goals, behind = rest[-1:], rest[last:-1]
    if search.check.too_near(rest[-1]) >= 0:
        goals, behind = search.ends(plan.found.goal, start), []
    legs = search.farther(start, goals, ahead, behind)
    return finished(search, search.shortened(start, legs, shorten))


def _rest(plan: Plan, q: Array, t: float | None) -> list[Array]:
    """Configurations (n,) of a plan from a time or its point nearest to q on, to its end: where it stops,
    and between, at most `STEP` s apart."""
    if t is None:
        times = np.arange(0.0, plan.duration + NEAR, NEAR)
        off = plan.robot.short_way(plan(times)[0] - q)
        t = float(times[np.einsum("ki,ki->k", off, off).argmin()])
    begin = min(max(scalar(t, "t"), 0.0), plan.duration)
    stops = [begin, *(stop for stop in plan.stops if stop > begin)]
    parts = [np.linspace(a, b, 1 + math.ceil((b - a) / STEP))[:-1] for a, b in pairwise(stops)]
    return list(plan(np.concatenate([*parts, [plan.duration]]))[0])


def _join(
    search: PlanSearch, q: Array, rest: Sequence[Array], ways: Sequence[Array]
) -> tuple[int | None, Array]:
    """At which of these configurations, joined by ways, the soonest free way from q joins them, and it."""
    joins = [search.guide.way(q, configuration) for configuration in rest]
    after = np.cumsum([0.0, *(search.guide.times(way).sum() for way in ways[: len(rest) - 1])])
    takes = [float(search.guide.times(join).sum()) for join in joins]
    for k in np.argsort(takes + after[-1] - after):
        if search.blocked(q, joins[k]) < 0:
            return int(k), joins[k]
    return None, joins[0]
