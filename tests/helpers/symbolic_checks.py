"""What the tests of formulas share: formulas against the compiled numbers, and robots with their analyses."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np
import twin
from numpy.typing import NDArray
from paper_cases import CIRCLE

from nmm.analysis.singular.jacobians import Jacobians, stacked
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import Bearing
from nmm.control.functions.tasks import Heading, Position, Task
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic import SymbolicAnalysis, symbolic

Array = NDArray[np.float64]

TIP = Task(Position("ee", "xy"), CIRCLE)
#: The paper's tasks by robot and name. "link heading" is J of section VI-3, "link pointing" J_bar of it.
TASKS: dict[str, Any] = {
    "position": TIP,
    "pointing": [TIP, Task(Heading("link2"), Bearing(CIRCLE, twin.TARGET))],
    "link heading": [TIP, Heading("link1")],
    "link pointing": [TIP, Task(Heading("link1"), Bearing(Position("link2", "xy"), twin.TARGET))],
    "spatial position": Position("ee"),
}
#: All that the paper analyses.
PAPER = [("unicycle_2r", name) for name in list(TASKS)[:4]] + [("unicycle_3r", "spatial position")]


def made(robot: str, task: str = "position", arguments: Mapping[str, float] | None = None) -> Any:
    """Robot, task and analysis, each made once."""
    return _made(robot, task, tuple((arguments or {}).items()))


@cache
def _made(robot: str, task: str, arguments: tuple[tuple[str, float], ...]) -> Any:
    loaded = load(robot, arguments=dict(arguments))
    return loaded, TASKS[task], symbolic(loaded, TASKS[task])


def minors_of(J: Array) -> list[float]:
    """Maximal minors in the order of their columns."""
    s, m = J.shape
    return [float(np.linalg.det(J[:, list(c)])) for c in itertools.combinations(range(m), s)]


def check_numbers(
    robot: Robot, task: Any, analysis: SymbolicAnalysis, q: Iterable[Array], tolerance: float = 1e-10
) -> None:
    """f, J and all minors are those that the compiled functions give."""
    functions, jacobians = analysis.functions(), Jacobians((robot, task))
    assert analysis.row_names == jacobians.row_names
    for point in q:
        J = jacobians.J(0.0, point)
        configuration = Configuration(robot, point)
        value = np.concatenate([evaluate(t.function, 0.0, configuration).value for t in stacked(task)])
        angular = [row.angular for row in jacobians.rows]
        off = functions.f(point) - value
        off = np.where(angular, np.remainder(off + np.pi, 2 * np.pi) - np.pi, off)
        assert np.max(np.abs(off)) < tolerance
        assert np.max(np.abs(functions.J(point) - J)) < tolerance
        minors = functions.minors(point)
        assert list(minors) == list(itertools.combinations(robot.u_names, len(J)))
        assert np.max(np.abs(np.array(list(minors.values())) - minors_of(J))) < tolerance
