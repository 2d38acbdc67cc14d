"""What an analysis is about: a robot with a task, a scenario, or a run, and the configuration asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.arrays import Array, interpolated, scalar
from nmm.cli.options import arguments_of, settings_of, values_of
from nmm.cli.output import warn
from nmm.errors import InputError, unknown

if TYPE_CHECKING:
    from nmm.analysis.singular.jacobians import Subject
    from nmm.control.controller import Controller
    from nmm.functions.function import Function
    from nmm.functions.tasks import Stack, Task
    from nmm.robots.robot import Robot
    from nmm.runs.trajectory import Trajectory
    from nmm.scenario import Scenario

#: Options by the arguments of `nmm.load`.
_OPTIONS = {
    "platform": "--platform",
    "lock": "--lock",
    "wheels": "--wheels",
    "missing_meshes": "--missing-meshes",
    "axle": "--axle",
    "package_dirs": "--package-dir",
    "srdf": "--srdf",
}
#: Those that a scenario's robot takes, too.
_OF_SCENARIO = ("lock", "wheels", "missing_meshes")


@dataclass(frozen=True, eq=False)
class Studied:
    """What a command analyses.

    Attributes
    ----------
    name : the robot's or the scenario's
    robot : the robot
    task : its task; a bare function where no target was said
    controller : the scenario's, with its resolver and added task; None for a robot, or with another task
    q (n,) : where; the scenario's start, the run's, or the configuration nearest to zero
    t : s
    trajectory : the run, for a run's folder
    scenario : the scenario, or the run's
    """

    name: str
    robot: Robot
    task: Stack | tuple[Task | Function, ...]
    controller: Controller | None
    q: Array
    t: float = 0.0
    trajectory: Trajectory | None = None
    scenario: Scenario | None = None

    @property
    def subject(self) -> Subject:
        """As `nmm.analysis` takes it."""
        return self.controller if self.controller is not None else (self.robot, self.task)


def studied(
    source: str,
    *,
    tasks: Sequence[str] | None,
    at: Sequence[str] | None = None,
    t: float | None = None,
    settings: Sequence[str] | None = None,
    usual_task: str = "",
    decide: bool = True,
    **loading: Any,
) -> Studied:
    """What SOURCE means: a run's folder, a scenario by name or as YAML file, or else a robot.

    Parameters
    ----------
    tasks : texts of `--task`; those of the scenario when there are none
    at : COORDINATE=VALUE of `--at`, m and rad
    t : s; 0, or the run's first instant. Of a run, q is where it was then
    settings : `--set`, of the robot's xacro arguments or of the scenario's keys
    usual_task : a robot's, where there is no other; none when empty
    decide : where tasks come and go, whether to look at those active there and tell the others
    loading : platform, lock, axle, package_dirs of `nmm.load`; a robot's only

    Raises
    ------
    InputError : nothing of that name, options that do not fit it, a robot without a task
    """
    from nmm.scenario.short_task import short_task

    run, scenario, loaded = opened(source, settings, loading)
    own = None if scenario is None else scenario.controller()
    robot = loaded if own is None else own.robot
    if own is None and usual_task:
        tasks = tasks or (usual_task,)
    given = tuple(short_task(text, robot) for text in tasks or ())
    if not given and own is None:
        what = "a robot" if run is None else "a run without a scenario"
        raise InputError(
            f"{source} is {what}: expected --task, as in --task position, --task position:FRAME:xy, "
            "--task pose:FRAME (may be repeated)"
        )
    q = _start(robot, run, scenario) if t is None or run is None else _then(run, t)
    q = configuration_at(robot, q, at, loading.get("lock") or {})
    first = 0.0 if run is None or not len(run) else float(run.t[0])
    if not given and own is not None and decide:
        _decide(own, first if t is None else t, q)
    return Studied(
        name=robot.name if scenario is None else scenario.name,
        robot=robot,
        task=given if given or own is None else own.task,
        controller=None if given else own,
        q=q,
        t=first if t is None else t,
        trajectory=run,
        scenario=scenario,
    )


def scenario_with(scenario: Scenario, loading: Mapping[str, Any]) -> Scenario:
    """The scenario with `lock`, `wheels` and `missing_meshes` of `nmm.load` for its robot, where given.

    Raises
    ------
    InputError : its robot is mounted from several
    """
    from nmm.scenario.robot import RobotPart

    robot, given = scenario.parts.robot, {key: loading[key] for key in _OF_SCENARIO if key in loading}
    if not given:
        return scenario
    if not isinstance(robot, RobotPart):
        raise InputError(
            f"{', '.join(_OPTIONS[key] for key in given)}: the robot of {scenario.name} is mounted from "
            "several: say of which, as in --set robot.arm.lock.JOINT=VALUE"
        )
    if "lock" in given:
        given["lock"] = {**robot.lock, **given["lock"]}
    return scenario.with_settings({f"robot.{key}": value for key, value in given.items()})


def configuration_at(robot: Robot, q: Array, at: Sequence[str] | None, locked: Mapping[str, float]) -> Array:
    """q (n,) with what `--at` says, COORDINATE=VALUE, m and rad; `InputError` for what is no coordinate."""
    q = q.copy()
    for name, value in coordinates_at(robot, at).items():
        if name in locked:
            raise InputError(f"--at: {name} is locked, and no coordinate then")
        q[robot.coordinate(name)] = scalar(value, f"--at: {name}")
    return q


def coordinates_at(robot: Robot, at: Sequence[str] | None) -> dict[str, float]:
    """What `--at` says by coordinate, m and rad; posture=NAME, one of the SRDF's, says several."""
    from nmm.robots.semantics import POSTURE

    named = [text for text in at or () if text.partition("=")[0].strip() == POSTURE not in robot.q_names]
    numbers = [text for text in at or () if text not in named]
    values = values_of(numbers, "--at", "COORDINATE=VALUE, as in q1=pi/2, or posture=NAME")
    postures = [text.partition("=")[2].strip() for text in named]
    return robot.postures.within({POSTURE: postures, **values}) if postures else values


