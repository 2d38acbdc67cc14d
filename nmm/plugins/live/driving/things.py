"""What cameras see, as things that a page drags: points of one thing move together."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.control.controller import Controller
from nmm.control.functions.function import Function, Sight
from nmm.control.functions.program import evaluate
from nmm.control.functions.references.live_target import Displaced, LiveTarget
from nmm.control.functions.tasks.task import Stack
from nmm.control.limits.limit import Limit
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.motion.seen import same_point


class Thing:
    """Points of the world that are seen, and how far they have been dragged, m: on their own way, if they
    have one."""

    def __init__(self, points: Iterable[Function], robot: Robot, title: str) -> None:
        self.points, self.title = tuple(points), title
        self.away = LiveTarget(np.zeros(3))
        self._at_rest = Configuration(robot, robot.rest)  # they stand in the world, wherever the robot is

    def middle(self, t: float) -> Array:
        """(3,), m, where they are at t, s, in the mean."""
        return self._before(t) + self.away.value

    def drag(self, to: Array, t: float) -> None:
        """Move their middle to a point (3,), m, at t, s; `InputError` for anything else."""
        self.away.set(to - self._before(t) if to.shape == (3,) else to)

    def _before(self, t: float) -> Array:
        return np.mean([evaluate(point, t, self._at_rest).value for point in self.points], axis=0)

    def for_page(self) -> dict[str, Any]:
        axes = {axis: row for row, axis in enumerate("xyz")}
        rows = [{"name": axis, "unit": "m"} for axis in axes]
        fields = {"name": self.title, "heading": self.title, "rows": rows, "frame": None}
        return {**fields, "axes": axes, "rotation": ()}


class Things:
    """What the cameras of a controller's tasks and limits see in the world, by thing.

    A thing is the points of a function, with those of others that share one with it.
    """

    def __init__(self, controller: Controller) -> None:
        self._robot = robot = controller.robot
        groups: list[dict[object, Function]] = []
        for sight in _sights(controller):
            keyed = {key: point for point in sight.points if (key := self._key(point)) is not None}
            joined = [group for group in groups if group.keys() & keyed.keys()]
            groups = [group for group in groups if group not in joined]
            for group in joined:
                keyed |= group
            groups += [keyed] if keyed else []
        many = len(groups) > 1
        self.all = [
            Thing(group.values(), robot, f"What is seen{f', {k + 1}' if many else ''}")
            for k, group in enumerate(groups)
        ]
        self._away = {key: thing.away for thing, group in zip(self.all, groups, strict=True) for key in group}

    def _key(self, point: Function) -> object:
        """None for one that is on the robot, or that is set from outside."""
        on_robot = any(stage.frames or stage.callback for stage in point.stages(self._robot))
        return None if on_robot else same_point(point, self._robot)

    def seen_by(self, controller: Controller) -> Controller:
        """A controller of the same kind that sees them where they have been dragged to."""
        if not self.all:
            return controller
        arguments = controller.given
        limits = arguments.limits
        if limits is not None:
            limits = copy(limits)
            limits.bounds = tuple(self._moved(bound) for bound in limits.bounds)
        tasks = Stack(tuple(self._moved(task) for task in arguments.task))
        return controller.with_arguments(task=tasks, limits=limits)

    def _moved(self, part: Any) -> Any:
        """A task or a bound whose function sees them."""
        sight = None if isinstance(part, Limit) else part.function.shown().sees
        if sight is None or sight.of_others is None:
            return part
        away = [self._away.get(self._key(point)) for point in sight.points]
        points = [
            point if by is None else Displaced(point, by)
            for point, by in zip(sight.points, away, strict=True)
        ]
        moved = copy(part)
        moved.function = sight.of_others(tuple(points))
        return moved


def _sights(controller: Controller) -> list[Sight]:
    limits = controller.given.limits
    bounds = () if limits is None else limits.bounds
    functions = (bound.function for bound in bounds if not isinstance(bound, Limit))
    tasks = (task.function for task in controller.given.task)
    sights = [function.shown().sees for function in (*tasks, *functions)]
    return [sight for sight in sights if sight is not None and sight.of_others is not None]
