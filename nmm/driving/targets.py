"""A task's target as a `Signal`, with what a page needs to know to draw it and to move it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.functions.program import evaluate
from nmm.functions.references.signal import Signal
from nmm.functions.tasks.task import Task
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Target:
    """The target of one task.

    Attributes
    ----------
    title : what a page calls it
    signal : where the target is, s numbers
    rows : name and unit of each
    frame : the frame that the task puts somewhere in the world; None where it does not
    axes : the world's axes along which it does, each with the row that holds it
    """

    title: str
    signal: Signal
    rows: tuple[tuple[str, str], ...]
    frame: str | None
    axes: dict[str, int]

    def told(self) -> dict[str, Any]:
        """For the page."""
        rows = [{"name": name.removeprefix(f"{self.title}."), "unit": unit} for name, unit in self.rows]
        return {"name": self.title, "rows": rows, "frame": self.frame, "axes": self.axes}


def targets_of(controller: Controller, q: Array, *, at_robot: bool) -> tuple[Target, ...]:
    """A target for each task: at t = 0 and q (n,) that of its reference, or where the robot is."""
    robot = controller.robot
    here = Configuration(robot, q)
    return tuple(_target(task, robot, here, at_robot=at_robot) for task in controller.task)


def title_of(task: Task, robot: Robot) -> str:
    """A task's own name, or the frame that all its rows are of ("ee" for ee.x, ee.y), or its rows' names."""
    names = [row.name for row in task.rows(robot)]
    owners = {name.rpartition(".")[0] for name in names}
    return task.name or (owners.pop() if len(owners) == 1 else "") or ", ".join(names)


def _target(task: Task, robot: Robot, here: Configuration, *, at_robot: bool) -> Target:
    value = evaluate(task.function if at_robot else task.reference, 0.0, here).value
    rows = task.function.rows(robot)
    shown = task.function.shown()
    return Target(
        title_of(task, robot),
        Signal(np.array(value), rows[0].unit),
        tuple((row.name, row.unit) for row in rows),
        shown.positions,
        dict(shown.axes) if shown.positions is not None else {},
    )


def aimed(controller: Controller, targets: tuple[Target, ...]) -> Controller:
    """A controller like this one whose tasks follow the targets; without retreats: it never gives up."""
    tasks = []
    for task, target in zip(controller.task, targets, strict=True):
        tasks.append(
            Task(task.function, target.signal, task.gain, task.priority, task.speed, task.braking, task.name)
        )
    return Controller(
        controller.robot,
        tasks,
        controller.resolver,
        controller.objective,
        controller.added_task if controller.added_task.tasks else None,
        controller.limits,
        controller.dt,
        None,
        controller.steering,
        controller.collisions,
        controller.kinematics,
    )
