"""Plans to the target of a robot that is driven: it stands while one is made, follows it, and stands again
when the target has moved."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeVar

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import NmmError, RunError
from nmm.control.controller import Controller
from nmm.control.functions.references import Constant
from nmm.control.functions.references.live_target import LiveTarget
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal
from nmm.control.resolvers import CallableResolver, ProjectedGradient
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.motion import Motion
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.setups import led_by
from nmm.plugins.planning.plan import Plan
from nmm.plugins.planning.planner import plan
from nmm.views.playback.drawing import Command, packed
from nmm.views.playback.keyframes import ghost_samples
from nmm.views.playback.shapes import DrawnRobot

#: How long a plan is looked for, s, and how much more than the controller it keeps, m.
SECONDS, MARGIN = 5.0, 0.05
#: A target stands that has not moved for so long, s; a robot whose inputs are below this, m/s and rad/s.
SETTLED, STILL = 0.3, 1e-3
#: What is drawn: points of its paths, and copies of the robot along it.
POINTS, GHOSTS = 150, 5
#: Farther than this from its plan, the robot gets another.
FARTHEST = Goal(m=0.1, rad=0.2)
#: A task that asks for nothing.
NOTHING = Task(Constant([0.0]), [0.0], gain=None)
COLOR = (0.85, 0.45, 0.0)

#: The command that draws no plan.
NO_PLAN: Command = {"type": "plan", "lines": [], "tree": None, "ghosts": None}

T = TypeVar("T")


def later(work: Callable[[], T]) -> Future[T]:
    """The result of work that another thread does, which ends with the process."""
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:  # who asks for the result gets it, also where a program ended itself
            future.set_exception(error if isinstance(error, Exception) else RunError(why(error)))

    threading.Thread(target=run, daemon=True).start()
    return future


def why(error: BaseException) -> str:
    """An `NmmError` says what is wrong; a user's function may raise anything."""
    return str(error) if isinstance(error, NmmError) else f"{type(error).__name__}: {error}"


class PendingPlan(NamedTuple):
    """A plan to a target at `value`, what follows it, and its reference, with `apart` and `duration`."""

    plan: Plan
    controller: Controller
    reference: Any
    value: Array


class Planning:
    """Whether and how a robot is led by plans to the target of a task, the one aimed at last.

    Attributes
    ----------
    on : whether it is
    number : of plans shown so far; it changes when another one, or none, is to be shown
    """

    def __init__(self, driven: Driven) -> None:
        self.on, self.number = False, 0
        self._driven, self._task = driven, 0
        self._value, self._since = np.zeros(0), 0.0
        self._making: Future[PendingPlan] | None = None
        self._began, self._refused = 0.0, ""
        self._followed: PendingPlan | None = None
        self._stands: Controller | None = None

    def turn(self, on: bool) -> None:
        """Begin or end to be led by plans."""
        self.on = on
        self.begin_again()
        if not on:
            self._driven.lead(None)

    def begin_again(self) -> None:
        """The robot has another controller, or is elsewhere: its plan does not hold any more."""
        self._value, self._making = np.zeros(0), None
        self._leave()

    def aims(self, task: int) -> None:
        """A target was moved: it is the one to plan to. There are no plans to things."""
        if task < len(self._driven.targets):
            self._task = task

    def attend(self) -> None:
        """Take a plan that is made, have one made, or stand: once a picture."""
        if not self.on:
            return
        value, driven = self._driven.targets[self._task].signal.value, self._driven
        if not np.array_equal(value, self._value):
            self._value, self._since, self._refused = value, time.monotonic(), ""
            self._leave()
        if self._making is not None and self._making.done():
            making, self._making = self._making, None
            try:
                made = making.result()
                if np.array_equal(made.value, value):
                    self._followed = made
                    self.number += 1
                    driven.lead(made.controller)
            except Exception as error:
                self._refused = why(error).removeprefix("plan: ")
        if self._followed is not None:
            apart = self._followed.reference.apart([driven.elapsed], [driven.q])[0]
            if np.all(apart <= [FARTHEST.m, FARTHEST.rad]):
                return
            self._leave()
        if self._stands is None:
            self._stands = led_by(
                driven.reacting, NOTHING, CallableResolver(lambda problem: np.zeros(driven.robot.n_u))
            )
            driven.lead(self._stands)
        ready = time.monotonic() > self._since + SETTLED and np.abs(driven.u).max() < STILL
        if ready and self._making is None and not self._refused:
            self._began = time.monotonic()
            arguments = driven.reacting, driven.q.copy(), self._task, LiveTarget(value), driven.setup.dt
            self._making = later(lambda: made_for(*arguments))

    def _leave(self) -> None:
        self.number += self._followed is not None
        self._followed = self._stands = None

    def words(self) -> tuple[str, bool]:
        """What a page says of it, and whether that is something wrong."""
        if self._refused:
            return f"No plan: {self._refused}", True
        if self._making is not None:
            since = time.monotonic() - self._began
            first = " (the first one on a machine is compiled before)" if since > 2.0 * SECONDS else ""
            return f"A plan is made, since {since:.0f} s{first}", False
        if self._followed is None:
            return "It stops, to plan from where it is", False
        left = self._followed.reference.duration - self._driven.elapsed
        return f"It follows its plan, {left:.1f} s to go" if left > 0.0 else "It is at its plan's end", False

    def shown(self, drawn: DrawnRobot, wheels: Array) -> Command:
        """The command that draws the plan: the ways of the task's frame and of the platform, the trees that
        were grown, of the platform or else of the frame, and copies."""
        lines: list[Any] = []
        command: Command = NO_PLAN | {"lines": lines}
        if self._followed is None:
            return command
        plan, frame = self._followed.plan, self._driven.targets[self._task].frame
        robot, t = plan.robot, np.linspace(0.0, plan.duration, POINTS if plan.duration > 0.0 else 1)
        q, u = plan(t)
        motion = Motion(robot, t, q, u, frame=frame)
        floor = on_floor(q) if robot.platform.n_p else None
        grown = plan.tree.reshape(-1, robot.n)
        if floor is not None:
            command["tree"] = packed(on_floor(grown), np.float32)
        elif frame is not None:
            command["tree"] = packed(FramePath(robot, frame).positions(grown), np.float32)
        for points in (motion.driven, floor):
            if points is not None:
                lines.append(
                    {"color": COLOR, "points": packed(points, np.float32), "times": None, "thick": 0.8}
                )
        some = ghost_samples(motion, GHOSTS)[1:]
        if some:
            command["ghosts"] = drawn.ghosts("/nmm/plan/ghosts", q[some], np.tile(wheels, (len(some), 1)), [])
        return command


def on_floor(q: Array) -> Array:
    """Where the platform is at q (N, n), (N, 3), m, a little above the ground."""
    return np.column_stack([q[:, :2], np.full(len(q), 0.005)])


def made_for(controller: Controller, q: Array, number: int, target: LiveTarget, dt: float) -> PendingPlan:
    """A plan from q to a target of a controller's task, with its limits and distances, and its follower."""
    arguments, task = controller.given, controller.given.task.tasks[number]
    constraints: dict[str, Any] = {
        "collisions": arguments.collisions,
        "limits": arguments.limits,
        "margin": MARGIN,
    }
    planned = plan(arguments.robot, q, Task(task.function, target), seconds=SECONDS, **constraints)
    reference = planned.reference(tube=FARTHEST)
    made = led_by(controller, reference, ProjectedGradient())
    made.step(0.0, q, dt)  # the first call compiles
    made.reset()
    return PendingPlan(planned, made, reference.function, target.value)
