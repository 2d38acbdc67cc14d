"""What a page may change while the robot moves, and controllers for it, of a scenario or a robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.base.errors import InputError, NmmError, expect, expect_kind, expect_known
from nmm.base.kinds import RESOLVERS
from nmm.control.controller import Controller
from nmm.control.functions.function import Function
from nmm.control.functions.program import evaluate
from nmm.control.functions.references.live_target import LiveTarget
from nmm.control.functions.tasks.task import Stack, Task
from nmm.control.limits.limits import Limits
from nmm.control.resolvers.base import Resolver
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Surroundings
from nmm.motion.disturbances import Disturbances
from nmm.scenario import Scenario
from nmm.scenario.resolvers import RESOLVER_PARTS

RESOLVER, GAINS, WEIGHTS = "Resolver", "Gains", "Weights of the inputs"

Settings = Mapping[str, str | bool | float]


@dataclass(frozen=True)
class Choice:
    """One control of the page.

    Attributes
    ----------
    key : of the scenario, as `--set` takes it
    text : what people call it
    group : under which heading it stands
    value : the present one: a word of `options`, True or False, or a number from `least` to `most`
    unit : of a number

    Examples
    --------
    >>> choice = nmm.driving.Choice("task.gain", "gain", "task", 2.0, least=0.0, most=10.0, unit="1/s")
    >>> choice.checked(3)
    3.0
    """

    key: str
    text: str
    group: str
    value: str | bool | float
    options: tuple[str, ...] = ()
    least: float = 0.0
    most: float = 0.0
    unit: str = ""

    def checked(self, value: object) -> str | bool | float:
        """The value, of this choice's kind; `InputError` for another kind, or one out of range."""
        if isinstance(self.value, bool):
            expect_kind(value, bool, self.key, "true or false")
            return bool(value)
        if isinstance(self.value, str):
            expect_known(self.key, str(value)[:40], self.options, "drive")
            return str(value)
        if not _is_number(value):
            raise InputError(where=self.key, expected="a number", got=value)
        expect(self.least <= value <= self.most, self.key, f"a number from {self.least:g} to {self.most:g}")
        return float(value)


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def number(key: str, text: str, group: str, first: float, value: float, unit: str = "") -> Choice:
    """A number above zero: two decades about its first value, extended to the present one."""
    least, most = min(first / 20.0, value), max(first * 20.0, value)
    return Choice(key, text, group, float(value), (), least, most, unit)


def named(choices: Sequence[Choice], key: str) -> Choice:
    """The choice with that key, or `InputError`."""
    known = {choice.key: choice for choice in choices}
    expect_known("choice", key[:80], known, "drive")
    return known[key]


class DriveSetup(ABC):
    """What is driven: a robot from q0 (n,), m and rad, in steps of dt, s.

    Attributes
    ----------
    name : the scenario's or the robot's
    at_robot : whether targets begin where the robot is, not where references are
    surroundings : what the robot carries, and scenery
    disturbances : what it does otherwise than it is told

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
    surroundings: Surroundings = NO_SURROUNDINGS
    disturbances: Disturbances | None = None

    @abstractmethod
    def controller(self, settings: Settings) -> Controller:
        """A controller with these settings; `NmmError` where they do not go together."""

    @abstractmethod
    def choices(self, settings: Settings) -> list[Choice]:
        """What may be chosen next, with the present values."""


class ScenarioSetup(DriveSetup):
    """A scenario whose references are left aside, but for where they begin; a retreat can be chosen.

    Parameters
    ----------
    q0 : (n,) where it begins, m and rad; the scenario's start when not given

    Examples
    --------
    >>> setup = nmm.driving.ScenarioSetup(nmm.Scenario.load("unicycle_2r_position"))
    >>> setup.name, setup.at_robot
    ('Position task for the planar robot (paper, section VI, case 1)', False)
    """

    at_robot = False

    def __init__(self, scenario: Scenario, q0: ArrayLike | None = None) -> None:
        self.scenario = (
            scenario if scenario.parts.section("plan") is None else scenario.override("plan", False)
        )
        self._firsts: dict[str, float] = {}
        self.name = scenario.title or scenario.name
        self.robot = scenario.robot()
        self.surroundings = scenario.surroundings(self.robot)
        self.q0, self.dt = self.robot.q(scenario.parts.q0 if q0 is None else q0), scenario.parts.dt
        if scenario.parts.disturbances is not None:
            self.disturbances = scenario.parts.disturbances.make()

    def controller(self, settings: Settings) -> Controller:
        controller = self._with(settings).controller()
        controller.dt = self.dt
        return controller

    def choices(self, settings: Settings) -> list[Choice]:
        parts = self._with(settings).parts
        kind = parts.resolver.kind
        # Whether the scenario works with a resolver shows when it is chosen: trying takes as long as loading.
        choices = [Choice("resolver.kind", "method", RESOLVER, kind, tuple(RESOLVERS))]
        resolver = parts.resolver.model_dump()
        alpha = resolver.get("alpha")
        if _is_number(alpha) and alpha > 0.0:
            choices.append(self._number("resolver.alpha", "step α along −∇H", RESOLVER, alpha))
        choices.append(Choice("limits", "keep the limits", RESOLVER, parts.limits is not None))
        if self.scenario.parts.retreat is not None:
            chosen = parts.retreat is not None
            choices.append(Choice("retreat", "back off where the error stalls", RESOLVER, chosen))
        for i, task in enumerate(parts.task):
            gain = task.model_dump().get("gain")
            if _is_number(gain):
                text = f"K of {self._task_names[i]}"
                choices.append(self._number(f"task.{i}.gain", text, GAINS, gain, "1/s"))
        weights = resolver.get("weights") or {}
        # Weights of groups are not one number per input.
        if "weights" in resolver and isinstance(weights, Mapping) and set(weights) <= set(self.robot.u_names):
            for name in self.robot.u_names:
                choices.append(
                    self._number(f"resolver.weights.{name}", name, WEIGHTS, weights.get(name, 1.0))
                )
        return choices

    def _number(self, key: str, text: str, group: str, value: float, unit: str = "") -> Choice:
        """A number whose range is about its first value, so that a slider's ends stay where they are."""
        return number(key, text, group, self._firsts.setdefault(key, float(value)), float(value), unit)

    @cached_property
    def _task_names(self) -> list[str]:
        return [title_of(task, self.robot) for task in self.scenario.controller().given.task]

    def _with(self, settings: Settings) -> Scenario:
        kind = str(settings.get("resolver.kind", self.scenario.parts.resolver.kind))
        known = RESOLVER_PARTS[kind].model_fields
        chosen: dict[str, object] = {"resolver.kind": kind}
        weights: dict[str, object] = {}
        if self.scenario.parts.retreat is not None and not settings.get("retreat"):
            chosen["retreat"] = False  # so that it never gives up
        for key, value in settings.items():
            room, _, rest = key.partition(".")
            if key == "resolver.kind" or (room == "resolver" and rest.partition(".")[0] not in known):
                continue
            if key.startswith("resolver.weights."):
                weights[rest.partition(".")[2]] = value
            elif key != "retreat" and (key != "limits" or value != (self.scenario.parts.limits is not None)):
                chosen[key] = value
        if weights:
            defaults = self.scenario.parts.resolver.model_dump().get("weights") or {}
            chosen["resolver.weights"] = {**defaults, **weights}
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
        self._tasks = [
            task if isinstance(task, Task) else Task(task, np.zeros(len(task.rows(robot)))) for task in tasks
        ]

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
        choices = [Choice("resolver.kind", "method", RESOLVER, kind, self._kinds)]
        choices.append(Choice("limits", "keep the limits", RESOLVER, bool(settings.get("limits", True))))
        for i, task in enumerate(Stack(tuple(self._tasks))):
            key = f"task.{i}.gain"
            text, value = f"K of {title_of(task, self.robot)}", float(settings.get(key, 2.0))
            choices.append(number(key, text, GAINS, 2.0, value, "1/s"))
        return choices

    @cached_property
    def _kinds(self) -> tuple[str, ...]:
        kinds = []
        for kind in RESOLVERS:
            with suppress(NmmError, TypeError):
                self.controller({"resolver.kind": kind})
                kinds.append(kind)
        return tuple(kinds)


