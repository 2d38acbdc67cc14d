"""info: a robot in tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import degrees, isfinite
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, few
from nmm.cli.groups import Loading, command
from nmm.cli.options import ARGUMENT, ROBOT_HELP, arguments_of, option
from nmm.cli.output import WIDTH_OF_A_PIPE, show_table, show_text

if TYPE_CHECKING:
    from nmm.base.arrays import Array
    from nmm.control.controller import Controller
    from nmm.model.robots.robot import Robot
    from nmm.model.robots.wheel import Wheel

#: More frames than these, and those that need more than a line, are listed in a table.
_FRAMES_IN_A_LINE = 30


@command
def info(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="ROBOT",
            help=f"{ROBOT_HELP} Not needed with --scenario, which has one.",
            show_default=False,
        ),
    ] = None,
    *,
    scenario: str | None = option(
        "SCENARIO", "Show the redundancy for this scenario's task, and the inputs without effect on it."
    ),
    arguments: list[str] | None = ARGUMENT,
    loading: Loading,
) -> None:
    """Describe a robot.

    Coordinates, inputs and limits with their units, groups of inputs, frames that a task may speak of, the
    platform with its parameters, wheels, the degree of redundancy for tasks of 2, 3 and 6 rows or for a
    scenario's task, what loading did to the file, meshes and packages.

    \b
    nmm info unicycle_2r
    nmm info my_robot.urdf --platform car --lock torso=0.2 --lock head=pi/6
    nmm info my_robot.urdf --axle -0.1,0 --package-dir ~/ros/src
    nmm info my_robot.urdf.xacro -a arm=true --package-dir my_robot_description=~/robots/mine
    nmm info --scenario unicycle_3r_position
    """
    from nmm.control.steering import Steering
    from nmm.control.step.idle_inputs import inputs_without_effect
    from nmm.model.robots.loading import load

    keywords, texts = loading.keywords(), arguments_of(arguments)
    loaded = None
    if robot is not None:
        loaded = load(robot, arguments=texts, **{"missing_meshes": "skip", **keywords})
    without: Sequence[str] | None = None
    if scenario is not None:
        own = [*(keywords[key] for key in ("platform", "axle", "package_dirs", "srdf")), texts]
        if loaded is None and any(own):
            what = "they are for ROBOT, a scenario has its own"
            raise InputError(what, where="--platform, --axle, --package-dir, --srdf, --set")
        name, controller, q0 = _of_scenario(scenario, loaded, keywords)
        without = inputs_without_effect(controller.solver, q0)
        shown, tasks, steered = controller.robot, [(name, len(controller.rows))], controller.steered
    elif loaded is not None:
        tasks = [("position in the plane", 2), ("position in space", 3), ("pose in space", 6)]
        shown, steered = loaded, Steering().on(loaded, ())
    else:
        raise InputError(expected="ROBOT, a bundled name or a file, or --scenario SCENARIO, which has one")
    _show(shown, tasks)
    for name in without or ():
        if steered is None or name not in steered.inputs:
            show_text(f"{name} has no effect on the task: only the objective can use it")
    for line in () if steered is None else steered.described():
        show_text(line)
    if without == ():
        show_text("every input moves the task")
    _show_loading(shown)


def _of_scenario(name: str, robot: Robot | None, loading: Mapping[str, Any]) -> tuple[str, Controller, Array]:
    from nmm.cli.subjects import scenario_with
    from nmm.scenario import Scenario
    from nmm.scenario.keys import KeyedError

    scenario = Scenario.load(name)
    if robot is None:
        scenario = scenario_with(scenario, loading)
        controller = scenario.controller()
    else:
        try:
            controller = scenario.parts.build(robot, scenario.absolute)
        except KeyedError as error:
            key = ".".join(map(str, error.place))
            raise InputError(f"scenario {name} does not fit robot {robot.name}: {key}: {error}") from None
    try:
        q0 = controller.robot.q(scenario.parts.q0)
    except InputError:
        q0 = controller.robot.q()  # the start is the other robot's
    return scenario.name, controller, q0


def _show(robot: Robot, tasks: Sequence[tuple[str, int]]) -> None:
    from nmm.model.robots.wheel_rates import wheel_rates

    show_text(f"{robot.name} ({robot.source}), {robot.platform.name} platform")
    show_text()
    show_table(
        ["coordinate", "unit", "of", "lower", "upper"], _coordinates(robot), numeric=["lower", "upper"]
    )
    show_text()
    show_table(["input", "unit", "of", "limit"], _inputs(robot), numeric=["limit"])
    show_text()
    for name, inputs in robot.groups.items():
        show_text(f"group {name}: {few(inputs)}")
    for name, values in robot.postures.items():
        show_text(f"posture {name}: {few([f'{joint} {value:.4g}' for joint, value in values.items()])}")
    frames = f"frames: {', '.join(robot.frames)}"
    if len(robot.frames) <= _FRAMES_IN_A_LINE and len(frames) <= WIDTH_OF_A_PIPE:
        show_text(frames)
    else:
        joints = {name: robot.model.frames[robot.frame_id(name)].parentJoint for name in robot.frames}
        moved = [[name, str(robot.model.names[joint]) if joint else "-"] for name, joint in joints.items()]
        show_table(["frame", "moved by"], moved)
    for name, value in robot.platform.described().items():
        show_text(f"platform {name}: {value}")
    show_text()
    if robot.wheels:
        known, _ = wheel_rates(robot)
        show_table(
            ["wheel", "radius", "limit", "on", "swivels on", "rollers", "centre there"],
            [_wheel(wheel, enforced=wheel.joint in known) for wheel in robot.wheels],
            numeric=["radius"],
        )
        show_text()
    columns, rows = ["task", "rows", "static redundancy", "kinematic redundancy"], []
    for name, s in tasks:
        counts = robot.n_independent, robot.n_u
        rows.append([name, str(s), *(str(count - s) if count >= s else "-" for count in counts)])
    show_table(columns, rows, numeric=columns[1:])


def _coordinates(robot: Robot) -> Iterator[list[str]]:
    n_p = robot.platform.n_p
    for i, (name, unit, (lower, upper)) in enumerate(
        zip(robot.q_names, robot.q_units, robot.q_limits, strict=True)
    ):
        of = "platform" if i < n_p else _arm(robot, name)
        yield [name, unit, of, _limit(float(lower)), _limit(float(upper))]


def _inputs(robot: Robot) -> Iterator[list[str]]:
    from nmm.model.robots.wheel_rates import inputs_held_by

    held = inputs_held_by(robot, [wheel.joint for wheel in robot.wheels if isfinite(wheel.velocity)])
    for i, (name, unit, limit) in enumerate(zip(robot.u_names, robot.u_units, robot.u_limits, strict=True)):
        of = "platform" if i < robot.platform.p else _arm(robot, name)
        by_wheels = name in held and not isfinite(limit)
        yield [name, unit, of, "by its wheels" if by_wheels else _limit(float(limit))]


def _arm(robot: Robot, joint: str) -> str:
    return next((name for name, joints in robot.arms.items() if joint in joints), "arm")


def _limit(value: float) -> str:
    from nmm.model.robots.coordinates import UNLIMITED

    return f"{value + 0.0:.4g}" if isfinite(value) and abs(value) < UNLIMITED else "-"  # no -0


def _wheel(wheel: Wheel, *, enforced: bool) -> list[str]:
    limit = f"{wheel.velocity:.4g} rad/s" if isfinite(wheel.velocity) else "-"
    return [
        wheel.joint,
        f"{wheel.radius:g} m",
        limit if enforced or limit == "-" else f"{limit}, not kept",
        "the root's body" if wheel.carrier == "theta" else wheel.carrier,
        wheel.swivel or "-",
        f"{degrees(wheel.roller):g}°" if wheel.roller else "-",
        f"({', '.join(f'{c:.4g}' for c in wheel.center)}) m",
    ]


def _show_loading(robot: Robot) -> None:
    from nmm.model.robots.loading.provenance import PLATFORM_SOURCES, provenance_of

    made = provenance_of(robot)
    lines = [f"note: {note}" for note in robot.notes]
    if made.platform in PLATFORM_SOURCES:
        lines.insert(0, f"platform: {robot.platform.name}, {PLATFORM_SOURCES[made.platform]}")
    lines += [f"prefix of {arm}: {prefix}" for arm, prefix in made.prefixed.items()]
    lines += [f"SRDF: {file}" for file in robot.semantics.files]
    missing = [name for name, file in made.meshes.items() if file is None]
    if made.meshes:
        lines.append(f"meshes: {len(made.meshes) - len(missing)} of {len(made.meshes)} found")
    if missing:
        lines.append(f"meshes not found: {few(missing)}")
    lines += [f"package {name}: {folder}" for name, folder in made.packages.items() if folder is not None]
    lost = [name for name, folder in made.packages.items() if folder is None]
    if lost:
        looked = ", ".join(dict.fromkeys(map(str, made.searched)))  # whole: they are to be checked
        lines.append(f"package not found: {few(lost)}; looked in {looked}")
    if lines:
        show_text()
    for line in lines:
        show_text(line)
