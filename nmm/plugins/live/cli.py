"""play, render, view and drive: runs and robots, seen in a browser or as a video."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, expect
from nmm.cli.groups import Browser, EllipsoidGroup, Loading, Subject, command, opening_command
from nmm.cli.options import (
    ARM,
    AT,
    ROBOT_HELP,
    SUBJECT_SET,
    arguments_of,
    flag,
    option,
    size_of,
    task_option,
    values_of,
)
from nmm.cli.output import progress, show_text, warn

if TYPE_CHECKING:
    from nmm.control.functions.function import Function
    from nmm.control.functions.tasks import Task
    from nmm.model.robots.motion import Motion
    from nmm.model.robots.robot import Robot
    from nmm.motion.trajectory import Trajectory
    from nmm.plugins.live.driving.setups import DriveSetup
    from nmm.scenario import Scenario

RunFolder = Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A folder of `nmm run` or `nmm compare`.")]


@opening_command
def play(folder: RunFolder, browser: Browser, ellipsoids: EllipsoidGroup) -> None:
    """Play a run in the browser.

    In 3D, with MeshCat; only this machine can reach it. Ctrl-C ends it.
    """
    from nmm.views.playback import play as play_runs

    drawn = ellipsoids.wanted()
    play_runs(runs_in(folder), **browser.keywords(), ellipsoids=drawn)


@opening_command
def render(
    folder: RunFolder,
    video: Path = option("FILE", "Ends in .mp4, .webm or .gif.", default=...),
    *,
    size: str = option("WxH", "Of a picture, px.", default="1280x720"),
    view: str = option("FROM", "iso, top, front or wall.", default="iso"),
    fps: float = option("N", "Pictures a second.", default=30.0),
    speed: float = option("X", "2 shows the motion twice as fast.", default=1.0),
    start: float | None = option("S", "First instant, s.", "--from", show="the first"),
    end: float | None = option("S", "Last instant, s.", "--to", show="the last"),
    follow: bool = flag("--follow", "The camera goes with the robots."),
    plots: bool = flag("--plots", "The curves are beside the robot."),
    apart: float = option("SHARE", "Compared robots over one another (0) or side by side (1).", default=0.0),
    ellipsoids: EllipsoidGroup,
) -> None:
    """Make a video of a run.

    Picture by picture through Chromium without a window, and ffmpeg (pip install imageio-ffmpeg).

    \b
    nmm render runs/unicycle_2r_position-rg --video motion.mp4
    nmm render runs/unicycle_2r_position-compare --video apart.gif --size 640x400 --fps 12 --apart 1
    """
    from nmm.plugins.live.rendering import render as render_runs

    drawn = ellipsoids.wanted()
    sides = size_of(size)
    runs = runs_in(folder)
    with progress(video.name) as report:
        render_runs(
            runs, video, size=sides, view=view, fps=fps, speed=speed, start=start,
            end=end, follow=follow, plots=plots, apart=apart, ellipsoids=drawn, progress=report,
        )  # fmt: skip
    show_text(f"written: {video}")


def runs_in(folder: Path) -> list[Trajectory]:
    """The run of a folder, or those of a comparison, that have samples; `InputError` for none."""
    from nmm.motion.trajectory import Trajectory
    from nmm.views.folders import comparison
    from nmm.views.folders.whole import steady

    def read() -> list[Trajectory]:
        folders = comparison.runs_of(folder) if comparison.is_comparison(folder) else [folder]
        return [trajectory for trajectory in (Trajectory.load(path) for path in folders) if len(trajectory)]

    runs = steady(folder, read)
    expect(runs, folder, "a run with at least one sample")
    return runs


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
    arm: str | None = ARM,
    loading: Loading,
    browser: Browser,
    frames: bool = flag(
        "--frames/--no-frames", "Show frames at first; the page can change it.", default=True
    ),
    task: list[str] | None = task_option("none"),
    at: list[str] | None = AT,
    settings: list[str] | None = SUBJECT_SET,
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
    from nmm.cli.subjects import configuration_at, is_scenario, opened
    from nmm.scenario.short_task import short_task
    from nmm.views.playback import view as show

    keywords = loading.keywords()
    tasks: list[Task | Function] | None = None
    beside: Motion | None = None
    if arm is not None:
        at, robot = _with_arm(subject, arm, at, settings, keywords)
        q = robot.rest
    else:
        skip = {} if is_scenario(subject) else {"missing_meshes": "skip"}
        run, scenario, robot = opened(subject, settings, {**skip, **keywords})
        if run is not None:
            what = f"is a run; nmm play {subject} shows it"
            raise InputError(what, where=subject, expected="a robot or a scenario")
        q = robot.rest
        if scenario is not None:
            from nmm.plugins.live.viewer import asked_for

            beside = asked_for(scenario, robot)
            q, tasks = beside.q[0], _viewable(scenario, robot)
    for note in robot.notes:
        if note.code == "shapes_left_out":
            warn(str(note))
    if task:
        tasks = [short_task(text, robot) for text in task]
    q = configuration_at(robot, q, at, keywords.get("lock") or {})
    robot.check_limits(q)
    show(robot, q, frames=frames, task=tasks, beside=beside, **browser.keywords())


def _with_arm(
    source: str,
    arm: str,
    at: Sequence[str] | None,
    settings: Sequence[str] | None,
    loading: Mapping[str, Any],
) -> tuple[list[str], Robot]:
    """The coordinates of `--at`, and the robot; an `--at` without = names the frame that carries the arm."""
    from nmm.cli.subjects import is_scenario
    from nmm.scenario.scaffold.parts import chosen_robot

    if is_scenario(source):
        what = f"{source} is a scenario, which has one"
        raise InputError(what, where="--arm", expected="a robot beside it")
    frames = [text for text in at or () if "=" not in text]
    expect(len(frames) < 2, "--at", "one frame that carries the arm", frames)
    values = [text for text in at or () if "=" in text]
    frame = frames[0] if frames else None
    chosen = chosen_robot(source, Path(), arm=arm, at=frame, arguments=arguments_of(settings), **loading)
    return values, chosen.robot


def _viewable(scenario: Scenario, robot: Robot) -> list[Task | Function] | None:
    """The scenario's tasks; None, and a warning, where they have more rows than there are inputs."""
    tasks: list[Task | Function] = [*scenario.controller().task]
    rows = sum(len(task.rows(robot)) for task in tasks)
    if rows <= robot.n_u:
        return tasks
    warn(f"no numbers of its tasks: {rows} rows for {robot.n_u} inputs; --task shows some of them")
    return None


