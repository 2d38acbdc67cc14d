"""Controllers for what a driver chose: of a scenario, or of a robot with tasks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.limits import Limits
from nmm.driving.choices import Choice, number
from nmm.driving.targets import title_of
from nmm.errors import InputError, NmmError
from nmm.functions.function import Function
from nmm.functions.tasks.task import Stack, Task
from nmm.kinds import RESOLVERS
from nmm.resolvers.base import Resolver
from nmm.robots.robot import Robot
from nmm.scenario import Scenario
from nmm.scenario.resolvers import RESOLVER_PARTS

#: The headings of the page's controls.
RESOLVER, GAINS, WEIGHTS = "Resolver", "Gains", "Weights of the inputs"

Settings = Mapping[str, str | bool | float]


class DriveSetup(ABC):
    """What is driven.

    Attributes
    ----------
    name : the scenario's or the robot's
    robot : the robot
    q0 : (n,) where it begins, m and rad
    dt : the controller's, s
    at_robot : whether targets begin where the robot is, not where references are

    Examples
    --------
    >>> setup = nmm.driving.ScenarioSetup(nmm.Scenario.load("unicycle_2r_position"))
    >>> isinstance(setup, nmm.driving.DriveSetup), setup.robot.name, setup.q0.shape
    (True, 'unicycle_2r', (5,))
    """

    name: str
    robot: Robot
    q0: Array
    dt: float
    at_robot: bool

    @abstractmethod
    def controller(self, settings: Settings) -> Controller:
        """A controller with these settings; `NmmError` where they do not go together."""

    @abstractmethod
    def choices(self, settings: Settings) -> list[Choice]:
        """What may be chosen next, with the present values."""


class ScenarioSetup(DriveSetup):
    """A scenario whose references are left aside, but for where they begin.

    Parameters
    ----------
    q0 : (n,) where it begins, m and rad; the scenario's start when not given

    Raises
    ------
    InputError : tasks that come and go

    Examples
    --------
    >>> setup = nmm.driving.ScenarioSetup(nmm.Scenario.load("unicycle_2r_position"))
    >>> setup.name, setup.at_robot
    ('Position task for the planar robot (paper, section VI, case 1)', False)
    """

    at_robot = False

    def __init__(self, scenario: Scenario, q0: ArrayLike | None = None) -> None:
        self.scenario = scenario
        self.name = scenario.title or scenario.name
        self.robot = scenario.robot()
        self.q0, self.dt = self.robot.q(scenario.parts.q0 if q0 is None else q0), scenario.parts.dt
        for part in scenario.parts.task:
            if part.when:
                raise InputError(
                    f"{scenario.name}: has tasks that come and go (when), which nobody can drive; expected a "
                    "scenario whose tasks are always there"
                )

    def controller(self, settings: Settings) -> Controller:
        controller = self._with(settings).controller()
        controller.dt = self.dt
        return controller

    def choices(self, settings: Settings) -> list[Choice]:
        parts = self._with(settings).parts
        kind = parts.resolver.kind
        # Which of them the scenario can do with shows when one is chosen: to try takes as long as to load.
        found = [Choice("resolver.kind", "method", RESOLVER, kind, tuple(RESOLVERS))]
        resolver = parts.resolver.model_dump()
        alpha = resolver.get("alpha")
        if isinstance(alpha, float | int) and not isinstance(alpha, bool) and alpha > 0.0:
            first = self._first("resolver.alpha", float(alpha))
            found.append(_now(number("resolver.alpha", "step α along −∇H", RESOLVER, first), alpha))
        found.append(Choice("limits", "keep the limits", RESOLVER, parts.limits is not None))
        for i, task in enumerate(parts.task):
            gain = task.model_dump().get("gain")
            if isinstance(gain, float | int) and not isinstance(gain, bool):
                key, words = f"task.{i}.gain", f"K of {self._task_names[i]}"
                found.append(_now(number(key, words, GAINS, self._first(key, float(gain)), "1/s"), gain))
        if "weights" in resolver:
            found += self._weights(resolver["weights"])
        return found

    def _weights(self, given: Any) -> list[Choice]:
        if given is not None and not isinstance(given, Mapping):
            return []
        now = given or {}
        if not set(now) <= set(self.robot.u_names):
            return []  # of groups: not one number an input
        found = []
        for name in self.robot.u_names:
            value = now.get(name, 1.0)
            key = f"resolver.weights.{name}"
            found.append(_now(number(key, name, WEIGHTS, self._first(key, float(value))), float(value)))
        return found

    def _first(self, key: str, value: float) -> float:
        """A number's value when it was first asked for: a slider's ends stay where they are."""
        return self._firsts.setdefault(key, value)

    @cached_property
    def _firsts(self) -> dict[str, float]:
        return {}

    @cached_property
    def _task_names(self) -> list[str]:
        return [title_of(task, self.robot) for task in self.scenario.controller().task]

    def _with(self, settings: Settings) -> Scenario:
        kind = str(settings.get("resolver.kind", self.scenario.parts.resolver.kind))
        known = RESOLVER_PARTS[kind].model_fields
        chosen: dict[str, object] = {"resolver.kind": kind}
        weights: dict[str, object] = {}
        for key, value in settings.items():
            room, _, rest = key.partition(".")
            if key == "resolver.kind" or (room == "resolver" and rest.partition(".")[0] not in known):
                continue
            if key.startswith("resolver.weights."):
                weights[rest.partition(".")[2]] = value
            elif key == "limits":
                if value != (self.scenario.parts.limits is not None):
                    chosen[key] = value
            else:
                chosen[key] = value
        if weights:
            given = self.scenario.parts.resolver.model_dump().get("weights") or {}
            chosen["resolver.weights"] = {**given, **weights}
        return self.scenario.with_settings(chosen)


class RobotSetup(DriveSetup):
    """A robot with tasks, at rest where it is; damped least squares at first, which stands singularities.

    Parameters
    ----------
    tasks : with or without references, which are left aside

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> setup = nmm.driving.RobotSetup(robot, [nmm.Position("ee")], robot.q({"q2": 0.8, "q3": 0.5}))
    >>> setup.controller({}).resolver.name
    'dls'
    """

    at_robot = True
    dt = 0.005

    def __init__(self, robot: Robot, tasks: Sequence[Task | Function], q0: Array) -> None:
        self.robot, self.q0, self.name = robot, q0, robot.name
        self._tasks = [task if isinstance(task, Task) else _held(task, robot) for task in tasks]

    def controller(self, settings: Settings) -> Controller:
        tasks = [
            Task(task.function, task.reference, float(settings.get(f"task.{i}.gain", 2.0)), task.priority)
            for i, task in enumerate(self._tasks)
        ]
        resolver: type[Resolver] = RESOLVERS[str(settings.get("resolver.kind", "dls"))]
        limits = Limits() if settings.get("limits", True) else None
        return Controller(self.robot, tasks, resolver(), limits=limits, dt=self.dt)

    def choices(self, settings: Settings) -> list[Choice]:
        kind = str(settings.get("resolver.kind", "dls"))
        found = [Choice("resolver.kind", "method", RESOLVER, kind, self._kinds)]
        found.append(Choice("limits", "keep the limits", RESOLVER, bool(settings.get("limits", True))))
        for i, task in enumerate(Stack(tuple(self._tasks))):
            key = f"task.{i}.gain"
            gain = number(key, f"K of {title_of(task, self.robot)}", GAINS, 2.0, "1/s")
            found.append(_now(gain, float(settings.get(key, 2.0))))
        return found

    @cached_property
    def _kinds(self) -> tuple[str, ...]:
        return tuple(kind for kind in RESOLVERS if self._does(kind))

    def _does(self, kind: str) -> bool:
        try:
            self.controller({"resolver.kind": kind})
        except (NmmError, TypeError):
            return False
        return True


def _held(function: Function, robot: Robot) -> Task:
    return Task(function, np.zeros(len(function.rows(robot))))


def _now(choice: Choice, value: float) -> Choice:
    """The choice with its present value, which a scenario's file may have anywhere."""
    value = float(value)
    return Choice(
        choice.key, choice.text, choice.group, value, (),
        min(choice.least, value), max(choice.most, value), choice.unit,
    )  # fmt: skip
