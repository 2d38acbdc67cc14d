"""A run's folder: its arrays, tables, figures and playback, read back without pickle."""

from __future__ import annotations

import csv
import json
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from nmm.collisions.recorded import described, made, places, shape_of
from nmm.errors import InputError, RobotError
from nmm.folders.recorded_arrays import ARRAYS, OPTIONAL_ARRAYS
from nmm.folders.whole import has_format, replaced_folder, steady
from nmm.runs.figure_options import Drawn, drawn_as
from nmm.runs.residuals import Residuals
from nmm.runs.summary import FORMAT

if TYPE_CHECKING:
    from nmm.collisions.obstacle import Obstacle
    from nmm.folders.told import ToldObstacle, ToldRobot, ToldRun
    from nmm.robots.robot import Robot
    from nmm.runs.ellipsoid_options import Wanted
    from nmm.runs.trajectory import Trajectory
#: More samples take seconds to write, which is said.
MANY = 50_000
#: Samples that are written to trajectory.csv at a time.
ROWS = 10_000
#: What the arrays were that older folders lack.
WERE = {
    "scale": lambda count: np.ones((count, 1)),
    "margin": lambda count: np.full(count, np.inf),
    "step_size": lambda count: np.ones(count),
    "crossed": lambda count: np.zeros(count, dtype=np.int64),
    "shares": lambda count: np.zeros((count, 0)),
    "clearance": lambda count: np.zeros(0),
    "clearance_between": lambda count: np.zeros(0),
    "clearance_pairs": lambda count: np.zeros(0, dtype=np.int64),
    "clearance_points": lambda count: np.zeros((0, 6)),
}


def is_run(folder: Path) -> bool:
    """Whether a folder holds a run that nmm wrote."""
    return has_format(folder / "summary.json", FORMAT)


