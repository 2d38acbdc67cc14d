"""A plan: a motion from a start to a goal that keeps distances and limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal
from nmm.control.limits.limits import LimitsOn
from nmm.model.collisions.scene import Scene
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Trajectory
from nmm.plugins.planning.following import FromPlan
from nmm.plugins.planning.goals import Wanted, goal_task
from nmm.plugins.planning.objective import SampleCosts
from nmm.plugins.planning.prepared import Asked, Prepared
from nmm.plugins.planning.recorded import recorded
from nmm.plugins.planning.samples import SampledMotion


class TimedMotion(Protocol):
    """A motion in time.

    stops (K,) : when it begins, rests between and ends, s; corners (K, n) : where it is then
    """

    @property
    def stops(self) -> Array: ...

    @property
    def corners(self) -> Array: ...

    @property
    def duration(self) -> float: ...

    def at(self, t: Array) -> tuple[Array, Array]:
        """q (N, n) and u (N, n_u) at times t (N,) from 0 to `duration`, s."""
        ...


class Found(NamedTuple):
    """What a search leaves to a plan: its motion, its goal, the trees that were grown, (E, 2, n), what
    another search is made with, and pairs by name that come nearer than what is kept, how near, m."""

    motion: TimedMotion
    goal: Wanted
    tree: Array
    prepared: Prepared
    nearer: Mapping[tuple[str, str], float]

    @property
    def limits(self) -> LimitsOn:
        return self.prepared.limits

    @property
    def scene(self) -> Scene | None:
        return self.prepared.scene

    @property
    def asked(self) -> Asked:
        return self.prepared.asked


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion q̇ = S(q) u from a start to a goal, made by `nmm.plan`.

    Attributes
    ----------
    robot : that moves
    motions, postures : how many were looked at

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> plan = nmm.plan(robot, robot.rest, {"x": 2.0, "y": 1.0, "theta": 0.0})
    >>> q, u = plan([0.0, plan.duration])
    >>> np.allclose(q[0], robot.rest), np.allclose(q[-1], plan.end)
    (True, True)
    """

    robot: Robot
    motions: int
    postures: int
    found: Found = field(repr=False)

    @property
    def stops(self) -> Array:
        """The times at which it begins, rests and ends, (L + 1,), s."""
        return self.found.motion.stops

    @property
    def corners(self) -> Array:
        """Where it is at its `stops`, (L + 1, n); angles of the platform are not wrapped."""
        return self.found.motion.corners

    @property
    def end(self) -> Array:
        """Where it ends, (n,)."""
        return self.corners[-1]

    @property
    def duration(self) -> float:
        """How long it takes, s."""
        return self.found.motion.duration

    @property
    def tree(self) -> Array:
        """The trees that the search grew, (E, 2, n), m and rad: motions from one configuration to the next,
        those of the start's tree first. There are none where a way is free at once."""
        return self.found.tree

    @property
    def smooth(self) -> bool:
        """Whether it goes on without rests, as asked for by `smooth`, but for those at `through`."""
        return self.found.asked.smooth and isinstance(self.found.motion, SampledMotion)

    def __call__(self, t: ArrayLike) -> tuple[Array, Array]:
        """q (N, n) and u (N, n_u) at times t (N,), s; before it begins and after it ends it stands."""
        times = np.clip(np.atleast_1d(np.asarray(t, dtype=np.float64)), 0.0, self.duration)
        return self.found.motion.at(times)

    def reference(
        self,
        gain: float = 2.0,
        length: float = 0.4,
        pace: float = 0.8,
        tube: Goal | None = None,
        priority: int = 1,
        replan: Callable[[Plan, Array], Plan] | None = None,
    ) -> Task:
        """A task that follows the plan, a row an input: its rates, and feedback from where it leads.

        Limits, distances and priorities hold for it as for any task. Below other tasks it keeps the robot
        near the plan's posture with the inputs that they leave. Where the controller keeps distances, the
        plan should keep 0.05 m more: near an obstacle a controller goes slower than a plan. Limits cut each
        input by itself: one that is held, as a car's steering at its stop, does not hold the others. A pair
        that begins near may be as near as the first plan has it. A run that does not end within 5 mm and
        0.02 rad of the plan's end is missed. To step aside from what moves is for `Horizon`.

        Parameters
        ----------
        gain : on what each input moved too far, 1/s
        length : the way along which a platform that is beside its own comes back, about, m
        pace : share of the plan's speed; below 1 feedback has room where the plan is at its limits. It takes
            plan.duration / pace
        tube : how far from the plan is worth a warning; `Goal(m=0.1, rad=0.2)` when not given
        replan : another plan where a run of `simulate` or `rollout` is outside the tube, from this one and q
            (n,): `nmm.replan`, or a function with its own obstacles. The run goes on with it, and makes
            another at most once a second

        Examples
        --------
        >>> robot = nmm.load("unicycle_2r")
        >>> plan = nmm.plan(robot, robot.rest, {"x": 2.0, "y": 1.0, "theta": 0.0})
        >>> controller = nmm.Controller(robot, plan.reference(), nmm.ProjectedGradient())
        >>> run = nmm.simulate(controller, {"y": 0.05, "theta": 0.1}, plan.duration / 0.8 + 2.0, 0.02)
        >>> bool(np.abs(run.q[-1] - plan.end).max() < 0.001)
        True
        """
        scene, tube = self.found.scene, Goal(m=0.1, rad=0.2) if tube is None else tube
        if scene is not None and pace != 1.0 and any(obstacle.moves for obstacle in scene.obstacles):
            raise InputError(
                "obstacles that move do not wait", where="plan: pace", expected="pace=1", got=pace
            )
        function = self._followed(positive(gain, "gain"), positive(length, "length"), pace, tube, replan)
        return Task(function, np.zeros(self.robot.n_u), gain, priority, name="plan")

    def _followed(
        self,
        gain: float,
        length: float,
        pace: float,
        tube: Goal,
        replan: Callable[[Plan, Array], Plan] | None,
    ) -> FromPlan:
        motion, share = self.found.motion, positive(pace, "pace")

        def at(t: Array) -> tuple[Array, Array]:
            q, u = motion.at(share * t)
            return q, share * u

        def anew(q: Array) -> FromPlan:
            other = self if replan is None else replan(self, q)
            return other._followed(gain, length, pace, tube, replan)

        arguments = self.robot, at, self.stops / share, gain, length, tube
        return FromPlan(*arguments, None if replan is None else anew, self.found.nearer)

    def trajectory(self, dt: float = 0.02) -> Trajectory:
        """The motion sampled every dt, s, and at its end, as a run: it plays, saves and compares. Its task is
        the goal's or, of a goal of coordinates, that these are where it ends."""
        times = np.arange(0.0, self.duration - 1e-9, positive(dt, "dt"))
        t = np.append(times, self.duration)
        task = goal_task(self.robot, self.found.goal, self.end)
        (q, u), objective = self(t), self.found.asked.objective
        H = None if objective is None else SampleCosts(self.robot, objective).at(q)[0]
        constraints = self.found.limits, self.found.scene
        with self.found.prepared.lock:  # a Planner's plans share their scene
            return recorded(self.robot, t, q, u, dt, task, *constraints, "plan", H=H)
