"""A first scenario for a robot's file: chosen, written, and run to see that it works."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, cast

import numpy as np

from nmm.base.errors import InputError, NmmError, RunError, ScenarioError, expect_known
from nmm.base.text_format import one_line
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.ground import slip_warnings
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Outcome, Trajectory
from nmm.scenario import Scenario
from nmm.scenario.document import document_of
from nmm.scenario.scaffold.end_effector import Hand, HandsPath, hands, paths
from nmm.scenario.scaffold.parts import ChosenRobot, chosen_robot, written_path
from nmm.scenario.scaffold.standing import Standing, tipping
from nmm.scenario.scaffold.start import Start, start_for
from nmm.scenario.scaffold.text import text_of

#: At most this many scenarios are tried, for at most this many frames.
_TRIES, _HANDS = 18, 3
#: Of what should not tip the robot, what is tried, if it does.
_SHARES = (1.0, 0.5, 0.25)
#: Kept to obstacles, m.
_DISTANCE = 0.03
#: Which kind of obstacle a file is, by how its name ends.
_SEEN = {
    **dict.fromkeys((".ply", ".pcd", ".npz"), "point_cloud"),
    **dict.fromkeys((".yaml", ".yml"), "occupancy_map"),
    ".bt": "voxel_map",
}
#: A path is followed at its speed when limits leave this share of the task's rate everywhere.
_UNHURRIED = 0.999


@dataclass(frozen=True, eq=False)
class Draft:
    """A scenario that was written and tried.

    Attributes
    ----------
    text : of the file
    scenario : the same, read
    trajectory : its run, as it was tried
    chosen : which robot, which frame, which start and path, and why, a line each

    Examples
    --------
    >>> draft = nmm.first_scenario("unicycle_2r")
    >>> draft.scenario.parts.resolver.kind, draft.trajectory.complete
    ('pg', True)
    """

    text: str
    scenario: Scenario
    trajectory: Trajectory
    chosen: tuple[str, ...]


def first_scenario(
    robot: str | Path,
    *,
    arm: str | Path | None = None,
    at: str | None = None,
    file: str | Path | None = None,
    obstacles: Sequence[str | Path] = (),
    **loading: Any,
) -> Draft:
    """A first scenario for a robot: a frame led along a gentle path from a start that is no singularity.

    Parameters
    ----------
    robot : a bundled name, a path, or package://PACKAGE/PATH; without wheels it is put on a bundled base,
        unless `platform` says what it stands on
    arm : another, that is mounted on the robot, at its frame `at`
    file : where the text will stand: paths below that folder are relative; the working folder when not given
    obstacles : files of what the robot keeps 3 cm away from: clouds (.ply, .pcd, .npz), maps (.yaml), cells
        of OctoMap's (.bt); each where its numbers have it
    loading : platform, lock, axle, package_dirs, srdf, calibration, arguments as `nmm.load` takes them; lock
        and srdf are the arm's where there is one

    Raises
    ------
    InputError : the robot cannot be loaded, has nothing to lead, or none of the scenarios tried runs

    Examples
    --------
    >>> draft = nmm.first_scenario("unicycle_3r")
    >>> draft.trajectory.complete
    True
    """
    for value in (robot,) if arm is None else (robot, arm):
        if not isinstance(value, str | Path):
            raise InputError(expected="a robot's name or path", got=value)
    place = usual_file(arm or robot) if file is None else Path(file)
    keys_of_obstacles = _obstacles(obstacles, place.parent)
    chosen = chosen_robot(str(robot), place.parent, arm=None if arm is None else str(arm), at=at, **loading)
    candidates, standing = hands(chosen.robot), Standing(chosen.robot)
    last: NmmError = InputError("there is no frame that its inputs move")
    best, best_tips = cast(Draft | None, None), False
    tries = 0
    for hand in candidates[:_HANDS] if candidates and candidates[0].joints else candidates:
        start = start_for(chosen.robot, hand, standing) if tries < _TRIES else None
        if start is None:
            continue
        for data, words in islice(_scenarios(chosen, hand, start), _TRIES - tries):
            tries += 1
            for share in _SHARES:
                limits, about = _limits(standing, start, share)
                keys = {**data, "limits": limits, **keys_of_obstacles}
                draft = _tried(keys, {**words, "limits": about}, chosen, hand, start, place)
                tips = isinstance(draft, Draft) and standing.is_known and tipping(draft.trajectory.torques())
                if not tips or standing.margin(start.q) <= 0.0:
                    break
            if not isinstance(draft, Draft):
                last = draft
            elif _unhurried(draft.trajectory) and not tips:
                return draft
            elif best is None or (best_tips and not tips):
                best, best_tips = draft, bool(tips)
        if best is not None:
            return best
    what = f"no first scenario found that runs: {one_line(str(last))}"
    expected = "" if candidates and candidates[0].joints else "--arm FILE, an arm to mount on it"
    raise InputError(what, where=chosen.robot.name, expected=expected) from last


def usual_file(source: str | Path) -> Path:
    stem = re.sub(r"[^\w-]", "_", Path(source).name.split(".", 1)[0])
    return Path(f"{stem or 'scenario'}.yaml")


def _obstacles(files: Sequence[str | Path], folder: Path) -> dict[str, Any]:
    """The key `collisions`, where there are obstacles."""
    if isinstance(files, str | Path):
        raise InputError(where="obstacles", expected="a list of files", got=files)
    listed: list[dict[str, Any]] = []
    for file in map(Path, files):
        expect_known("kind of obstacle's file", file.suffix.lower(), _SEEN, f"obstacle {file}")
        if not file.is_file():
            raise InputError("no such file", where=f"obstacle {file}")
        kind = _SEEN[file.suffix.lower()]
        name = re.sub(r"[^\w-]", "_", file.stem) or kind
        same = sum(entry["name"].partition(" ")[0] == name for entry in listed)
        name += f" {same + 1}" if same else ""
        listed.append({"name": name, "shape": {"kind": kind, "file": written_path(str(file), folder)}})
    keys = {"distance": _DISTANCE, "self_collisions": False, "obstacles": listed}
    return {"collisions": keys} if listed else {}


def _scenarios(
    chosen: ChosenRobot, hand: Hand, start: Start
) -> Iterator[tuple[dict[str, Any], dict[str, str]]]:
    """Scenarios as plain data, with a line on each key, the most wanted first."""
    robot = chosen.robot
    place = Configuration(robot, start.q).placement(hand.frame).translation
    place = place[["xyz".index(axis) for axis in start.axes]]
    slips = [f"{note[:1].upper()}{note[1:]}." for note in map(str, slip_warnings(robot))]
    for path in paths(robot, start.axes, np.array(place)):
        for kind, why in _RESOLVERS.items():
            yield (
                _data(chosen, hand, start, path, kind),
                {
                    "robot": " ".join([f"The platform: {chosen.why}.", *slips]),
                    "q0": f"This one: {start.why}.",
                    "task": f"The frame is {hand.why}. The {path.reference['kind']}: {path.why}.",
                    "objective": "" if hand.joints else "No objective: there is no arm to keep in a posture.",
                    "resolver": why,
                },
            )


#: By kind of resolver, the likeliest first, why it is taken.
_RESOLVERS = {
    "pg": "pg, the projected gradient, is the one to begin with.",
    "dls": "dls, because pg met a singularity on this path.",
}


def _limits(standing: Standing, start: Start, share: float) -> tuple[dict[str, Any], str]:
    """The key `limits`: accelerations that do not tip the robot at its start, times a share; and a line."""
    robot, margin = standing.robot, standing.margin(start.q)
    if not standing.is_known:
        why = "usual ones, as the file does not tell where the robot tips (masses, three wheels)"
    elif margin <= 0.0:
        why = "usual ones: it tips at rest, at its start already"
    else:
        why = (
            f"at most {100 * 0.5 * share:.3g} % of what tips it at its start, where it stands {margin:.2g} m"
        )
        why += " inside its wheels"
    about = f"acceleration, m/s² and rad/s²: {why}."
    if not (np.isfinite(robot.u_limits).any() or robot.limited.any()):
        about += " The robot's file has no other limits; velocity: {NAME: 0.5} keeps an input within 0.5."
    return {"acceleration": standing.accelerations(start.q, share)}, about


def _data(chosen: ChosenRobot, hand: Hand, start: Start, path: HandsPath, kind: str) -> dict[str, Any]:
    robot = chosen.robot
    data: dict[str, Any] = {
        "title": f"{hand.frame} along a {path.reference['kind']}",
        "robot": _short(chosen.data),
        "q0": dict(start.named),
        "duration": _whole(path.duration),
        "dt": 0.01,
        "task": {
            "kind": "position",
            "frame": hand.frame,
            "axes": start.axes,
            "reference": path.reference,
            "gain": 1,
        },
    }
    resolver: dict[str, Any] = {"kind": kind}
    if hand.joints:
        moved = robot.u_names[robot.platform.p :]  # those that do not move it keep their place
        posture = {name: round(float(start.q[robot.coordinate(name)]), 4) for name in moved}
        data["objective"] = {"kind": "posture", "posture": posture}
        resolver["alpha"] = 1
    share = _wheel_share(robot)
    if share < 1.0:
        resolver["weights"] = {"platform": share}
    data["resolver"] = resolver
    return data


def _short(data: Mapping[str, Any]) -> Any:
    """The key `robot` as people write it: a bare source where nothing is beside it."""
    if "arm" in data:
        return {key: _short(item) if key in ("platform", "arm") else item for key, item in data.items()}
    return data["source"] if len(data) == 1 else dict(data)


def _whole(value: float) -> float | int:
    return int(value) if value == int(value) else value


def _wheel_share(robot: Robot) -> float:
    """What a platform's inputs should weigh: those in rad/s of a wheel move it by a fraction of a metre."""
    p, n_p = robot.platform.p, robot.platform.n_p
    if not p or set(robot.platform.input_units) != {"rad/s"}:
        return 1.0
    G = robot.platform.G(np.zeros(n_p))
    return float(f"{min(1.0, float(np.abs(G[:2]).sum(axis=1).max()) ** 2):.1g}") or 1.0


