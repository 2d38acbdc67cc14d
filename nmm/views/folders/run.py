"""A run's folder: its arrays, tables, figures and playback, read back without pickle."""

from __future__ import annotations

import csv
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from nmm.base.errors import InputError, RobotError, expect
from nmm.base.figure_options import Drawn, drawn_as
from nmm.control.step.quantities import placed, saved
from nmm.model.collisions.obstacle import (
    obstacle_as_json,
    obstacle_from_json,
    obstacle_places,
    shape_from_json,
)
from nmm.model.robots.numbers import with_numbers
from nmm.motion.components import components
from nmm.motion.diagnosis.summary import FORMAT
from nmm.motion.residuals import Residuals
from nmm.views.folders.whole import FolderKind, replaced_folder, steady

if TYPE_CHECKING:
    from nmm.base.ellipsoid_options import Wanted
    from nmm.model.collisions.obstacle import Obstacle
    from nmm.model.robots.robot import Robot
    from nmm.motion.seen import RunCamera
    from nmm.motion.trajectory import Trajectory
    from nmm.views.folders.schema import ToldObstacle, ToldRun
#: More samples take seconds to write, which is logged.
MANY = 50_000
ROWS = 10_000
is_run = FolderKind(FORMAT)


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

    folder : a new folder, or one of nmm's, which is replaced; otherwise InputError
    figures : whether to draw, or formats and width (`nmm.figures.FigureOptions`)
    html : whether to write playback.html
    ellipsoids : whether ellipses.png and playback.html show manipulability, or how (`EllipsoidOptions`);
        InputError for a frame or sizes that the robot does not have
    tell : called with the summary before figures are drawn, which takes time
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
        is_run.write(temporary, summary, ensure_ascii=True)
        if trajectory.scenario is not None:
            text = yaml.safe_dump(trajectory.scenario, sort_keys=False, allow_unicode=True)
            (temporary / "scenario.yaml").write_text(text, encoding="utf-8")
        if drawn is not None and len(trajectory) > 1:
            from nmm.views.figures import write_run_figures

            write_run_figures(trajectory, temporary, ellipsoids=ellipsoids, options=drawn)
        if html and len(trajectory):
            from nmm.views.playback import write_html

            title = trajectory.robot.name if trajectory.scenario is None else str(trajectory.scenario["name"])
            page = temporary / "playback.html"
            write_html([trajectory], page, title=title, ellipsoids=ellipsoids)
    return Path(folder)


#: What to do about a robot that was put together in Python.
_ASK = "give the robot that it ran on: Trajectory.load(folder, robot)"


def load(folder: str | Path, robot: Robot | None = None) -> Trajectory:
    """Read a run's folder; InputError if it is incomplete or the robot differs. A robot is needed if neither
    a scenario nor a single file defines the run's (mounted, with locked joints, on a given platform)."""
    return steady(Path(folder), lambda: _loaded(Path(folder), robot))


def _loaded(folder: Path, robot: Robot | None) -> Trajectory:
    from nmm.control.sequencing.sequence import Event
    from nmm.model.robots.loading import load as load_robot
    from nmm.motion.trajectory import Trajectory
    from nmm.motion.verdict import verdict_of
    from nmm.scenario import Scenario
    from nmm.views.folders.schema import ToldRun, check_arrays, read_arrays, read_checked

    summary, file = folder / "summary.json", folder / "trajectory.npz"
    if not summary.exists() and not file.exists():
        from nmm.views.folders.kinds import folder_kind

        expected = "a run's folder (with trajectory.npz and nmm's summary.json)"
        kind = folder_kind(folder)
        raise InputError(where=folder, expected=expected, **({"got": f"that of a {kind}"} if kind else {}))
    stored = read_checked(summary, ToldRun, FORMAT)
    npz = read_arrays(file)
    check_arrays(npz, file, len(stored.limit_names), len(stored.clearance_names))
    _check_counts(stored, npz, summary)
    sizes = dict(zip("Nnms", (*npz["q"].shape, npz["u"].shape[1], npz["r"].shape[1]), strict=True))
    absent = {quantity.name: None if quantity.optional else quantity.absent(**sizes) for quantity in saved()}
    arrays = {name: npz.get(name, fill) for name, fill in absent.items()}
    obstacles = _obstacles(stored.obstacles or (), npz, file)
    scenario, rest, given = None, dict[str, Any](), robot is not None
    if (folder / "scenario.yaml").exists():
        loaded = Scenario.load(folder / "scenario.yaml")
        scenario = loaded.resolved()
        robot = loaded.robot() if robot is None else robot
        rest["surroundings"] = loaded.surroundings(robot)
        if stored.obstacles is None:
            obstacles = loaded.obstacles(robot)
    elif robot is None:
        try:
            robot = load_robot(stored.robot.source, arguments=stored.robot.arguments)
        except RobotError as error:
            raise InputError(f"its robot cannot be loaded ({_ASK}): {error}", where=folder) from None
    if not given:
        robot = _numbered(robot, stored.robot.numbers, summary)
    same = stored.robot.fingerprint in (None, robot.fingerprint)
    if not same or (npz["q"].shape[1], npz["u"].shape[1]) != (robot.n, robot.n_u):
        raise InputError(f"{robot.name} is another robot than the run's ({_ASK})", where=folder)
    named = [] if stored.frame is None else [("frame", stored.frame)]
    named += [(f"cameras.{i}.frame", camera.frame) for i, camera in enumerate(stored.cameras)]
    for key, frame in named:
        try:
            robot.frame_id(frame)
        except InputError as error:
            raise error.at(f"{summary}: {key}") from None
    findings = None if stored.findings is None else [finding.model_dump() for finding in stored.findings]
    own = ToldRun.model_fields.keys() & Trajectory.__dataclass_fields__.keys()
    rest |= {name: getattr(stored, name) for name in own} | {
        "robot": robot,
        "verdict": verdict_of(stored.outcome, stored.message, stored.warnings, findings),
        "unmet": Residuals(*(getattr(stored, f"unmet_{name}") for name in Residuals._fields)),
        "kinematics_off": float("nan") if stored.kinematics_off is None else stored.kinematics_off,
        "obstacles": obstacles,
        "scenario": scenario,
        "events": tuple(Event(**event.model_dump()) for event in stored.events),
        "cameras": _cameras(stored, arrays, summary),
    }
    return Trajectory.of(arrays, **rest)


