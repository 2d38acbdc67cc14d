"""The records of a compiled step, laid out from a robot's tasks, objective, limits and distances."""

from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, expect_kind, expect_known
from nmm.base.kernels.record_layout import header_length, views
from nmm.control.functions.function import Function, row_scales
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.program import BESIDE, COMPILED, PINOCCHIO, Buffers, Program
from nmm.control.functions.tasks.task import Stack, TasksOn
from nmm.control.limits.bounds import DistanceDamper
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits, LimitsOn
from nmm.control.period_monitor import NOT_CALLED
from nmm.control.resolvers.answer import unanswered
from nmm.control.resolvers.base import Resolver, State
from nmm.control.resolvers.problem import Dimensions, Problem
from nmm.control.resolvers.problem_arrays import LOWER, UPPER
from nmm.control.resolvers.saturation import enforce_limits
from nmm.control.retreat import Retreat, retreat_numbers
from nmm.control.steering import NOTHING, Steered, Steering
from nmm.control.step.acceleration import accelerate, write_next_limits
from nmm.control.step.bounded_step import write_clearance, write_limits
from nmm.control.step.equations import Arm, ControlStep
from nmm.control.step.equations import step as compiled_step
from nmm.control.step.limit_rows import LaidOutLimit
from nmm.control.step.safety_filter import CUTS, MARGIN, Counts
from nmm.control.step.step_records import SecondOrder, TaskRows
from nmm.control.step.task_rows import task_functions, task_rows
from nmm.model.collisions.rows import no_rows
from nmm.model.robots.robot import Robot


class ControllerArguments(NamedTuple):
    """The arguments of a controller, in the order of its constructor."""

    robot: Robot
    task: Stack
    resolver: Resolver
    objective: Objective | None
    added_task: Stack
    limits: Limits | None
    dt: float | None
    retreat: Retreat | None
    steering: Steering | bool
    collisions: Collisions | None
    kinematics: str
    order: int
    servo: float


#: Steps of second order's differences along the motion, s: of compiled rows, and of users' Python functions.
BESIDE_BY, BESIDE_BY_IN_PYTHON = 1e-6, 1e-4
#: k of second order, 1/s, unless given.
SERVO = 5.0


def checked(arguments: ControllerArguments) -> ControllerArguments:
    """Check the arguments and return them; `InputError` for wrong kinds and combinations."""
    kinds = {"objective": Objective, "retreat": Retreat, "limits": Limits, "collisions": Collisions}
    optional = {name: kind for name, kind in kinds.items() if getattr(arguments, name) is not None}
    steering = {} if isinstance(arguments.steering, bool) else {"steering": Steering}
    for name, kind in ({"robot": Robot, "resolver": Resolver} | optional | steering).items():
        expect_kind(getattr(arguments, name), kind, "controller", f"a {kind.__name__} as {name}")
    expect_known("kinematics", arguments.kinematics, (PINOCCHIO, COMPILED), "controller")
    if arguments.added_task.tasks and not arguments.resolver.takes_added_task:
        raise InputError(f"resolver {arguments.resolver.name} takes none, ej does", where="added_task")
    if arguments.order not in (1, 2):
        raise InputError(where="order", expected="1, for inputs u, or 2, for u_dot", got=arguments.order)
    if arguments.order == 2:
        positive(arguments.servo, "servo")
        if arguments.collisions is not None:
            raise InputError(
                "distances are checked along motions whose inputs are held, and at order 2 inputs accelerate",
                where="collisions",
                expected="order 1, or no collisions",
            )
    return arguments


class ControllerLayout(NamedTuple):
    """A controller's records in memory, and the objects that they were laid out from.

    tasks, added : the tasks and the added ones, with their rows
    program : the functions, in memory; step : what a step reads and writes besides them, as views
    dimensions, state : of the resolver's problem, and what the resolver remembers
    limits_on : the limits, resolved for the robot
    terms : the objective's, with weights
    steered : the steering law, if the equations have room for it
    """

    tasks: TasksOn
    added: TasksOn
    program: Program
    step: ControlStep
    dimensions: Dimensions
    state: State
    limits_on: LimitsOn
    terms: tuple[tuple[float, Function], ...]
    steered: Steered | None