def _tried(
    data: dict[str, Any], words: dict[str, str], chosen: ChosenRobot, hand: Hand, start: Start, file: Path
) -> Draft | NmmError:
    """The draft when its run is completed, or why it is not."""
    head = (
        f"A first scenario for {chosen.robot.name}, written by nmm init. It runs as it stands "
        f"(nmm run {file}); change what you like."
    )
    text = text_of(data, head, {key: text for key, text in words.items() if text})
    try:
        scenario = Scenario(document_of(text, str(file), file.absolute().parent))
        trajectory = scenario.run()
    except ScenarioError as error:
        return error
    if trajectory.outcome is not Outcome.COMPLETED:
        return RunError(trajectory.message, where=f"the last one was {trajectory.outcome}")
    kind = data["task"]["reference"]["kind"]
    lines = (
        f"platform: {chosen.why}",
        f"frame: {hand.frame}, {hand.why}",
        f"start: {start.why}",
        f"task: its position ({', '.join(start.axes)}) along a {kind}",
    )
    return Draft(text, scenario, trajectory, lines)


def _unhurried(trajectory: Trajectory) -> bool:
    """Whether a run was nowhere slowed down by limits, nor warned of but for what any run would be."""
    notes = trajectory.robot.notes
    unusual = [
        finding for finding in trajectory.findings if finding.code != "idle_inputs" and finding not in notes
    ]
    return bool((trajectory.scale >= _UNHURRIED).all() and not unusual)
