"""A robot that follows targets with a controller that may change at any time, and why it misses them."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import NmmError, expect
from nmm.control.controller import Controller
from nmm.control.functions.program import evaluate
from nmm.control.step.step import Step
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import CENTER_OF_MASS
from nmm.motion.diagnosis.reasons import out_of_reach, stretched
from nmm.plugins.live.driving.setups import Choice, DriveSetup, Settings, aimed, named, targets_of
from nmm.plugins.live.driving.things import Thing, Things
from nmm.views.playback.rolling import RolledRobot

#: A robot farther away than this, m, has diverged.
LOST = 1e4
#: An error is stuck if it falls by less than both of these, m or rad and a share of itself, in this time, s.
LONG, FALL, SHARE = 1.0, 1e-3, 0.01
#: A smaller error is near enough, m or rad.
NEAR = 5e-3


@dataclass(frozen=True, eq=False)
class DrivenState:
    """The robot at t, s since the beginning: the controller's step (error and r_d of all tasks, NaN while one
    is inactive), σ_min of J, the frames of the tasks and things (targets, 3), m in the world, NaN for those
    without one, and what keeps it from its targets ("" if nothing does)."""

    t: float
    step: Step
    sigma_min: float
    at: Array
    against: str


class TargetProgress:
    def __init__(self) -> None:
        self._target = np.zeros(0)
        self._norms: deque[tuple[float, float]] = deque()

    def words(self, controller: Controller, t: float, step: Step, target: Array) -> str:
        """Why the robot, at t, s, does not get to the tasks' target (s,): its arm is too short, or the error
        stands; "" where nothing is known. An earlier t than before is a new beginning."""
        norm = float(np.linalg.norm(step.error))
        if not np.array_equal(target, self._target) or (self._norms and t < self._norms[-1][0]):
            self._target, self._norms = target, deque()
        if not self._norms or t > self._norms[-1][0]:  # it may be paused
            self._norms.append((t, norm))
        while len(self._norms) > 1 and self._norms[1][0] <= t - LONG:
            self._norms.popleft()
        far = out_of_reach(controller, step.q, target)
        if far is not None:
            return str(far)
        before, at_first = self._norms[0]
        if t - before < LONG or norm < NEAR or at_first - norm >= max(FALL, SHARE * norm):
            return ""
        stands = f"the error does not fall: ‖e‖ stays at {norm:.3g}"
        if step.scale.min(initial=1.0) < 1.0:
            constraints = "limits and distances" if controller.solver.scene is not None else "limits"
            return f"{stands}; {constraints} leave {float(step.scale.min()):.2g} of the task's rate"
        seen = stretched(controller, step.q, step.J) if np.all(np.isfinite(step.J)) else None
        return stands if seen is None else f"{stands}; {seen}"


class PendingController(NamedTuple):
    settings: Settings
    controller: Controller
    choices: list[Choice]


class Driven:
    """The robot, its time t, s, and its controller; used by one thread.

    Attributes
    ----------
    shown : the robot at the last look, with its wheels
    targets, things : what can be dragged: the tasks' targets, and what cameras see
    reacting : the controller that follows the targets
    elapsed : the time of the controller that leads it, s, where that is another (`lead`)
    u (m,) : the last inputs
    choices : what may be changed, with the present values
    trouble : why it stands still, "" while it moves
    """

    def __init__(self, setup: DriveSetup) -> None:
        self.setup = setup
        self.robot = setup.robot
        self._settings: Settings = {}
        first = setup.controller({})
        self.targets = targets_of(first, setup.q0, at_robot=setup.at_robot)
        self._began = [target.signal.value for target in self.targets]
        self._things = Things(first)
        self.reacting = self._led = self._aimed(first)
        self._reaching = TargetProgress()
        self.choices = setup.choices({})
        self.trouble = ""
        self.shown = RolledRobot(self.robot, setup.q0)
        self._stand()

    def _aimed(self, controller: Controller) -> Controller:
        return self._things.seen_by(aimed(controller, self.targets))

    @property
    def things(self) -> list[Thing]:
        return self._things.all

    @property
    def places(self) -> list[list[float]]:
        """Where the targets are, and then the things."""
        values = [target.signal.value for target in self.targets]
        return [place.tolist() for place in (*values, *(thing.middle(self.t) for thing in self.things))]

    @property
    def has_objective(self) -> bool:
        return self.reacting.given.objective is not None

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        collisions = self.reacting.given.collisions
        return () if collisions is None else tuple(collisions.obstacles)

    def _stand(self) -> None:
        self.t, self.q = 0.0, self.setup.q0.copy()
        self.shown.stand(self.q)
        self.reacting.reset()
        self._led, self._since, self.u = self.reacting, 0.0, np.zeros(self.robot.n_u)
        disturbances = self.setup.disturbances
        self._plant = None if disturbances is None else disturbances.plant(self.robot, self.setup.dt)
        self.trouble = ""

    @property
    def elapsed(self) -> float:
        return self.t - self._since

    def lead(self, controller: Controller | None) -> None:
        """Go on with a controller whose time begins now, or with the one that follows targets, from the
        present inputs."""
        before = self._led.solver.before.copy()
        self._led, self._since = (self.reacting, 0.0) if controller is None else (controller, self.t)
        self._led.solver.before[:] = before
        self.trouble = ""

    def restart(self) -> None:
        """Return to the beginning, targets too; what was chosen stays."""
        for target, value in zip(self.targets, self._began, strict=True):
            target.signal.set(value)
        for thing in self.things:
            thing.away.set(np.zeros(3))
        self._stand()

    def aim(self, task: int, value: Array) -> None:
        """Aim a task at `value` (s,), or drag a thing there, which are counted after the tasks; ends a
        standstill. `InputError` for no such task or length."""
        most = len(self.targets) + len(self.things)
        expect(task < most, "task", f"a number below {most}", task)
        if task < len(self.targets):
            self.targets[task].signal.set(value)
        else:
            self.things[task - len(self.targets)].drag(value, self.t)
        self.trouble = ""

    @property
    def seen(self) -> Array:
        """q (n,) as the controller sees it: by odometry, say."""
        return self.q if self._plant is None else self._plant.see(self.q)

    def targets_here(self, numbers: Iterable[int]) -> None:
        """Put the targets of these tasks where they are now, as the controller sees it."""
        configuration = Configuration(self.robot, self.seen)
        for number in numbers:
            function = self.reacting.given.task.tasks[number].function
            self.targets[number].signal.set(evaluate(function, 0.0, configuration).value)

    def aim_here(self) -> None:
        """Aim each task at the value that it has now."""
        self.targets_here(range(len(self.targets)))
        self.trouble = ""

    def with_choice(self, key: str, value: object) -> PendingController:
        """A controller with that choice, for `use`; made apart, as it may take longer than a step. `NmmError`
        for an unknown choice or value, or ones that do not go together."""
        settings = {**self._settings, key: named(self.choices, key).checked(value)}
        controller = self._aimed(self.setup.controller(settings))
        return PendingController(settings, controller, self.setup.choices(settings))

    def use(self, made: PendingController) -> None:
        """Go on with another controller, from this one's inputs."""
        self._settings, self.reacting, self.choices = made
        self.lead(None)

    def step(self) -> bool:
        """One step of the controller's dt; whether it moved. An error becomes `trouble`."""
        if self.trouble:
            return False
        try:
            held = self._plant is not None or (self._led.order == 2 and self._led.limits is not None)
            arguments = self.elapsed, self.q, self.setup.dt, "zoh" if held else "rk4"
            q_next, self.u = self._led.step(*arguments, plant=self._plant)
        except NmmError as error:
            self.trouble = str(error)
            return False
        if not np.all(np.isfinite(q_next)) or np.abs(q_next[: min(2, len(q_next))]).max(initial=0.0) > LOST:
            self.trouble = f"diverged at t = {self.t:g} s: try smaller gains, or begin again"
            return False
        self.t, self.q = self.t + self.setup.dt, q_next
        return True

    def _active(self) -> tuple[bool, ...]:
        """Whether each of the tasks is active."""
        schedule = self.reacting.schedule
        return (True,) * len(self.targets) if schedule is None else schedule.moment.active

    def look(self) -> DrivenState:
        """The present place and what the controller finds there; wheels have rolled since the last look."""
        self.shown.roll(self.q[np.newaxis])
        step = self.reacting.evaluate(self.t, self.q)
        configuration = Configuration(self.robot, self.q)
        at = np.full((len(self.targets) + len(self.things), 3), np.nan)
        for i, target in enumerate(self.targets):
            if target.frame is not None:
                on_robot = target.frame != CENTER_OF_MASS
                at[i] = (
                    configuration.placement(target.frame).translation
                    if on_robot
                    else configuration.center_of_mass()[0]
                )
        known = bool(np.all(np.isfinite(step.J)))
        sigma = np.linalg.svd(step.J, compute_uv=False).min(initial=math.inf) if known else math.nan
        against, on = "", self._active()
        if self._led is self.reacting and any(on):
            shown = zip(self.targets, on, strict=True)
            wanted = np.concatenate([target.signal.value for target, active in shown if active])
            against = self._reaching.words(self.reacting, self.t, step, wanted)
        if self._led is not self.reacting:
            led = self._led.evaluate(self.elapsed, self.q)
            step = replace(step, u=led.u, q_dot=led.q_dot, scale=led.scale)
        rows = np.repeat(on, [len(target.rows) for target in self.targets])
        every = np.full((2, len(rows)), np.nan)
        every[:, rows] = step.error[: rows.sum()], step.r_d[: rows.sum()]
        step = replace(step, error=every[0], r_d=every[1])
        return DrivenState(self.t, step, float(sigma), at, against)
