"""The formulas of a robot and a task: from the names of the robot's lengths to the finished analysis."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Literal

import numpy as np

from nmm.analysis.singular.jacobians import Jacobians, Tasks, stacked
from nmm.base.errors import InputError, NmmError, SingularError, expect_known
from nmm.control.functions.tasks.task import Stack
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.derivation import derived
from nmm.plugins.symbolic.expansion import Ring
from nmm.plugins.symbolic.frames import steps_to
from nmm.plugins.symbolic.geometry import Geometry
from nmm.plugins.symbolic.symbolic_analysis import SymbolicAnalysis, assembled, too_large_explained
from nmm.plugins.symbolic.task_rows import frames_of

#: Products of terms that an analysis may take: some seconds.
BUDGET = 200_000
#: A branching kernel is compared at so many configurations, with a tolerance for a file's rounded angles.
_PLACES, _ROUNDED = 10, 1e-3


def symbolic(
    robot: Robot,
    task: Tasks,
    *,
    geometry: Literal["symbols", "numbers"] = "symbols",
    arguments: Mapping[str, str] | None = None,
) -> SymbolicAnalysis:
    """Derive f, J and all maximal minors of J as formulas.

    Parameters
    ----------
    robot : on any platform whose kernel has a formula, as almost all have
    task : functions of the configuration, or tasks made of them, one or several; no Python function of the
        user's. A reference that depends on the configuration (`Bearing` of a `Position`, or one of these
        functions) counts: J is then J_bar = (∂f/∂q - ∂g/∂q) S (paper, eq. 13). `Orientation` and `Pose` are
        taken without a reference: J is that of the error 0, velocities in the frame's own axes
    geometry : "symbols" for the robot's lengths that are not zero, or "numbers"
    arguments : names for lengths by their label, {"x_q2": "l1"} for the offset of joint q2 along x; by
        default the names of the xacro file's arguments, for which the file is read again

    Raises
    ------
    TooLarge : (an InputError) the formulas would be too long to read
    InputError : a function or platform whose kernel has no formula, more rows than inputs
    """
    expect_known("geometry", geometry, ("symbols", "numbers"))
    stack = stacked(task)
    names = tuple(row.name for row in stack.rows(robot))
    if len(names) > robot.n_u:
        has, few = f"{robot.name} has {robot.n_u} inputs", f"a task of at most {robot.n_u} rows"
        raise InputError(has, where="symbolic", expected=few, got=len(names))
    demanded = arguments is not None
    if arguments is None:
        every = [f for task in stack for f in (task.function, task.reference)]
        arguments = argument_names(robot, frames_of(every, robot)) if geometry == "symbols" else {}
    lengths = Geometry(Ring(BUDGET), arguments, demanded, geometry == "numbers", robot.q_names)
    with too_large_explained(robot, len(names), lengths.ring):
        analysis = assembled(robot, names, derived(robot, stack, lengths))
    if lengths.ring.branched:
        _check_branches(analysis, stack)
    return analysis


def _check_branches(analysis: SymbolicAnalysis, stack: Stack) -> None:
    """`InputError` when a kernel branches on the configuration and has other formulas elsewhere."""
    jacobians, functions = Jacobians((analysis.robot, stack)), analysis.functions()
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (_PLACES, analysis.robot.n)):
        try:
            J = jacobians.J(0.0, q)
        except SingularError:
            continue
        if not np.allclose(functions.J(q), J, rtol=_ROUNDED, atol=_ROUNDED * np.abs(J).max(initial=1.0)):
            problem = "one of the kernels branches on the configuration, and has no one formula"
            raise InputError(f"{problem} (the numeric analysis takes it)", where="symbolic")


def numeric_arguments(robot: Robot) -> dict[str, float]:
    """The xacro arguments that are numbers."""
    numbers = {}
    for name, text in robot.arguments.items():
        with suppress(ValueError):
            numbers[name] = float(text)
    return numbers


def argument_names(robot: Robot, frames: Iterable[str]) -> dict[str, str]:
    """The argument behind each length's label (`x_q2`), "-d" for the negative of d. As two arguments may be
    equal, the file is read once more with each changed by another share, and both values must agree. Computed
    lengths, and those of a robot that was not read from one xacro file, keep their labels."""
    from nmm.model.robots.loading import load

    numbers = numeric_arguments(robot)
    if not any(numbers.values()):
        return {}
    changed = {name: value * (1.0 + 0.001 * (1 + i)) for i, (name, value) in enumerate(numbers.items())}
    arguments = {**robot.arguments, **{name: repr(value) for name, value in changed.items()}}
    wheels = [wheel.joint for wheel in robot.wheels]
    try:
        other = load(robot.source, arguments=arguments, platform=robot.platform, wheels=wheels)
        pairs = [
            pair
            for frame in frames
            for pair in zip(_lengths(robot, frame), _lengths(other, frame), strict=True)
        ]
    except (NmmError, ValueError):  # mounted, of another file, or too narrow in what it takes
        return {}
    if any(label != same for (label, _), (same, _) in pairs):
        return {}
    signed = [(name, sign) for name in numbers for sign in (1, -1)]
    return {
        label: name if sign > 0 else f"-{name}"
        for (label, value), (_, after) in pairs
        for name, sign in signed
        if value and abs(value - sign * numbers[name]) < 1e-9 and abs(after - sign * changed[name]) < 1e-9
    }


def _lengths(robot: Robot, frame: str) -> Iterator[tuple[str, float]]:
    for step in steps_to(robot, frame):
        for axis, value in zip("xyz", step.translation, strict=True):
            yield f"{axis}_{step.label}", float(value)
