"""Plans of one robot among obstacles: from scratch, or prepared once and asked for again and again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from threading import RLock
from typing import Any

from numpy.typing import ArrayLike

from nmm.base.arrays import counted, positive, scalar
from nmm.base.errors import InputError, expect_known
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits
from nmm.model.collisions.obstacle import Obstacle, Placement
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.goals import Wanted
from nmm.plugins.planning.plan import Plan
from nmm.plugins.planning.planned import planned
from nmm.plugins.planning.prepared import Asked, Prepared
from nmm.plugins.planning.search import PlanSearch


class Planner:
    """A robot among obstacles, prepared for many plans: each is that of `nmm.plan`, made in less time.

    Parameters
    ----------
    robot : that moves
    obstacles, collisions, limits, tolerance, smooth, objective, effort, margin, hold : as of `nmm.plan`

    Raises
    ------
    InputError : limits of functions, a platform whose ways are not known, an objective without smooth, two
        obstacles of one name

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
    >>> planner, goal = nmm.Planner(robot, [wall]), {"x": 6.0, "y": 0.0, "theta": 0.0}
    >>> plan = planner.plan({"q1": 0.5}, goal)
    >>> planner.update({"wall": [3.0, 3.0, 0.5]})
    >>> planner.plan({"q1": 0.5}, goal).duration < plan.duration
    True
    """

    def __init__(
        self,
        robot: Robot,
        obstacles: Sequence[Obstacle] = (),
        collisions: Collisions | None = None,
        limits: Limits | None = None,
        *,
        tolerance: Goal | None = None,
        smooth: bool = False,
        objective: Objective | None = None,
        effort: bool | Mapping[str, Any] = False,
        margin: float = 0.0,
        hold: Task | str | None = None,
    ) -> None:
        smooth = smooth or isinstance(robot.platform, Tractor)
        if objective is not None and not smooth:
            raise InputError("smooth motions alone have one", where="plan: objective", expected="smooth=True")
        settings = collisions or Collisions()
        asked = Asked(
            collisions=replace(settings, obstacles=(*settings.obstacles, *obstacles)),
            limits=Limits() if limits is None else limits,
            tolerance=tolerance or Goal(),
            smooth=smooth,
            objective=objective,
            effort=effort,
            margin=scalar(margin, "plan: margin", least=0.0),
            hold=hold,
        )
        self.robot = robot
        self._prepared, self._changes = Prepared(robot, asked), RLock()

    def __repr__(self) -> str:
        return f"Planner({self.robot.name}, {len(self.obstacles)} obstacles)"

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Those that its plans keep off; where `move_to` sets one, it is in the next plan."""
        return tuple(self._prepared.asked.collisions.obstacles)

    def plan(
        self,
        start: ArrayLike | Mapping[str, float],
        goal: Wanted,
        seconds: float = 10.0,
        seed: int = 0,
        *,
        through: Sequence[Wanted] = (),
        shorten: int = 200,
        progress: Callable[[float], None] | None = None,
    ) -> Plan:
        """A motion from start to goal that keeps every distance and limit: that of `nmm.plan` with the same
        seed.

        Parameters
        ----------
        start, goal, seconds, seed, through, shorten, progress : as of `nmm.plan`. Plans of several threads
            wait for each other

        Raises
        ------
        InputError, RunError : as `nmm.plan`
        """
        q = self.robot.following.placed(self.robot.q(start))
        self.robot.check_limits(q)
        seconds, shorten = positive(seconds, "seconds"), counted(shorten, "shorten", 0)
        with self._changes:
            prepared = self._prepared = self._prepared.among(self.obstacles)
        with prepared.lock:
            return planned(PlanSearch(prepared, q, [*through, goal], seed), seconds, shorten, progress)

    def update(self, obstacles: Sequence[Obstacle] | Mapping[str, Placement]) -> None:
        """Set what later plans keep off; earlier ones stay as they are.

        Parameters
        ----------
        obstacles : in place of all there were; or by the name of one of them where it stands now: (3,) its
            origin, (6,) with a rotation vector, or (4, 4); m, rad, world axes

        Raises
        ------
        InputError : a name that none of them has, a placement of other numbers, two obstacles of one name
        """
        with self._changes:
            if isinstance(obstacles, Mapping):
                for name in obstacles:
                    expect_known("obstacle", name, [one.name for one in self.obstacles], "update")
                obstacles = [
                    one.standing(obstacles[one.name]) if one.name in obstacles else one
                    for one in self.obstacles
                ]
            self._prepared = self._prepared.among(obstacles)


