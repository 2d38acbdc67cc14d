"""Inputs without effect on a task: columns of J that are zero in every configuration."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.control.functions.objectives.base import WeightedFunction
from nmm.control.functions.program import evaluate
from nmm.control.step.step_solver import StepSolver
from nmm.model.robots.configuration import Configuration

#: Number of configurations: in a single one a column may be zero by chance.
CONFIGURATIONS = 8
#: Coordinates are drawn within this distance of the start, m and rad.
AROUND = 1.0
#: A column this much smaller than J is zero.
ZERO = 1e-12


def inputs_without_effect(solver: StepSolver, q0: ArrayLike | None = None) -> tuple[str, ...]:
    """Names of the inputs whose column of J (s, n_u) is zero, as a car's steering rate is for a position.

    To first order such an input does not move the task, so only the objective can use it. The columns are
    compared at a fixed set of random configurations about `q0`, within the limits.

    Parameters
    ----------
    solver : of a controller (`Controller.solver`), evaluated at t = 0 s
    q0 : (n,) m and rad, the centre of the configurations; zero when not given

    Returns
    -------
    Names as in `robot.u_names`; none when J could not be evaluated (a user's function raised, say)
    """
    return _zero_columns(solver, q0, lambda solver, q: solver.derivatives[:1])


def idle_inputs(solver: StepSolver, q0: ArrayLike | None = None) -> tuple[str, ...]:
    """Inputs, as `inputs_without_effect`, that no task, added task, objective or steering law uses."""
    steered = () if solver.steered is None else solver.steered.inputs
    idle = _zero_columns(solver, q0, _derivatives)
    return tuple(name for name in idle if name not in steered)


def _derivatives(solver: StepSolver, q: Array) -> Sequence[Array]:
    """J, the added task's own rows, h, each term of changing weight, as that may be 0 at first, and what
    terms change with elsewhere (`Function.dependence`): where in the world a scene is does not matter."""
    robot, objective = solver.robot, solver.objective
    J, added_J, h = solver.derivatives
    whole = []
    for _, term in () if objective is None else objective.terms():
        configuration = Configuration(robot, q)
        elsewhere = (term.function if isinstance(term, WeightedFunction) else term).dependence(configuration)
        if elsewhere is not None:
            whole.append(elsewhere @ configuration.S)
        elif isinstance(term, WeightedFunction):
            whole.append(evaluate(term.function, 0.0, configuration).value_q @ configuration.S)
    return J, added_J[: len(solver.added_on.rows)], h, *whole


def _zero_columns(
    solver: StepSolver, q0: ArrayLike | None, matrices: Callable[[StepSolver, Array], Sequence[Array]]
) -> tuple[str, ...]:
    """Inputs whose columns are zero in all matrices (rows, n_u), in every configuration."""
    largest = np.zeros(solver.robot.n_u)
    looked = False
    try:
        with solver.sample.preserve_state():
            for q in _configurations(solver, solver.robot.q(q0)):
                solver.linearise(0.0, q)
                evaluated = matrices(solver, q)
                if not all(np.isfinite(matrix).all() for matrix in evaluated):
                    continue
                for matrix in evaluated:
                    size = float(np.linalg.norm(matrix))
                    if size > 0.0:
                        largest = np.maximum(largest, np.linalg.norm(matrix, axis=0) / size)
                        looked = True
                if np.all(largest > ZERO):  # `largest` never falls
                    return ()
    except Exception:  # a user's function may raise anything where it is not defined
        return ()
    if not looked:
        return ()
    return tuple(name for name, column in zip(solver.robot.u_names, largest, strict=True) if column <= ZERO)


def _configurations(solver: StepSolver, q0: Array) -> Array:
    """Configurations (K, n) about q0 and within the limits; q0 itself may be singular."""
    lower, upper = solver.robot.q_limits.T
    lower, upper = np.maximum(lower, q0 - AROUND), np.minimum(upper, q0 + AROUND)
    # A start outside its limits is reported elsewhere.
    lower, upper = np.minimum(lower, upper), np.maximum(lower, upper)
    rng = np.random.default_rng(0)
    return solver.robot.following.placed(rng.uniform(lower, upper, (CONFIGURATIONS, solver.robot.n)))
