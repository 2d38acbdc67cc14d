"""The paper's four cases in nmm's words, beside the twin's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import twin
from numpy import pi
from numpy.typing import NDArray

from nmm.control.controller import Controller
from nmm.control.functions.objectives import Objective, Quadratic, QuadraticTerm
from nmm.control.functions.references import Bearing, Circle
from nmm.control.functions.tasks import Heading, Position, Task
from nmm.control.resolvers import ProjectedGradient, ReducedGradient, Resolver
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """One of the paper's cases; `basic` are the columns of J that its RG starts with."""

    name: str
    robot: str
    tasks: tuple[Task, ...]
    objective: Objective
    q0: Array
    partitions: Any
    basic: tuple[int, ...]
    twin: Callable[[float, Array], twin.Problem]

    def controller(self, robot: Robot, resolver: Resolver | None = None) -> Controller:
        return Controller(robot, self.tasks, resolver or ProjectedGradient(), self.objective)

    def rg(self, alpha: float = 10.0) -> ReducedGradient:
        return ReducedGradient(alpha, self.partitions)


CIRCLE = Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi)
TIP = Task(Position("ee", "xy"), CIRCLE)
H1 = Quadratic(QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, pi / 2), QuadraticTerm("q1", pi / 4))
H2 = Quadratic(QuadraticTerm("q2", -pi / 2))
H3 = Quadratic(QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}))
H4 = Quadratic(QuadraticTerm("q1"), QuadraticTerm("q3", -pi / 2))

CASES = (
    Case(
        "case 1", "unicycle_2r", (TIP,), H1, twin.START_2R, [("v", "q1"), ("v", "omega")], (0, 1), twin.case_1
    ),
    Case(
        "case 2",
        "unicycle_2r",
        (TIP, Task(Heading("link2"), Bearing(CIRCLE, twin.TARGET))),
        H2,
        twin.START_2R,
        [("v", "omega", "q1")],
        (0, 1, 2),
        twin.case_2,
    ),
    Case(
        "case 3",
        "unicycle_2r",
        (TIP, Task(Heading("link1"), Bearing(Position("link2", "xy"), twin.TARGET))),
        H3,
        twin.START_2R,
        [("v", "omega", "q1")],
        (0, 1, 2),
        twin.case_3,
    ),
    Case(
        "case 4",
        "unicycle_3r",
        (Task(Position("ee", "xyz"), Circle([2, 2, 0.5], 3, 0.08 * pi, 5 / 4 * pi)),),
        H4,
        twin.START_3R,
        "automatic",
        (),
        twin.case_4,
    ),
)