def _decide(controller: Controller, t: float, q: Array) -> None:
    """Of tasks that come and go, those active at t (s) and q (n,) are looked at; the others are told."""
    from nmm.control.sequenced import SequencedController
    from nmm.words import listed

    if not isinstance(controller, SequencedController):
        return
    controller.changes(t, q)
    controller.switch()
    names, active = controller.sequence.names, controller.moment.active
    off = [name for name, on in zip(names, active, strict=True) if not on]
    if off:
        seen = listed([name for name, on in zip(names, active, strict=True) if on]) or "no task"
        warn(
            f"tasks come and go: this is about {seen}, active there at t = {t:g} s, "
            f"and not about {listed(off)}"
        )


def is_scenario(source: str) -> bool:
    """Whether SOURCE is a scenario's name or a YAML file."""
    from nmm.bundled import bundled_scenarios
    from nmm.scenario.scenario import SUFFIXES

    return source in bundled_scenarios() or Path(source).expanduser().suffix in SUFFIXES


def opened(
    source: str, settings: Sequence[str] | None, loading: dict[str, Any]
) -> tuple[Trajectory | None, Scenario | None, Robot]:
    """The run, the scenario and the robot of SOURCE; run and scenario where it is one."""
    from nmm.bundled import bundled_robots, bundled_scenarios
    from nmm.robots.loading import load
    from nmm.runs.trajectory import Trajectory
    from nmm.scenario import Scenario

    path = Path(source).expanduser()
    of_scenario = is_scenario(source)
    of_folder = bool(source) and path.is_dir() and not of_scenario and source not in bundled_robots()
    if of_folder:
        _check_folder(source, path)
    elif not of_scenario:
        if source not in bundled_robots() and not path.suffix and "/" not in source:
            names = [*bundled_robots(), *bundled_scenarios()]
            raise InputError(unknown("robot or scenario", source, names) + "; or give a path")
        return None, None, load(source, arguments=arguments_of(settings), **loading)
    allowed = _OF_SCENARIO if of_scenario else ()
    wrong = [_OPTIONS[key] for key, value in loading.items() if value and key not in allowed]
    if wrong:
        raise InputError(f"{', '.join(wrong)}: of a robot's file; {source} has a robot of its own")
    if of_scenario:
        scenario = scenario_with(Scenario.load(source, settings_of(settings)), loading)
        for warning in scenario.warnings:
            warn(warning)
        return None, scenario, scenario.robot()
    if settings:
        raise InputError(f"--set: expected a robot or a scenario; {source} is a run, which is as it was")
    run = Trajectory.load(path)
    if not len(run):
        raise InputError(f"{source}: expected a run with at least one sample")
    file = path / "scenario.yaml"
    return run, Scenario.load(file) if file.exists() else None, run.robot


def _check_folder(source: str, path: Path) -> None:
    """`InputError` for a folder that is no run's; it names the runs inside, which `nmm compare` leaves."""
    from nmm.folders.run import is_run

    if is_run(path):
        return
    inside = sorted(folder.name for folder in path.iterdir() if folder.is_dir() and is_run(folder))
    what = f"another folder, which holds the runs {', '.join(inside)}" if inside else "another folder"
    raise InputError(f"{source}: expected a robot, a scenario or a run's folder, this is {what}")


def _then(run: Trajectory, t: float) -> Array:
    """q (n,) of a run at an instant, linear between its samples."""
    if not run.t[0] <= t <= run.t[-1]:
        raise InputError(
            f"--time: expected an instant of the run, {run.t[0]:g} to {run.t[-1]:g} s, got {t:g}"
        )
    return interpolated(t, run.t, run.q)


def _start(robot: Robot, run: Trajectory | None, scenario: Scenario | None) -> Array:
    if run is not None:
        return run.q[0].copy()
    return robot.rest.copy() if scenario is None else robot.q(scenario.parts.q0)
