"""A robot's tasks, objective, limits and distances, laid out for the compiled step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.collisions.rows import no_rows
from nmm.control.bounded_step import write_clearance, write_limits
from nmm.control.clearance_rows import Clearance
from nmm.control.collisions import Collisions
from nmm.control.equations import Arm, ControlStep
from nmm.control.equations import step as compiled_step
from nmm.control.guard import CUTS, MARGIN
from nmm.control.limits import Limits, LimitsOn
from nmm.control.steering import NOTHING, Steered
from nmm.control.task_rows import task_functions, task_rows
from nmm.functions.function import Function, row_scales
from nmm.functions.objectives.base import Objective
from nmm.functions.program import BESIDE, Program
from nmm.functions.tasks.task import Stack
from nmm.kernels.ahead import compile_ahead
from nmm.kernels.memory import views
from nmm.resolvers.answer import unanswered
from nmm.resolvers.base import Resolver
from nmm.resolvers.limited import limit
from nmm.resolvers.problem import Dimensions, Problem
from nmm.resolvers.problem_arrays import LOWER, UPPER
from nmm.resolvers.state import State
from nmm.robots.robot import Robot


class LaidOut(NamedTuple):
    """What a controller computes with.

    program : the functions, in memory; step : what a step reads and writes beside them, as views
    dimensions, state : of the resolver's problem, and what the resolver remembers
    kept : the limits
    terms : the objective's, with weights
    steered : the law for steering, if the equations have room for it
    """

    program: Program
    step: ControlStep
    dimensions: Dimensions
    state: State
    kept: LimitsOn
    terms: tuple[tuple[float, Function], ...]
    steered: Steered | None


def lay_out(
    robot: Robot,
    task: Stack,
    added_task: Stack,
    resolver: Resolver,
    objective: Objective | None,
    limits: Limits | None,
    steered: Steered | None,
    collisions: Collisions | None,
    kinematics: str,
) -> LaidOut:
    """Lay out what a `Controller` is given.

    Raises
    ------
    InputError : what the robot lacks; rows that the resolver has no room for
    """
    limited = limits is not None or collisions is not None
    compile_ahead(*([write_limits] if limited else []), compiled_step, resolver.kernel)
    rows, added_rows = task.rows(robot), added_task.rows(robot)
    weighted = () if objective is None else objective.terms_on(robot)
    functions, added = task_functions(task), task_functions(added_task)
    kept = (Limits(False, False) if limits is None else limits).on(robot)
    objectives = [function for _, function in weighted]
    pursued = [] if steered is None else [steered.pursuit]
    program = Program(robot, [*functions, *added, *objectives, *kept.functions, *pursued], kinematics)
    first = program.first_rows
    tasks = len(functions) + len(added)
    after = tasks + len(objectives)
    s, m = len(rows), robot.n_u
    # The extended Jacobian is square with a row for each input that pursuit steers.
    held = np.zeros((0, m))
    if steered is not None and resolver.takes_added_task:
        if len(added_rows) + len(steered.inputs) == m - s:
            held = np.eye(m)[[robot.input(name) for name in steered.inputs]]
        else:
            steered = None
    near = no_rows(robot.n) if collisions is None else no_rows(robot.n, collisions.rows, CUTS)
    problem = Problem(
        J=np.zeros((s, m)),
        rate=np.zeros(s),
        h=np.zeros(m),
        inputs=robot.u_names,
        groups=robot.groups,
        row_scales=row_scales(rows, robot),
        levels=task.levels(robot),
        added_J=np.vstack([np.zeros((len(added_rows), m)), held]),
        added_rate=np.zeros(len(added_rows) + len(held)),
        added_row_scales=np.append(row_scales(added_rows, robot), np.ones(len(held))),
        limit_rows=np.zeros((len(kept.rows) + len(near.d), m)),
        limit_levels=[*(task.place(priority) for priority in kept.priorities), *(0 for _ in near.d)],
    )
    arrays = problem.arrays._replace(limiter=limit.address if limited else 0)
    numbers = kept.numbers(first[after : after + len(kept.functions)], robot)
    arrays.stops[m + len(numbers.spin) :] = UPPER + LOWER
    dimensions = problem.dimensions
    setup, state = resolver.setup(dimensions), resolver.start(dimensions)
    program.lay_out(
        ControlStep(
            near=near,
            clearance=_clearance(collisions, len(kept.rows), len(near.d)),
            task=task_rows(task, robot, first),
            added=task_rows(added_task, robot, first[len(functions) :]),
            arm=Arm(robot.arm_coordinates, robot.following.table.ravel()),
            terms=np.array(first[tasks:after], dtype=np.int64),
            weights=np.array([weight for weight, _ in weighted]),
            H=np.array(0.0),
            problem=arrays,
            limits=numbers,
            steering=NOTHING
            if steered is None
            else steered.numbers(first[-1], getattr(resolver, "alpha", 1.0)),
            resolver=resolver.kernel.address,
            numbers=setup.numbers,
            options=setup.options,
            state=state.memory,
            answer=unanswered(m, len(dimensions.levels)),
            q_dot=np.zeros(robot.n),
            step=compiled_step.address,
            limits_code=write_limits.address if limited else 0,
            clearance_code=write_clearance.address if len(near.d) else 0,
        )
    )
    step = views(ControlStep, *program.blocks, BESIDE)
    state.memory = step.state
    return LaidOut(program, step, dimensions, state, kept, weighted, steered)


def _clearance(collisions: Collisions | None, first: int, count: int) -> Clearance:
    """How distances are kept, as a step reads it."""
    braking = None if collisions is None else collisions.braking
    return Clearance(
        first=np.array(first, dtype=np.int64),
        distance=np.array(0.0 if collisions is None else collisions.distance),
        margin=np.array(MARGIN),
        gain=np.array(0.0 if collisions is None else collisions.gain),
        recovery=np.array(0.0 if collisions is None else collisions.recovery),
        braking=np.array(np.nan if braking is None else braking),
        least=np.full(count, -np.inf),
    )