def save(
    trajectory: Trajectory,
    folder: str | Path,
    *,
    figures: Drawn = True,
    html: bool = False,
    ellipsoids: Wanted = False,
    tell: Callable[[dict[str, Any]], None] | None = None,
) -> Path:
    """Write trajectory.npz, trajectory.csv, summary.json, scenario.yaml, figures and playback.html.

    Parameters
    ----------
    folder : a new folder, or one of nmm's, which is replaced
    figures : whether to draw the figures, or in which formats and how wide (`nmm.figures.FigureOptions`)
    html : whether to write playback.html
    ellipsoids : whether manipulability ellipsoids are drawn, in ellipses.png and playback.html, or how
        (`nmm.playback.EllipsoidOptions`)
    tell : called with the summary before what takes time, the figures, is drawn

    Raises
    ------
    InputError : the folder exists and is not ours, or cannot be written; ellipsoids of a frame or with
        sizes that the robot does not have
    """
    drawn = drawn_as(figures)
    if len(trajectory) > MANY:
        logging.getLogger("nmm").info("writing %d samples to %s", len(trajectory), folder)
    with replaced_folder(folder, is_run) as temporary:
        np.savez(temporary / "trajectory.npz", **_arrays(trajectory))  # compressing gains little on doubles
        summary = trajectory.summary()
        if tell is not None:
            tell(summary)
        _write_csv(trajectory, temporary / "trajectory.csv")
        (temporary / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        if trajectory.scenario is not None:
            text = yaml.safe_dump(trajectory.scenario, sort_keys=False, allow_unicode=True)
            (temporary / "scenario.yaml").write_text(text, encoding="utf-8")
        if drawn is not None and len(trajectory) > 1:
            from nmm.figures import write_run_figures

            write_run_figures(trajectory, temporary, ellipsoids=ellipsoids, options=drawn)
        if html and len(trajectory):
            from nmm.playback import write_html

            title = trajectory.robot.name if trajectory.scenario is None else str(trajectory.scenario["name"])
            page = temporary / "playback.html"
            write_html([trajectory], page, title=title, ellipsoids=ellipsoids)
    return Path(folder)


#: What to do about a robot that was put together in Python.
_ASK = "give the robot that it ran on: Trajectory.load(folder, robot)"


def load(folder: str | Path, robot: Robot | None = None) -> Trajectory:
    """Read a run's folder.

    Parameters
    ----------
    folder : written by `save`
    robot : the robot of the run; needed where it was neither a scenario's nor loaded from one file alone
        (mounted, with locked joints, on a platform that was given)

    Raises
    ------
    InputError : names what is missing, or says that the robot is another
    """
    folder = Path(folder)
    return steady(folder, lambda: _loaded(folder, robot))


def _loaded(folder: Path, robot: Robot | None) -> Trajectory:
    from nmm.control.sequence import Event
    from nmm.folders.recorded_arrays import check_arrays, read_arrays
    from nmm.folders.told import ToldRun, read_told
    from nmm.runs.trajectory import Trajectory
    from nmm.scenario import Scenario

    summary, file = folder / "summary.json", folder / "trajectory.npz"
    if not summary.exists() and not file.exists():
        raise InputError(f"{folder}: expected a run's folder (with trajectory.npz and nmm's summary.json)")
    told = read_told(summary, ToldRun, FORMAT)
    found = read_arrays(file)
    check_arrays(found, file, len(told.limit_names), len(told.clearance_names))
    _check_counts(told, found, summary)
    count = len(found["t"])
    arrays = {name: found[name] for name in ARRAYS} | {name: found.get(name) for name in OPTIONAL_ARRAYS}
    arrays |= {name: found.get(name, was(count)) for name, was in WERE.items()}
    obstacles = _obstacles(told.obstacles or (), found, file)
    scenario = None
    if (folder / "scenario.yaml").exists():
        loaded = Scenario.load(folder / "scenario.yaml")
        scenario = loaded.resolved()
        robot = loaded.robot() if robot is None else robot
        if told.obstacles is None:
            obstacles = loaded.obstacles(robot)
    elif robot is None:
        robot = _from_its_file(folder, told.robot)
    same = told.robot.fingerprint in (None, robot.fingerprint)
    if not same or (found["q"].shape[1], found["u"].shape[1]) != (robot.n, robot.n_u):
        raise InputError(f"{folder}: {robot.name} is another robot than the run's ({_ASK})")
    if told.frame is not None:
        try:
            robot.frame_id(told.frame)
        except InputError as error:
            raise InputError(f"{summary}: frame: {error}") from None
    off = told.kinematics_off
    return Trajectory(
        robot=robot,
        r_names=told.r_names,
        r_units=told.r_units,
        resolver=told.resolver,
        method=told.method,
        dt=told.dt,
        outcome=told.outcome,
        message=told.message,
        warnings=told.warnings,
        frame=told.frame,
        unmet=Residuals(*(getattr(told, f"unmet_{name}") for name in Residuals._fields)),
        limited=told.limited,
        kinematics_off=float("nan") if off is None else off,
        limit_names=told.limit_names,
        clearance_names=told.clearance_names,
        clearance_asked=told.clearance_asked,
        obstacles=obstacles,
        scenario=scenario,
        events=tuple(Event(one.t, one.task, one.what, one.why) for one in told.events),
        label=told.label,
        made_with=told.made_with,
        **arrays,
    )


def _check_counts(told: ToldRun, found: Mapping[str, Any], summary: Path) -> None:
    """`InputError` where summary.json speaks of other numbers of samples or rows than the arrays have."""
    count, rows = found["r"].shape
    if told.samples not in (None, count):
        raise InputError(f"{summary}: samples: expected {count}, as in trajectory.npz, got {told.samples}")
    for key, names in (("r_names", told.r_names), ("r_units", told.r_units)):
        if len(names) != rows:
            raise InputError(f"{summary}: {key}: expected {rows}, as in trajectory.npz, got {len(names)}")


def _from_its_file(folder: Path, said: ToldRobot) -> Robot:
    """The robot of the file that a run names."""
    from nmm.robots.loading import load as load_robot

    try:
        return load_robot(said.source, arguments=said.arguments)
    except RobotError as error:
        raise InputError(f"{folder}: its robot {said.name} cannot be loaded ({_ASK}): {error}") from None


def _arrays(trajectory: Trajectory) -> dict[str, Any]:
    arrays = {name: getattr(trajectory, name) for name in (*ARRAYS, *WERE)}
    arrays |= {
        name: getattr(trajectory, name) for name in OPTIONAL_ARRAYS if getattr(trajectory, name) is not None
    }
    for i, one in enumerate(trajectory.obstacles):
        arrays[f"obstacle_{i}_places"] = places(one, trajectory.t)
        arrays[f"obstacle_{i}_points"] = described(one.shape)[1]
    arrays["q_names"] = np.array(trajectory.robot.q_names)
    arrays["u_names"] = np.array(trajectory.robot.u_names)
    arrays["r_names"] = np.array(trajectory.r_names)
    arrays["event_t"] = np.array([event.t for event in trajectory.events])
    arrays["event_names"] = np.array([f"{event.task} {event.what}" for event in trajectory.events], dtype=str)
    return arrays


def _obstacles(listed: Sequence[ToldObstacle], found: Mapping[str, Any], file: Path) -> tuple[Obstacle, ...]:
    """The obstacles of a summary, where the arrays say that they were."""
    from nmm.folders.recorded_arrays import check_placements

    obstacles = []
    for i, one in enumerate(listed):
        names = f"obstacle_{i}_places", f"obstacle_{i}_points"
        for name in names:
            if name not in found:
                raise InputError(f"{file}: {name}: this array is missing")
        passed, points = (found[name] for name in names)
        check_placements(passed, f"{file}: {names[0]}", (1, len(found["t"])))
        try:
            shape = shape_of(one.shape, points)
        except (InputError, TypeError) as error:
            where = file.with_name("summary.json")
            raise InputError(f"{where}: obstacles.{i}.shape: {error}") from None
        obstacles.append(made(shape, one.name, found["t"], passed))
    return tuple(obstacles)


def _write_csv(trajectory: Trajectory, path: Path) -> None:
    robot, rows = trajectory.robot, trajectory.r_names
    columns = [
        ("t", trajectory.t),
        *((name, trajectory.q[:, i]) for i, name in enumerate(robot.q_names)),
        *((f"u_{name}", trajectory.u[:, i]) for i, name in enumerate(robot.u_names)),
        *((f"r_{name}", trajectory.r[:, i]) for i, name in enumerate(rows)),
        *((f"r_d_{name}", trajectory.r_d[:, i]) for i, name in enumerate(rows)),
        *((f"error_{name}", trajectory.error[:, i]) for i, name in enumerate(rows)),
        ("objective", trajectory.objective),
        ("sigma_min", trajectory.sigma_min),
        *((f"partition_{i}", trajectory.partition[:, i]) for i in range(len(rows))),
        ("residual", trajectory.residual),
        *((f"scale_{i}", trajectory.scale[:, i]) for i in range(trajectory.scale.shape[1])),
        ("step_size", trajectory.step_size),
        ("margin", trajectory.margin),
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerow([name for name, _ in columns])
        # Numbers need no quotes: joined by hand they are written in two thirds of the writer's time. All of a
        # long run as Python's numbers would fill more memory than the run itself.
        for first in range(0, len(trajectory), ROWS):
            some = [values[first : first + ROWS].tolist() for _, values in columns]
            file.writelines(
                f"{','.join(line)}\n" for line in zip(*(map(repr, one) for one in some), strict=True)
            )
