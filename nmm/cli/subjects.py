"""What an analysis is about: a robot with a task, a scenario, or a run, and the configuration asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.base.arrays import Array, interpolated, scalar
from nmm.base.errors import InputError, expect, no_such
from nmm.cli.options import arguments_of, settings_of, values_of
from nmm.cli.output import warn

if TYPE_CHECKING:
    from nmm.analysis.singular.jacobians import Subject
    from nmm.control.controller import Controller
    from nmm.control.functions.function import Function
    from nmm.control.functions.tasks import Stack, Task
    from nmm.model.robots.robot import Robot
    from nmm.motion.trajectory import Trajectory
    from nmm.scenario import Scenario

#: The arguments of `nmm.load` that a scenario's robot takes, too.
_OF_SCENARIO = ("lock", "wheels", "calibration", "missing_meshes")


@dataclass(frozen=True, eq=False)
class Studied:
    name: str  #: the robot's or the scenario's
    robot: Robot
    task: Stack | tuple[Task | Function, ...]  #: functions where no target was given
    controller: Controller | None  #: None for a robot, and for a scenario with another task
    q: Array  #: (n,): the scenario's start, the run's, or the configuration nearest to zero
    t: float = 0.0  #: s
    trajectory: Trajectory | None = None  #: of a run's folder
    scenario: Scenario | None = None  #: also that of a run

    @property
    def subject(self) -> Subject:
        return self.controller if self.controller is not None else (self.robot, self.task)


def studied(
    source: str,
    *,
    tasks: Sequence[str] | None,
    at: Sequence[str] | None = None,
    t: float | None = None,
    settings: Sequence[str] | None = None,
    to_drive: bool = False,
    **loading: Any,
) -> Studied:
    """What SOURCE means: a run's folder, a scenario by name or as YAML file, or else a robot.

    `tasks`, `at` and `settings` are texts of `--task`, `--at` and `--set`. `t` is 0, or the run's first
    instant, when not given, s. `loading` : arguments of `nmm.load`. Where tasks come and go, those active
    there are looked at and the others told; not `to_drive`, for which a robot's task may be left out, too.
    """
    from nmm.scenario.short_task import short_task

    run, scenario, loaded = opened(source, settings, loading)
    own = None if scenario is None else scenario.controller()
    robot = loaded if own is None else own.robot
    if own is None and to_drive:
        tasks = tasks or ("position",)
    requested = tuple(short_task(text, robot) for text in tasks or ())
    if not requested and own is None:
        what = "a robot" if run is None else "a run without a scenario"
        raise InputError(
            f"{source} is {what}: expected --task, as in --task position, --task position:FRAME:xy, "
            "--task pose:FRAME (may be repeated)"
        )
    now = t if t is not None else 0.0 if run is None else float(run.t[0])
    if run is not None:
        first, last = run.t[0], run.t[-1]
        expect(first <= now <= last, "--time", f"an instant of the run, {first:g} to {last:g} s", now)
        q = interpolated(now, run.t, run.q)
    else:
        q = robot.rest if scenario is None else robot.q(scenario.parts.q0)
    q = configuration_at(robot, q, at, loading.get("lock") or {})
    if not requested and own is not None and not to_drive:
        _decide(own, now, q)
    return Studied(
        name=robot.name if scenario is None else scenario.name,
        robot=robot,
        task=requested if requested or own is None else own.task,
        controller=None if requested else own,
        q=q,
        t=now,
        trajectory=run,
        scenario=scenario,
    )


def scenario_with(scenario: Scenario, loading: Mapping[str, Any]) -> Scenario:
    """The scenario with what `nmm.load` takes (`_OF_SCENARIO`) for its robot, where given; `InputError` where
    its robot is mounted from several."""
    from nmm.scenario.robot import RobotPart

    robot, settings = scenario.parts.robot, {key: loading[key] for key in _OF_SCENARIO if key in loading}
    if not settings:
        return scenario
    if not isinstance(robot, RobotPart):
        raise InputError(
            f"the robot of {scenario.name} is mounted from several: say of which, as in --set "
            "robot.arm.lock.JOINT=VALUE",
            where=_options(settings),
        )
    if "lock" in settings:
        settings["lock"] = {**robot.lock, **settings["lock"]}
    return scenario.with_settings({f"robot.{key}": value for key, value in settings.items()})


def _options(keys: Iterable[str]) -> str:
    return ", ".join(f"--{key}".replace("_", "-").replace("dirs", "dir") for key in keys)


def configuration_at(robot: Robot, q: Array, at: Sequence[str] | None, locked: Mapping[str, float]) -> Array:
    """q (n,) with what `--at` says, COORDINATE=VALUE, m and rad; `InputError` for what is no coordinate."""
    q = q.copy()
    for name, value in coordinates_at(robot, at).items():
        if name in locked:
            raise InputError(f"{name} is locked, and no coordinate then", where="--at")
        q[robot.coordinate(name)] = scalar(value, f"--at: {name}")
    return q


def coordinates_at(robot: Robot, at: Sequence[str] | None) -> dict[str, float]:
    """What `--at` says by coordinate, m and rad; posture=NAME, one of the SRDF's, says several."""
    from nmm.model.robots.semantics import POSTURE

    named = [text for text in at or () if text.partition("=")[0].strip() == POSTURE not in robot.q_names]
    numbers = [text for text in at or () if text not in named]
    values = values_of(numbers, "--at", "COORDINATE=VALUE, as in q1=pi/2, or posture=NAME")
    postures = [text.partition("=")[2].strip() for text in named]
    return robot.postures.within({POSTURE: postures, **values}) if postures else values