@command
def drive(
    subject: Subject,
    browser: Browser,
    loading: Loading,
    jog_speed: list[str] | None = option(
        "NAME=VALUE",
        "Of what one jogs with full keys or sticks: linear (m/s) and angular (rad/s) of the hand, or an "
        "input of the platform by its name. May be repeated.",
        "--jog-speed",
        show="0.25 m/s and 0.5 rad/s; half the robot's limit where that is less",
    ),
) -> None:
    """Drag a target in the browser; the robot follows.

    In 3D, with MeshCat, and with its curves: the target of each task is dragged, typed, or moved with keys;
    while J is held, or a button of a gamepad or a SpaceMouse, these move hand or base. Resolver, gains,
    weights and limits are changed while it moves. A scenario's references are left aside, but for where they
    begin; a robot holds its arm's end where it is at first. With the button Plan, or the key N, the robot
    follows plans to the target, round what is in the way (docs/plans.md). Only this machine can reach it.
    Ctrl-C ends it.

    \b
    nmm drive unicycle_3r_position
    nmm drive behind_the_wall
    nmm drive tiago_pose --jog-speed linear=0.1 --jog-speed v=0.3
    nmm drive my_robot.urdf --platform car --task position:gripper:xyz --at shoulder=pi/4
    """
    from nmm.cli.subjects import studied
    from nmm.plugins.live.driving import RobotSetup, ScenarioSetup
    from nmm.plugins.live.driving import drive as drive_in_browser

    speeds = values_of(jog_speed, "--jog-speed", "NAME=VALUE, as in linear=0.1")
    asked = subject.keywords() | loading.keywords()
    study = studied(subject.subject, to_drive=True, **asked)
    setup: DriveSetup
    if study.controller is None or study.scenario is None:
        study.robot.check_limits(study.q)
        setup = RobotSetup(study.robot, tuple(study.task), study.q)
    else:
        setup = ScenarioSetup(study.scenario, study.q)
    drive_in_browser(setup, jog_speeds=speeds, **browser.keywords())
