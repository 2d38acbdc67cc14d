"""The commands about robots and about what is bundled, with their options and their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.groups import Browser, Loading, Subject, command
from nmm.cli.options import (
    ROBOT_HELP,
    ArgumentOption,
    ArmOption,
    AtOption,
    SubjectSetOption,
    ViewedTaskOption,
    arguments_of,
)


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
    scenario: Annotated[
        str | None,
        typer.Option(
            metavar="SCENARIO",
            help="Show the redundancy for this scenario's task, and the inputs without effect on it.",
        ),
    ] = None,
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
    nmm info --scenario unicycle_3r_position
    """
    from nmm.cli.descriptions import describe_robot

    describe_robot(robot, scenario, **loading.keywords())


@command
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help=ROBOT_HELP)],
    arguments: ArgumentOption = None,
    *,
    loading: Loading,
) -> int:
    """Say everything that is wrong with a robot's file.

    Each problem on a line of its own, with the line of the file; then warnings: what nmm takes, but hardly
    was meant, and what it takes only with an option. A file without problems is loaded, to prove it.

    \b
    nmm check my_robot.urdf
    nmm check my_robot.urdf.xacro -a arm=true --package-dir ~/ros/src
    nmm check my_robot.urdf --lock '*finger*=0' --wheels left_drive=0.1,right_drive=0.1

    The lines of a xacro file's problems are those of the text that xacro makes of it. Exit status 2 when
    there are problems.
    """
    from nmm.cli.checking import check_file

    return check_file(file, arguments_of(arguments), **loading.keywords())


@command
def view(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|SCENARIO",
            help=f"{ROBOT_HELP} Or a scenario, whose robot is shown where it starts.",
            show_default=False,
        ),
    ],
    *,
    arm: ArmOption = None,
    loading: Loading,
    browser: Browser,
    frames: Annotated[
        bool, typer.Option("--frames/--no-frames", help="Show frames at first; the page can change it.")
    ] = True,
    task: ViewedTaskOption = None,
    at: AtOption = None,
    settings: SubjectSetOption = None,
) -> None:
    """Look at a robot in the browser.

    In 3D, with MeshCat: a slider for each coordinate, frames with their names, and the pose of one of them
    in numbers. With --task what the robot can do for it where the sliders are: singular values of J, wheels
    and all, manipulability, ellipsoids, and the directions that are lost. Of a
    scenario its robot at the start, its task, the desired path or target, and its obstacles. With --arm,
    --lock and --srdf are the arm's, and --at without = is the frame that carries it. Only this machine can
    reach it. Ctrl-C ends it.

    \b
    nmm view unicycle_3r
    nmm view unicycle_3r_obstacles
    nmm view car_base --arm small_arm --at arm_mount --at q1=0.3
    nmm view unicycle_3r --task position --at q2=pi/3
    nmm view my_robot.urdf --platform car --lock head=0.3 --no-frames
    """
    from nmm.cli.viewing import view_subject

    view_subject(
        subject,
        **loading.keywords(),
        **browser.keywords(),
        arm=arm,
        frames=frames,
        tasks=task,
        at=at,
        settings=settings,
    )


@command
def drive(subject: Subject, browser: Browser, loading: Loading) -> None:
    """Drag a target in the browser; the robot follows.

    In 3D, with MeshCat, and with its curves: the target of each task is dragged, typed, or moved with keys
    or a gamepad. Resolver, gains, weights and limits are changed while it moves. A scenario's references are
    left aside, but for where they begin; a robot holds its arm's end where it is at first. Only this machine
    can reach it. Ctrl-C ends it.

    \b
    nmm drive unicycle_3r_position
    nmm drive tiago_pose
    nmm drive my_robot.urdf --platform car --task position:gripper:xyz --at shoulder=pi/4
    """
    from nmm.cli.driving import drive_subject

    drive_subject(subject.subject, **subject.keywords(), **browser.keywords(), **loading.keywords())


@command
def init(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help=ROBOT_HELP)],
    *,
    arm: ArmOption = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="FRAME",
            help="The robot's frame that carries the arm.",
            show_default="mount, arm_mount or top",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where to write; never over a file.", show_default="<robot>.yaml"),
    ] = None,
    settings: ArgumentOption = None,
    loading: Loading,
) -> None:
    """Write a first scenario for a robot.

    A YAML file with a word on every key: the end of the longest arm is led along a gentle path, from a start
    within limits and away from singularities (a posture of the robot's SRDF, if one will do), with a
    resolver that fits. It has been run before it is written, and runs as it stands. What has no wheels is put
    on a bundled base. With --arm, --lock and --srdf are the arm's.

    \b
    nmm init my_robot.urdf && nmm run my_robot.yaml --play
    nmm init my_arm.urdf --out scenarios/first.yaml
    nmm init car_base --arm my_arm.urdf --at arm_mount
    nmm init my_arm.urdf --platform fixed
    """
    from nmm.cli.starting import write_first_scenario

    write_first_scenario(
        robot, arm=arm, at=at, out=out, arguments=arguments_of(settings), **loading.keywords()
    )


def scenarios(
    keys: Annotated[bool, typer.Option("--keys", help="List the keys of a scenario file instead.")] = False,
) -> None:
    """List the bundled scenarios.

    They are YAML files; to make your own, start from the scenario.yaml that a run writes.
    """
    from nmm.cli.listings import list_keys, list_scenarios

    (list_keys if keys else list_scenarios)()


def robots() -> None:
    """List the bundled robots: whole ones, bases and arms."""
    from nmm.cli.listings import list_robots

    list_robots()