def _numbered(robot: Robot, numbers: Mapping[str, float], summary: Path) -> Robot:
    """The robot with the numbers that it ran with, whatever its file of calibration says by now."""
    if robot.changed_numbers == numbers:
        return robot
    try:
        return with_numbers(with_numbers(robot, robot.nominal), numbers)
    except InputError as error:
        raise error.at(f"{summary}: robot.numbers") from None


def _cameras(stored: ToldRun, arrays: Mapping[str, Any], summary: Path) -> tuple[RunCamera, ...]:
    """The cameras of a summary; InputError for points that were not seen, or rows that the task lacks."""
    from nmm.motion.seen import GoalRows, RunCamera

    seen, rows = arrays["seen"], range(len(stored.r_names))
    points = range(0 if seen is None else seen.shape[1])
    for i, camera in enumerate(stored.cameras):
        own = range(len(camera.points))
        numbers = [*(goal.point for goal in camera.goals), *(end for line in camera.lines for end in line)]
        fits = all(point in points for point in camera.points) and all(number in own for number in numbers)
        expect(fits, f"{summary}: cameras.{i}", f"numbers of the {len(points)} points in trajectory.npz")
        fits = all(goal.x in rows and goal.y in rows for goal in camera.goals)
        expect(fits, f"{summary}: cameras.{i}.goals", f"rows from 0 to {len(rows) - 1}")
    return tuple(
        RunCamera(**{**dict(camera), "goals": tuple(GoalRows(**dict(goal)) for goal in camera.goals)})
        for camera in stored.cameras
    )


def _check_counts(stored: ToldRun, arrays: Mapping[str, Any], summary: Path) -> None:
    """InputError if summary.json and the arrays differ in the number of samples or rows."""
    count, rows = arrays["r"].shape
    fits = stored.samples in (None, count)
    expect(fits, f"{summary}: samples", f"{count}, as in trajectory.npz", stored.samples)
    for key, names in (("r_names", stored.r_names), ("r_units", stored.r_units)):
        expect(len(names) == rows, f"{summary}: {key}", f"{rows}, as in trajectory.npz", len(names))


def _arrays(trajectory: Trajectory) -> dict[str, Any]:
    arrays: dict[str, Any] = {quantity.name: trajectory[quantity.name] for quantity in saved()}
    arrays = {name: values for name, values in arrays.items() if values is not None}
    for i, obstacle in enumerate(trajectory.obstacles):
        arrays[f"obstacle_{i}_places"] = obstacle_places(obstacle, trajectory.t)
        arrays[f"obstacle_{i}_points"] = obstacle_as_json(obstacle.shape)[1]
    robot = trajectory.robot
    for key, names in {"q": robot.q_names, "u": robot.u_names, "r": trajectory.r_names}.items():
        arrays[f"{key}_names"] = np.array(names)
    arrays["event_t"] = np.array([event.t for event in trajectory.events])
    arrays["event_names"] = np.array([f"{event.task} {event.what}" for event in trajectory.events], dtype=str)
    return arrays


def _obstacles(listed: Sequence[ToldObstacle], arrays: Mapping[str, Any], file: Path) -> tuple[Obstacle, ...]:
    """The obstacles of a summary, at the placements in the arrays."""
    from nmm.views.folders.schema import check_placements

    obstacles = []
    for i, obstacle in enumerate(listed):
        names = f"obstacle_{i}_places", f"obstacle_{i}_points"
        for name in names:
            if name not in arrays:
                raise InputError("this array is missing", where=f"{file}: {name}")
        passed, points = (arrays[name] for name in names)
        check_placements(passed, f"{file}: {names[0]}", (1, len(arrays["t"])))
        try:
            shape = shape_from_json(obstacle.shape, points)
        except (InputError, TypeError) as error:
            wrong = error if isinstance(error, InputError) else InputError(str(error))
            raise wrong.at(f"{file.with_name('summary.json')}: obstacles.{i}.shape") from None
        obstacles.append(obstacle_from_json(shape, obstacle.name, arrays["t"], passed))
    return tuple(obstacles)


def _write_csv(trajectory: Trajectory, path: Path) -> None:
    columns = [
        (name, x)
        for quantity in placed()
        if quantity.column
        for name, _, _, x in components(trajectory, quantity)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerow([name for name, _ in columns])
        # Numbers need no quotes: joined by hand they are written in two thirds of the writer's time. All of a
        # long run as Python's numbers would fill more memory than the run itself.
        for first in range(0, len(trajectory), ROWS):
            some = [values[first : first + ROWS].tolist() for _, values in columns]
            file.writelines(
                f"{','.join(line)}\n" for line in zip(*(map(repr, column) for column in some), strict=True)
            )