@dataclass(frozen=True, eq=False)
class Target:
    """One task's target, s numbers, with the rows' names and units. `frame` is what the task positions in the
    world, or turns there, or None; `axes` are the rows that hold each axis, `rotation` those of its rotation
    vector."""

    title: str
    signal: LiveTarget
    rows: tuple[tuple[str, str], ...]
    frame: str | None
    axes: dict[str, int]
    rotation: tuple[int, ...]

    def for_page(self) -> dict[str, Any]:
        rows = [{"name": name.removeprefix(f"{self.title}."), "unit": unit} for name, unit in self.rows]
        heading = f"Target of {self.title}"
        known = {} if self.frame is None else {"axes": self.axes, "rotation": self.rotation}
        fields = {"name": self.title, "heading": heading, "rows": rows, "frame": self.frame}
        return {**fields, "axes": {}, "rotation": (), **known}


def targets_of(controller: Controller, q: Array, *, at_robot: bool) -> tuple[Target, ...]:
    """A target for each task: at t = 0 and q (n,) its reference's value, or the robot's."""
    configuration = Configuration(controller.robot, q)
    targets = []
    for task in controller.given.task:
        value = evaluate(task.function if at_robot else task.reference, 0.0, configuration).value
        rows = tuple((row.name, row.unit) for row in task.function.rows(controller.robot))
        shown = task.function.shown()
        axes = dict(shown.axes) if shown.positions is not None else {}
        frame = shown.positions or (shown.turns if shown.rotation else None)
        signal = LiveTarget(np.array(value), rows[0][1])
        targets.append(Target(title_of(task, controller.robot), signal, rows, frame, axes, shown.rotation))
    return tuple(targets)


def title_of(task: Task, robot: Robot) -> str:
    """A task's own name, or the frame that its rows share ("ee" for ee.x, ee.y), or the rows' names."""
    names = [row.name for row in task.rows(robot)]
    owners = {name.rpartition(".")[0] for name in names}
    return task.name or (owners.pop() if len(owners) == 1 else "") or ", ".join(names)


def aimed(controller: Controller, targets: tuple[Target, ...]) -> Controller:
    """A controller whose tasks follow the targets."""
    tasks = [
        Task(
            *(task.function, target.signal, task.gain, task.priority, task.speed, task.braking, task.name),
            when=task.when,
        )
        for task, target in zip(controller.given.task, targets, strict=True)
    ]
    return controller.with_arguments(task=Stack.of(tasks))


def led_by(controller: Controller, task: Task, resolver: Resolver) -> Controller:
    """A controller of the same robot, limits and distances that does nothing but a task."""
    alone: dict[str, Any] = {"objective": None, "added_task": Stack(), "retreat": None, "steering": False}
    arguments = controller.given._replace(task=Stack.of(task), resolver=resolver, dt=controller.dt, **alone)
    return Controller(*arguments)