def lay_out(arguments: ControllerArguments, steered: Steered | None, kept: Array) -> ControllerLayout:
    """Lay out the memory of a `Controller`, which keeps distances `kept` (P,), m; `InputError` for what the
    robot lacks, or for too many rows."""
    robot, task, resolver, objective, added_task, limits, *_ = arguments
    collisions = arguments.collisions
    limited = limits is not None or collisions is not None
    second = arguments.order == 2
    code, limits_code = (accelerate, write_next_limits) if second else (compiled_step, write_limits)
    tasks, added_tasks = task.on(robot), added_task.on(robot)
    rows, added_rows = tasks.rows, added_tasks.rows
    weighted = () if objective is None else objective.terms_on(robot)
    functions, added = task_functions(task), task_functions(added_task)
    limits_on = (Limits(False, False) if limits is None else limits).on(robot)
    objectives = [function for _, function in weighted]
    pursued = [] if steered is None else [steered.pursuit]
    # At second order the rows that are differenced come first; their kinematics are compiled.
    listed = [*functions, *added, *limits_on.functions, *objectives, *pursued]
    kinematics = COMPILED if second else arguments.kinematics
    program = Program(
        robot, listed, kinematics, [name for stage in limits_on.stages for name in stage.frames]
    )
    first = program.first_rows
    after = len(functions) + len(added)
    objective_at = after + len(limits_on.functions)
    s, m = len(rows), robot.n_u
    # The extended Jacobian needs a row for each steered input to be square.
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
        levels=tasks.levels,
        separate=task.separate(robot),
        added_J=np.vstack([np.zeros((len(added_rows), m)), held]),
        added_rate=np.zeros(len(added_rows) + len(held)),
        added_row_scales=np.append(row_scales(added_rows, robot), np.ones(len(held))),
        falling=-limits_on.changes[:, 0],
        rising=limits_on.changes[:, 1],
        limit_rows=np.zeros((len(limits_on.rows) + len(near.d), m)),
        limit_levels=[*(task.place(priority) for priority in limits_on.priorities), *(0 for _ in near.d)],
    )
    arrays = problem.arrays._replace(limiter=enforce_limits.address if limited else 0)
    numbers = limits_on.numbers(first[after : after + len(limits_on.functions)])
    arrays.stops[m + len(numbers.spin) :] = UPPER + LOWER
    arrays.stops[m + limits_on.first_own : m + len(limits_on.rows)] = 0  # those of speeds and forces
    dimensions = problem.dimensions
    setup, state = resolver.setup(dimensions), resolver.start(dimensions)
    differenced = len(limits_on.rows) + s + len(added_rows), objective_at
    own = task_rows(tasks, first, limits_on.bounded)
    theirs = task_rows(added_tasks, first[len(functions) :], limits_on.bounded)
    own_limits = _own_limits(limits_on, program)
    program.lay_out(
        ControlStep(
            near=near,
            clearance=_clearance(collisions, kept, len(limits_on.rows), len(near.d)),
            task=own,
            added=theirs,
            arm=Arm(robot.arm_coordinates, robot.following.table.ravel()),
            terms=np.array(first[objective_at : objective_at + len(objectives)], dtype=np.int64),
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
            scale=np.ones(len(dimensions.levels)),
            q_dot=np.zeros(robot.n),
            retreat=retreat_numbers(arguments.retreat, robot, rows),
            period=NOT_CALLED,
            second=_second(arguments, program, own, theirs, differenced) if second else _first(),
            t=np.array(0.0),
            own_limits=program.place_after(ControlStep)
            + header_length(LaidOutLimit) * np.arange(len(own_limits), dtype=np.int64),
            inputs_before=np.zeros(m if own_limits else 0),
            step=code.address,
            limits_code=limits_code.address if limited else 0,
            clearance_code=write_clearance.address if len(near.d) else 0,
        ),
        own_limits,
    )
    step = views(ControlStep, *program.blocks, BESIDE)
    if second and program.calls_python:
        step.second.h[()] = BESIDE_BY_IN_PYTHON
    state.memory = step.state
    return ControllerLayout(
        tasks, added_tasks, program, step, dimensions, state, limits_on, weighted, steered
    )


def _own_limits(limits_on: LimitsOn, program: Program) -> list[LaidOutLimit]:
    """Lay out the limits with a kernel of their own; their rows come after those of wheels and functions."""
    laid = []
    first = quantity = limits_on.first_own
    for stage, count in zip(limits_on.stages, limits_on.counts, strict=True):
        ends = first, first + stage.rows, quantity, quantity + count
        addresses = stage.kernel.address, stage.values.address
        laid.append(
            LaidOutLimit(*addresses, *ends, int(stage.rates), program.slots(stage.frames), stage.numbers)
        )
        _, first, _, quantity = ends
    return laid


def _second(
    arguments: ControllerArguments,
    program: Program,
    task: TaskRows,
    added: TaskRows,
    differenced: tuple[int, int],
) -> SecondOrder:
    n, m, (rows, functions) = arguments.robot.n, arguments.robot.n_u, differenced
    stages, buffers = program.rows_of(functions)
    return SecondOrder(
        servo=np.array(float(arguments.servo)),
        h=np.array(BESIDE_BY),
        share=np.array(1.0),
        stages=stages,
        buffers=buffers,
        task=task,
        added=added,
        beside=np.zeros(n),
        y=np.zeros((3, rows)),
        D=np.zeros(rows),
        lead=np.zeros(len(task.rows)),
        lower=np.full(m, -np.inf),
        upper=np.full(m, np.inf),
        u_dot=np.zeros(m),
    )


def _first() -> SecondOrder:
    """An empty record of second order, for controllers of first order."""
    shapes = [(0, 3, 4), (0, 6, 0), (0, 6, 0, 0), (0, 0), (0, 0, 0), (0,), (0,), (0, 0)]
    none, cell = np.zeros(0), np.array(1.0)
    integers = np.zeros(0, dtype=np.int64)
    rows = TaskRows(integers.reshape(0, 3), np.zeros((0, 0)), none, none, integers, *(none for _ in range(4)))
    buffers = Buffers(*(np.zeros(shape) for shape in shapes))
    y = np.zeros((3, 0))
    return SecondOrder(cell, cell, cell, 0, buffers, rows, rows, none, y, *(none for _ in range(5)))


def _clearance(collisions: Collisions | None, kept: Array, first: int, count: int) -> DistanceDamper:
    settings = Collisions() if collisions is None else collisions
    return DistanceDamper(
        first=np.array(first, dtype=np.int64),
        distance=kept,
        margin=np.array(MARGIN),
        gain=np.array(settings.gain),
        recovery=np.array(settings.recovery),
        braking=np.array(np.nan if settings.braking is None else settings.braking),
        least=np.full(count, -np.inf),
        held=np.array(0),
        counts=np.zeros(len(Counts._fields), dtype=np.int64),
    )
