"""A run's folder: its arrays, tables, figures and playback, read back without pickle."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from nmm.collisions.recorded import described, made, places, shape_of
from nmm.errors import InputError, RobotError
from nmm.folders.whole import has_format, replaced_folder
from nmm.runs.figure_options import Drawn, drawn_as
from nmm.runs.summary import FORMAT, unmet

if TYPE_CHECKING:
    from nmm.collisions.obstacle import Obstacle
    from nmm.robots.robot import Robot
    from nmm.runs.ellipsoid_options import Wanted
    from nmm.runs.trajectory import Trajectory

ARRAYS = ("t", "q", "u", "q_dot", "r", "r_d", "error", "objective", "sigma_min", "partition", "residual")
OPTIONAL_ARRAYS = ("path", "desired", "target")
#: Arrays that older folders lack, with what they then were.
LATER_ARRAYS = {
    "scale": lambda count: np.ones((count, 1)),
    "margin": lambda count: np.full(count, np.inf),
    "step_size": lambda count: np.ones(count),
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
    from nmm.control.sequence import Event
    from nmm.runs.trajectory import Outcome, Trajectory
    from nmm.scenario import Scenario

    folder = Path(folder)
    if not is_run(folder):
        raise InputError(f"{folder}: expected a run's folder (with trajectory.npz and nmm's summary.json)")
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    try:
        with np.load(folder / "trajectory.npz", allow_pickle=False) as file:
            arrays = {name: file[name] for name in ARRAYS}
            arrays |= {name: file.get(name) for name in OPTIONAL_ARRAYS}
            count = len(arrays["t"])
            arrays |= {name: file[name] if name in file else was(count) for name, was in LATER_ARRAYS.items()}
            obstacles = _obstacles(summary.get("obstacles", ()), file)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder / 'trajectory.npz'}: cannot be read: {error}") from None
    scenario = None
    if (folder / "scenario.yaml").exists():
        loaded = Scenario.load(folder / "scenario.yaml")
        scenario = loaded.resolved()
        robot = loaded.robot() if robot is None else robot
        if "obstacles" not in summary:
            obstacles = loaded.obstacles(robot)
    elif robot is None:
        robot = _from_its_file(folder, summary["robot"])
    if robot.fingerprint != summary["robot"].get("fingerprint", robot.fingerprint):
        raise InputError(f"{folder}: {robot.name} is another robot than the run's ({_ASK})")
    return Trajectory(
        robot=robot,
        r_names=tuple(summary["r_names"]),
        r_units=tuple(summary["r_units"]),
        resolver=summary["resolver"],
        method=summary["method"],
        dt=summary["dt"],
        outcome=Outcome(summary["outcome"]),
        message=summary["message"],
        warnings=tuple(summary["warnings"]),
        frame=summary["frame"],
        unmet=unmet(summary),
        limited=summary.get("limited", False),
        kinematics_off=float("nan") if (off := summary.get("kinematics_off")) is None else off,
        limit_names=tuple(summary.get("limit_names", ())),
        clearance_names=tuple(summary.get("clearance_names", ())),
        clearance_asked=summary.get("clearance_asked", 0.0),
        obstacles=obstacles,
        scenario=scenario,
        events=tuple(Event(**event) for event in summary.get("events", ())),
        label=summary.get("label", ""),
        **arrays,
    )


def _from_its_file(folder: Path, said: dict[str, Any]) -> Robot:
    """The robot of the file that a run names."""
    from nmm.robots.loading import load as load_robot

    try:
        return load_robot(said["source"], arguments=said["arguments"])
    except RobotError as error:
        raise InputError(f"{folder}: its robot {said['name']} cannot be loaded ({_ASK}): {error}") from None


def _arrays(trajectory: Trajectory) -> dict[str, Any]:
    arrays = {name: getattr(trajectory, name) for name in (*ARRAYS, *LATER_ARRAYS)}
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


def _obstacles(listed: Sequence[dict[str, Any]], file: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    """The obstacles of a summary, where the arrays say that they were."""
    return tuple(
        made(
            shape_of(one["shape"], file[f"obstacle_{i}_points"]),
            one["name"],
            file["t"],
            file[f"obstacle_{i}_places"],
        )
        for i, one in enumerate(listed)
    )


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
        # Numbers need no quotes: joined by hand they are written in two thirds of the writer's time.
        lines = zip(*(map(repr, values.tolist()) for _, values in columns), strict=True)
        file.writelines(f"{','.join(line)}\n" for line in lines)
