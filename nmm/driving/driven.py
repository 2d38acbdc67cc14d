"""A robot that follows targets which somebody moves, under a controller that somebody changes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array
from nmm.collisions.obstacle import Obstacle
from nmm.control.controller import Controller
from nmm.control.step import Step
from nmm.driving.choices import Choice, named
from nmm.driving.reaching import Reaching
from nmm.driving.setups import DriveSetup, Settings
from nmm.driving.targets import aimed, targets_of
from nmm.errors import InputError, NmmError
from nmm.playback.rolling import Rolling
from nmm.robots.configuration import Configuration
from nmm.robots.robot import CENTER_OF_MASS

#: Where a robot goes that is farther away than this, m, its loop has diverged.
LOST = 1e4


@dataclass(frozen=True, eq=False)
class Look:
    """The robot at an instant.

    Attributes
    ----------
    t : s since the beginning
    step : all that the controller found
    sigma_min : smallest singular value of J
    at : (targets, 3) where in the world the tasks' frames are, m; not numbers for tasks without one
    against : why it does not get to its targets; "" where nothing is known
    """

    t: float
    step: Step
    sigma_min: float
    at: Array
    against: str


class Driven:
    """The robot, its time and its controller. One thread moves it.

    Parameters
    ----------
    setup : what is driven

    Attributes
    ----------
    t, q, wheels : s; (n,); the wheels' angles (W,), rad
    targets : one of each task
    choices : what may be changed, with the present values
    trouble : why it stands still; "" while it moves
    """

    def __init__(self, setup: DriveSetup) -> None:
        self.setup = setup
        self.robot = setup.robot
        self._rolling = Rolling(self.robot)
        self._settings: Settings = {}
        first = setup.controller({})
        self.targets = targets_of(first, setup.q0, at_robot=setup.at_robot)
        self._began = [target.signal.value for target in self.targets]
        self._controller = aimed(first, self.targets)
        self._reaching = Reaching()
        self.choices = setup.choices({})
        self.trouble = ""
        self._stand()

    @property
    def has_objective(self) -> bool:
        """Whether there is an H."""
        return self._controller.objective is not None

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What it keeps off, besides itself."""
        collisions = self._controller.collisions
        return () if collisions is None else tuple(collisions.obstacles)

    def _stand(self) -> None:
        self.t, self.q = 0.0, self.setup.q0.copy()
        self._seen, self.wheels = self.q, self._rolling.settled(self.q)
        self._controller.reset()
        self.trouble = ""

    def restart(self) -> None:
        """Back to the beginning, targets, too; what was chosen stays."""
        for target, value in zip(self.targets, self._began, strict=True):
            target.signal.set(value)
        self._stand()

    def aim(self, task: int, value: Array) -> None:
        """Put a task's target at `value` (s,); one that stood still tries again.

        Raises
        ------
        InputError : no such task, another number of numbers
        """
        if task >= len(self.targets):
            raise InputError(f"task: expected a number below {len(self.targets)}, got {task}")
        self.targets[task].signal.set(value)
        self.trouble = ""

    def with_choice(self, key: str, value: object) -> tuple[Settings, Controller, list[Choice]]:
        """What `use` takes for a choice: made apart, because it may take longer than a step.

        Raises
        ------
        InputError, NmmError : no such choice or value; what does not go together
        """
        chosen = named(self.choices, key).checked(value)
        settings = {**self._settings, key: chosen}
        controller = aimed(self.setup.controller(settings), self.targets)
        return settings, controller, self.setup.choices(settings)

    def use(self, made: tuple[Settings, Controller, list[Choice]]) -> None:
        """Go on with another controller, from the inputs of this one."""
        before = self._controller.before.copy()
        self._settings, self._controller, self.choices = made
        self._controller.before[:] = before
        self.trouble = ""

    def step(self) -> bool:
        """One step of the controller's dt; whether it moved. What goes wrong is `trouble`."""
        if self.trouble:
            return False
        try:
            ahead, _ = self._controller.step(self.t, self.q, self.setup.dt)
        except NmmError as error:
            self.trouble = str(error)
            return False
        if not np.all(np.isfinite(ahead)) or np.abs(ahead[: min(2, len(ahead))]).max(initial=0.0) > LOST:
            self.trouble = f"diverged at t = {self.t:g} s: try smaller gains, or begin again"
            return False
        self.t, self.q = self.t + self.setup.dt, ahead
        return True

    def look(self) -> Look:
        """Where it is and what its controller finds there; its wheels have rolled since the last look."""
        self.wheels = self._rolling.angles(np.array([self._seen, self.q]), start=self.wheels)[-1]
        self._seen = self.q
        step = self._controller.evaluate(self.t, self.q)
        here = Configuration(self.robot, self.q)
        at = np.full((len(self.targets), 3), np.nan)
        for i, target in enumerate(self.targets):
            if target.frame is not None:
                on_robot = target.frame != CENTER_OF_MASS
                at[i] = here.placement(target.frame).translation if on_robot else here.center_of_mass()[0]
        known = bool(np.all(np.isfinite(step.J)))
        sigma = np.linalg.svd(step.J, compute_uv=False).min(initial=math.inf) if known else math.nan
        wanted = np.concatenate([target.signal.value for target in self.targets])
        against = self._reaching.words(self._controller, self.t, step, wanted)
        return Look(self.t, step, float(sigma), at, against)