def _decide(controller: Controller, t: float, q: Array) -> None:
    """Of tasks that come and go, those active at t (s) and q (n,) are looked at; the others are told."""
    from nmm.base.text_format import listed

    schedule = controller.schedule
    if schedule is None:
        return
    schedule.changes(t, q)
    controller.switch()
    names, active = schedule.sequence.names, schedule.moment.active
    seen, off = (
        [name for name, on in zip(names, active, strict=True) if bool(on) is wanted]
        for wanted in (True, False)
    )
    if off:
        text = listed(seen) or "no task"
        what = f"this is about {text}, active there at t = {t:g} s, and not about {listed(off)}"
        warn(f"tasks come and go: {what}")


def is_scenario(source: str) -> bool:
    from nmm.base.bundled import bundled_scenarios
    from nmm.scenario.scenario import SUFFIXES

    return source in bundled_scenarios() or Path(source).expanduser().suffix in SUFFIXES


def opened(
    source: str, settings: Sequence[str] | None, loading: dict[str, Any]
) -> tuple[Trajectory | None, Scenario | None, Robot]:
    """The run, the scenario and the robot of SOURCE; run and scenario where it is one."""
    from nmm.base.bundled import bundled_robots, bundled_scenarios
    from nmm.model.robots.loading import load
    from nmm.motion.trajectory import Trajectory
    from nmm.scenario import Scenario

    path = Path(source).expanduser()
    of_scenario = is_scenario(source)
    of_folder = bool(source) and path.is_dir() and not of_scenario and source not in bundled_robots()
    if of_folder:
        _check_folder(source, path)
    elif not of_scenario:
        if source not in bundled_robots() and not path.suffix and "/" not in source:
            names = [*bundled_robots(), *bundled_scenarios()]
            raise InputError(f"{no_such('robot or scenario', source, names)}; or give a path")
        return None, None, load(source, arguments=arguments_of(settings), **loading)
    allowed = _OF_SCENARIO if of_scenario else ()
    wrong = [key for key, value in loading.items() if value and key not in allowed]
    if wrong:
        raise InputError(f"of a robot's file; {source} has a robot of its own", where=_options(wrong))
    if of_scenario:
        scenario = scenario_with(Scenario.load(source, settings_of(settings)), loading)
        for warning in scenario.warnings:
            warn(warning)
        return None, scenario, scenario.robot()
    if settings:
        what = f"{source} is a run, which is as it was"
        raise InputError(what, where="--set", expected="a robot or a scenario")
    run = Trajectory.load(path)
    expect(len(run), source, "a run with at least one sample")
    file = path / "scenario.yaml"
    return run, Scenario.load(file) if file.exists() else None, run.robot


def _check_folder(source: str, path: Path) -> None:
    """`InputError` for a folder that is no run's; it names the runs inside, which `nmm compare` leaves."""
    from nmm.views.folders.run import is_run

    if is_run(path):
        return
    inside = sorted(folder.name for folder in path.iterdir() if folder.is_dir() and is_run(folder))
    what = f"another folder, which holds the runs {', '.join(inside)}" if inside else "another folder"
    raise InputError(where=source, expected=f"a robot, a scenario or a run's folder, this is {what}")
