"""A task's target as a `LiveTarget`, with what a page needs to draw and move it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.functions.program import evaluate
from nmm.functions.references.live_target import LiveTarget
from nmm.functions.tasks.task import Stack, Task
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Target:
    """One task's target, s numbers, with the rows' names and units. `frame` is what the task positions in the
    world, or None; `axes` are the rows that hold each axis."""

    title: str
    signal: LiveTarget
    rows: tuple[tuple[str, str], ...]
    frame: str | None
    axes: dict[str, int]

    def for_page(self) -> dict[str, Any]:
        rows = [{"name": name.removeprefix(f"{self.title}."), "unit": unit} for name, unit in self.rows]
        return {"name": self.title, "rows": rows, "frame": self.frame, "axes": self.axes}


def targets_of(controller: Controller, q: Array, *, at_robot: bool) -> tuple[Target, ...]:
    """A target for each task: at t = 0 and q (n,) its reference's value, or the robot's."""
    here = Configuration(controller.robot, q)
    found = []
    for task in controller.task:
        value = evaluate(task.function if at_robot else task.reference, 0.0, here).value
        rows = tuple((row.name, row.unit) for row in task.function.rows(controller.robot))
        shown = task.function.shown()
        axes = dict(shown.axes) if shown.positions is not None else {}
        signal = LiveTarget(np.array(value), rows[0][1])
        found.append(Target(title_of(task, controller.robot), signal, rows, shown.positions, axes))
    return tuple(found)


def title_of(task: Task, robot: Robot) -> str:
    """A task's own name, or the frame that its rows share ("ee" for ee.x, ee.y), or the rows' names."""
    names = [row.name for row in task.rows(robot)]
    owners = {name.rpartition(".")[0] for name in names}
    return task.name or (owners.pop() if len(owners) == 1 else "") or ", ".join(names)


def aimed(controller: Controller, targets: tuple[Target, ...]) -> Controller:
    """A controller whose tasks follow the targets; without retreats, so that it never gives up."""
    tasks = [
        Task(task.function, target.signal, task.gain, task.priority, task.speed, task.braking, task.name)
        for task, target in zip(controller.task, targets, strict=True)
    ]
    return Controller(*controller.given._replace(task=Stack.of(tasks), dt=controller.dt, retreat=None))
