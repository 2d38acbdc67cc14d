"""info: a robot in tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any, cast

from nmm.cli.output import show_table, show_text
from nmm.cli.subjects import scenario_with
from nmm.errors import InputError
from nmm.robots.coordinates import UNLIMITED
from nmm.robots.wheel_rates import inputs_held_by, wheel_rates

if TYPE_CHECKING:
    from nmm.arrays import Array
    from nmm.control.controller import Controller
    from nmm.control.steering import Steered
    from nmm.robots.loading.provenance import Provenance
    from nmm.robots.robot import Robot
    from nmm.robots.wheel import Wheel


def describe_robot(source: str | None, scenario: str | None, **loading: Any) -> None:
    """Everything about a robot, or about a scenario's robot and task."""
    from nmm.robots.loading import load

    if source is None and scenario is None:
        raise InputError("expected ROBOT, a bundled name or a file, or --scenario SCENARIO, which has one")
    if source is None and any(loading[key] for key in ("platform", "axle", "package_dirs", "srdf")):
        raise InputError(
            "--platform, --axle, --package-dir and --srdf are for ROBOT, a scenario says its own"
        )
    given: Robot | None = None
    if source is not None:
        given = load(source, **{"missing_meshes": "skip", **loading})
    task = [("position in the plane", 2), ("position in space", 3), ("pose in space", 6)]
    without: Sequence[str] | None = None
    steered: Steered | None
    if scenario is not None:
        name, controller, q0 = _of_scenario(scenario, given, loading)
        from nmm.control.idle_inputs import inputs_without_effect

        given = controller.robot
        task, without = [(name, len(controller.rows))], inputs_without_effect(controller, q0)
        steered = controller.steered
    robot = cast("Robot", given)  # there is a source, or a scenario
    if scenario is None:
        from nmm.control.steering import Steering

        steered = Steering().on(robot, ())
    _show(robot, task)
    for name in without or ():
        if steered is None or name not in steered.inputs:
            show_text(f"{name} has no effect on the task: only the objective can use it")
    for line in () if steered is None else steered.described():
        show_text(line)
    if without == ():
        show_text("every input moves the task")
    _show_loading(robot)


def _of_scenario(name: str, robot: Robot | None, loading: Mapping[str, Any]) -> tuple[str, Controller, Array]:
    """A scenario's name, its controller (on another robot, if one is given), and its start."""
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
            raise InputError(
                f"scenario {name} does not fit robot {robot.name}: {key}: {error.text}"
            ) from None
    try:
        q0 = controller.robot.q(scenario.parts.q0)
    except InputError:
        q0 = controller.robot.q()  # the start is the other robot's
    return scenario.name, controller, q0


def _show(robot: Robot, tasks: Sequence[tuple[str, int]]) -> None:
    show_text(f"{robot.name} ({robot.source}), {robot.platform.name} platform")
    show_text()
    show_table(
        ["coordinate", "unit", "of", "lower", "upper"], _coordinates(robot), numeric=["lower", "upper"]
    )
    show_text()
    show_table(["input", "unit", "of", "limit"], _inputs(robot), numeric=["limit"])
    show_text()
    for name, inputs in robot.groups.items():
        show_text(f"group {name}: {', '.join(inputs) or 'none'}")
    for name, values in robot.postures.items():
        show_text(f"posture {name}: {', '.join(f'{joint} {value:.4g}' for joint, value in values.items())}")
    show_text(f"frames: {', '.join(robot.frames)}")
    for name, value in robot.platform.described().items():
        show_text(f"platform {name}: {value}")
    show_text()
    if robot.wheels:
        known, _ = wheel_rates(robot)
        show_table(
            ["wheel", "radius", "limit", "on", "swivels on", "rollers", "centre there"],
            [_wheel(wheel, kept=wheel.joint in known) for wheel in robot.wheels],
            numeric=["radius"],
        )
        show_text()
    columns = ["task", "rows", "static redundancy", "kinematic redundancy"]
    show_table(columns, _redundancies(robot, tasks), numeric=columns[1:])


def _coordinates(robot: Robot) -> Iterator[list[str]]:
    n_p = robot.platform.n_p
    for i, (name, unit, (lower, upper)) in enumerate(
        zip(robot.q_names, robot.q_units, robot.q_limits, strict=True)
    ):
        of = "platform" if i < n_p else _arm(robot, name)
        yield [name, unit, of, _limit(float(lower)), _limit(float(upper))]


def _inputs(robot: Robot) -> Iterator[list[str]]:
    held = inputs_held_by(robot, [wheel.joint for wheel in robot.wheels if isfinite(wheel.velocity)])
    for i, (name, unit, limit) in enumerate(zip(robot.u_names, robot.u_units, robot.u_limits, strict=True)):
        of = "platform" if i < robot.platform.p else _arm(robot, name)
        yield [
            name,
            unit,
            of,
            "by its wheels" if name in held and not isfinite(limit) else _limit(float(limit)),
        ]


def _arm(robot: Robot, joint: str) -> str:
    """The arm that a joint is part of."""
    return next((name for name, joints in robot.arms.items() if joint in joints), "arm")


def _limit(value: float) -> str:
    return f"{value + 0.0:.4g}" if isfinite(value) and abs(value) < UNLIMITED else "-"  # no -0


def _wheel(wheel: Wheel, *, kept: bool) -> list[str]:
    limit = f"{wheel.velocity:.4g} rad/s" if isfinite(wheel.velocity) else "-"
    return [
        wheel.joint,
        f"{wheel.radius:g} m",
        limit if kept or limit == "-" else f"{limit}, not kept",
        "the root's body" if wheel.carrier == "theta" else wheel.carrier,
        wheel.swivel or "-",
        f"{degrees(wheel.roller):g}°" if wheel.roller else "-",
        f"({', '.join(f'{c:.4g}' for c in wheel.center)}) m",
    ]


def _redundancies(robot: Robot, tasks: Sequence[tuple[str, int]]) -> Iterator[list[str]]:
    for name, s in tasks:
        counts = (robot.n_independent, robot.n_u)
        yield [name, str(s), *(str(count - s) if count >= s else "-" for count in counts)]


def _show_loading(robot: Robot) -> None:
    """What loading found and did."""
    from nmm.robots.loading.provenance import CHOSEN, provenance_of

    made = provenance_of(robot)
    lines = [f"note: {note}" for note in robot.notes]
    if made.platform in CHOSEN:
        lines.insert(0, f"platform: {robot.platform.name}, {CHOSEN[made.platform]}")
    lines += [f"prefix of {arm}: {prefix}" for arm, prefix in made.prefixed.items()]
    lines += [f"SRDF: {file}" for file in robot.semantics.files]
    lines += _files(made)
    if lines:
        show_text()
    for line in lines:
        show_text(line)


def _files(made: Provenance) -> Iterator[str]:
    """Meshes and packages."""
    missing = [name for name, file in made.meshes.items() if file is None]
    if made.meshes:
        yield f"meshes: {len(made.meshes) - len(missing)} of {len(made.meshes)} found"
    yield from (f"mesh not found: {name}" for name in missing)
    yield from (f"package {name}: {folder}" for name, folder in made.packages.items() if folder is not None)
    lost = [name for name, folder in made.packages.items() if folder is None]
    if lost:
        looked = ", ".join(dict.fromkeys(map(str, made.searched)))
        yield f"package not found: {', '.join(lost)}; looked in {looked}"