def plan(
    robot: Robot,
    start: ArrayLike | Mapping[str, float],
    goal: Wanted,
    obstacles: Sequence[Obstacle] = (),
    collisions: Collisions | None = None,
    limits: Limits | None = None,
    seconds: float = 10.0,
    seed: int = 0,
    *,
    tolerance: Goal | None = None,
    through: Sequence[Wanted] = (),
    shorten: int = 200,
    smooth: bool = False,
    objective: Objective | None = None,
    effort: bool | Mapping[str, Any] = False,
    margin: float = 0.0,
    hold: Task | str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """A motion from start to goal that keeps every distance and limit.

    Parameters
    ----------
    start : (n,) or by name, m and rad
    goal : a configuration (n,); coordinates by name, of which the others are free; a `Task` whose target
        stands; or a list of these, of which one is to be reached
    obstacles : those with a `motion` are waited for: the way is looked for among the others, which stand
        where they are at t = 0; where no timing of it works, other ways are tried
    collisions : distances to keep, with obstacles of its own; `Collisions()` with the obstacles when not
        given
    limits : of velocity, acceleration and position; the robot's own when not given
    seconds : after which the search gives up
    seed : of the random numbers; the same plan comes of the same seed
    tolerance : of a task's goal; `Goal()` when not given
    through : goals that are reached on the way, in order
    shorten : how often a shorter way between two points of the motion is tried
    smooth : whether to look for one motion without rests, which takes about half the time and 0.1 to 0.5 s
        more to plan; where none is found that keeps everything, the one with rests stands (`Plan.smooth`). A
        tractor's with trailers always is
    objective : H(q) to minimise along a smooth motion, in the time that it takes without: each of its samples
        costs 0.3 for an input at its limit, 1 for a rate of it at its limit, by their squares, and H
    effort : whether motors keep the torque limits of the robot's file, or masses that the robot carries then,
        kg by frame (as `payload` of `nmm.Dynamics`); what needs more is driven slower
    margin : so much farther than the distance, m, it keeps off what start and goals leave so much room to,
        where such a motion is found in half of the time; for a controller that follows it (`Plan.reference`)
    hold : a frame whose pose stays what it is at the start while the platform moves, or a `Task` whose target
        the start has (`Task(Position("tool"), p)`); goals are then poses of the platform, x, y and theta, and
        the arm's posture there comes of the way. It rests between the platform's arcs and lines
    progress : called with the share of `seconds` that is gone

    Returns
    -------
    Plan; it stands between two of its legs unless it is smooth, and ends at rest.

    Raises
    ------
    InputError : a start that touches something or is outside limits, a goal of another kind, limits of
        functions, a platform whose ways are not known, an objective that changes with time or without smooth,
        what the arm alone cannot hold
    RunError : no goal configuration was found, or no way there, or of a tractor with trailers no exact motion
        along it; the text says what was tried

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
    >>> plan = nmm.plan(robot, {"q1": 0.5}, {"x": 6.0, "y": 0.0, "theta": 0.0}, [wall])
    >>> np.allclose(plan.end[:3], [6.0, 0.0, 0.0], atol=1e-9)
    True
    """
    planner = Planner(
        robot,
        obstacles,
        collisions,
        limits,
        tolerance=tolerance,
        smooth=smooth,
        objective=objective,
        effort=effort,
        margin=margin,
        hold=hold,
    )
    return planner.plan(start, goal, seconds, seed, through=through, shorten=shorten, progress=progress)
