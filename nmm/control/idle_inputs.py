"""Inputs without effect on a task: columns of J that are zero wherever the robot stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.steering import Steered
from nmm.functions.objectives.base import Objective
from nmm.functions.product import Product
from nmm.functions.program import evaluate
from nmm.functions.tasks.task import Stack
from nmm.resolvers.state import State
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot

#: How many configurations are looked at: one where a column is zero by chance would say nothing.
CONFIGURATIONS = 8
#: Half of the range about the start from which coordinates are drawn, m and rad.
AROUND = 1.0
#: A column this much smaller than J is zero.
ZERO = 1e-12


class Controller(Protocol):
    """What is read of a `nmm.control.controller.Controller`, which asks this module about itself."""

    robot: Robot
    objective: Objective | None
    added_task: Stack
    state: State
    steered: Steered | None
    linearise: Callable[[float, Array], float]

    @property
    def derivatives(self) -> tuple[Array, Array, Array]:
        """J, the added task's and h, of the last call."""


def inputs_without_effect(controller: Controller, q0: ArrayLike | None = None) -> tuple[str, ...]:
    """Names of the inputs whose column of J (s, n_u) is zero, as a car's steering rate is for a position.

    To first order such an input does not move the task, so that only the objective can use it. The columns
    are compared at random configurations about `q0`, within the limits, always the same ones. The
    controller's partition stays as it is.

    Parameters
    ----------
    controller : evaluated at t = 0 s
    q0 : (n,) m and rad, where the coordinates are drawn around; zero when not given

    Returns
    -------
    Names as in `robot.u_names`; none when J could not be evaluated (a user's function raised, say)
    """
    return _zero_columns(controller, q0, lambda controller, q: controller.derivatives[:1])


def idle_inputs(controller: Controller, q0: ArrayLike | None = None) -> tuple[str, ...]:
    """Names of the inputs without effect on the task, the added one and the objective: they stay 0.

    Parameters and result as for `inputs_without_effect`; what pursuit steers (`Controller.steered`) is moved.
    """
    steered = () if controller.steered is None else controller.steered.inputs
    idle = _zero_columns(controller, q0, _derivatives)
    return tuple(name for name in idle if name not in steered)


def _derivatives(controller: Controller, q: Array) -> Sequence[Array]:
    """J, the added task's own rows and h, without those that hold what pursuit steers.

    Terms of the objective whose weight changes are there without it, too: it may be 0 at first.
    """
    robot, objective = controller.robot, controller.objective
    J, added_J, h = controller.derivatives
    whole = []
    for _, term in () if objective is None else objective.terms():
        if isinstance(term, Product):
            here = Configuration(robot, q)
            whole.append(evaluate(term.function, 0.0, here).value_q @ here.S)
    return J, added_J[: len(controller.added_task.rows(robot))], h, *whole


def _zero_columns(
    controller: Controller, q0: ArrayLike | None, matrices: Callable[[Controller, Array], Sequence[Array]]
) -> tuple[str, ...]:
    """Inputs whose columns are zero, wherever the robot stands, in all matrices (rows, n_u)."""
    largest = np.zeros(controller.robot.n_u)
    looked = False
    remembered = controller.state.snapshot()
    try:
        for q in _configurations(controller, controller.robot.q(q0)):
            controller.linearise(0.0, q)
            for matrix in matrices(controller, q):
                size = float(np.linalg.norm(matrix))
                if np.isfinite(size) and size > 0.0:
                    largest = np.maximum(largest, np.linalg.norm(matrix, axis=0) / size)
                    looked = True
            if np.all(largest > ZERO):  # they stay so
                return ()
    except Exception:  # a user's function may raise anything, where it was not made for
        return ()
    finally:
        controller.state.restore(remembered)
    if not looked:
        return ()
    return tuple(
        name for name, column in zip(controller.robot.u_names, largest, strict=True) if column <= ZERO
    )


def _configurations(controller: Controller, q0: Array) -> Array:
    """Configurations about q0 and within the limits, (K, n); q0 itself may be a singular one."""
    lower, upper = controller.robot.q_limits.T
    lower, upper = np.maximum(lower, q0 - AROUND), np.minimum(upper, q0 + AROUND)
    # A start outside its limits is somebody else's complaint.
    lower, upper = np.minimum(lower, upper), np.maximum(lower, upper)
    rng = np.random.default_rng(0)
    return controller.robot.following.placed(rng.uniform(lower, upper, (CONFIGURATIONS, controller.robot.n)))
