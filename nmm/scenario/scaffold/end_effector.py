"""Which frame of a robot is led, and along which path: the most likely to work first, and why."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.text_format import counted
from nmm.model.robots.reach import arm_branches, arm_end, reach
from nmm.model.robots.robot import Robot

#: A range this small is none, m or rad.
_NO_ROOM = 1e-6
#: A point so near to the axle, m, cannot be led aside.
_NO_LEVER = 0.02
#: Parts of the names of what rolls, and of what is above it.
_ROLLING = ("wheel", "tire", "tyre", "suspension", "steer", "caster", "castor", "swivel")
#: From rest to a path's speed, s.
_RUN_UP = 2.0
#: Radii of circles, lengths of lines, and of those on a fixed base, as shares of the arm's reach.
_RADII, _LENGTHS, _FIXED = (1.5, 3.0, 6.0), (1.5, 0.5), (0.2, 0.1, 0.04)
#: Of the end-effector: m/s with a metre of reach, at most; and slower.
_SPEEDS = (0.25, 0.1, 0.04)
#: A run is as long as the path at that speed, within these, s.
_LEAST, _MOST = 10.0, 30.0


@dataclass(frozen=True)
class Hand:
    """A frame, the arm's inputs on the way to it, and a line that says why this one."""

    frame: str
    joints: tuple[str, ...]
    why: str


def hands(robot: Robot) -> list[Hand]:
    """Frames to lead, the best first: ends of arms, or of a robot without any what its platform carries."""
    n_p = robot.platform.n_p
    ends, free = [], movable(robot)
    rolling = wheel_frames(robot)
    for chain in arm_branches(robot):
        frame = arm_end(robot, chain[-1])
        if frame in rolling:
            continue
        joints = tuple(name for name in map(robot.model.names.__getitem__, chain) if name in free)
        if frame and joints:
            length = reach(robot, frame)
            far = length.length if length is not None and np.isfinite(length.length) else 0.0
            ends.append((-len(joints), -far, frame, joints))
    ends.sort()
    made = []
    for less, nearer, frame, joints in ends:
        others = [other for _, _, other, _ in ends if other != frame]
        beside = f"; other ends: {', '.join(others[:4])}" if others else ""
        why = f"the end of the longest chain: {counted(-less, 'joint')}, {-nearer:.2g} m long{beside}"
        made.append(Hand(frame, joints, why))
    if made or not n_p:
        return made
    ahead, where = [name for name in _carried(robot) if name not in rolling], "ahead of its axle"
    ahead = [name for name in ahead if _ahead(robot, name) > _NO_LEVER]
    if not ahead:
        ahead, where = [_root(robot)], "as none is ahead of its axle"
    why = f"there is no arm: a point of the platform's body, {where}"
    return [Hand(name, (), why) for name in sorted(ahead, key=lambda name: -_ahead(robot, name))]


def wheel_frames(robot: Robot) -> set[str]:
    """Frames of wheels, of what steers them, and of what is between these and the base, held or not."""
    parts = {str(name) for note in robot.notes for name in _held_by(note)}
    model, names = robot.model, set[str]()
    for frame in model.frames:  # each behind the one that carries it
        above = model.frames[frame.parentFrame]
        below = above.name in names and above.parentJoint == frame.parentJoint
        own = {frame.name, str(model.names[frame.parentJoint])}
        if below or own & parts or any(word in " ".join(own).lower() for word in _ROLLING):
            names.add(frame.name)
    return names


def _held_by(note: Finding) -> Iterable[str]:
    if note.code == "not_a_wheel":
        return [note.values["name"]]
    keys = {"undercarriage_held": "values", "radius_unknown": "names", "wheels_held": "names"}
    return note.values[keys[note.code]] if note.code in keys else ()


def _root(robot: Robot) -> str:
    """The root link."""
    model = robot.model
    return next(
        frame.name
        for frame in model.frames
        if frame.type.name == "BODY" and model.names[frame.parentJoint] == "theta"
    )


def movable(robot: Robot) -> list[str]:
    """The inputs that move something: all but those of joints whose limits leave no room."""
    room = robot.q_limits[:, 1] - robot.q_limits[:, 0]
    return [
        name
        for name, i in zip(robot.u_names, robot.rate_coordinates, strict=True)
        if i < 0 or room[i] > _NO_ROOM
    ]


def _carried(robot: Robot) -> Iterator[str]:
    """Links of the platform's body."""
    carried = [
        {
            frame.name
            for frame in model.frames
            if frame.type.name in ("BODY", "OP_FRAME") and model.names[frame.parentJoint] == "theta"
        }
        for model in (robot.model, robot.display_model)
    ]
    for name in robot.frames:
        if all(name in names for names in carried):
            yield name


def _ahead(robot: Robot, name: str) -> float:
    return float(robot.model.frames[robot.frame_id(name)].placement.translation[0])


@dataclass(frozen=True, eq=False)
class HandsPath:
    """A reference as the file has it, how long it takes (s), and a line on it."""

    reference: dict[str, Any]
    duration: float
    why: str


def paths(robot: Robot, axes: str, place: Array) -> Iterator[HandsPath]:
    """Circles on the ground for a platform that drives, else lines, from `place`, m, along `axes` of xyz."""
    drives = robot.platform.n_p > 0
    size = float(np.clip(robot.reach, 0.1, 2.0))
    for speed in _SPEEDS:
        if drives and "x" in axes and "y" in axes:
            yield from (_circle(place, share * max(size, 0.3), speed) for share in _RADII)
        for share in _LENGTHS if drives else _FIXED:
            for axis in range(len(axes)):
                for sign in (1.0, -1.0):
                    yield _line(axes, place, axis, sign * share * size, speed * size)


def _circle(place: Array, radius: float, speed: float) -> HandsPath:
    radius, rate = _rounded(radius), _rounded(speed / radius)
    center = [place[0], place[1] + radius, *place[2:]]
    keys = {"center": _places(center), "radius": radius, "rate": rate, "phase": "-pi/2", "run_up": _RUN_UP}
    why = "it begins at rest where the end-effector is, straight ahead, and bends to the left"
    return HandsPath({"kind": "circle", **keys}, _lasting(2 * math.pi / rate), why)


def _line(axes: str, place: Array, axis: int, length: float, speed: float) -> HandsPath:
    end = place.copy()
    end[axis] += length
    duration = _lasting(2 * abs(length) / speed)
    keys = {"start": _places(place), "end": _places(end), "duration": duration, "profile": "smooth"}
    why = f"it begins where the end-effector is, and goes along {axes[axis]}"
    return HandsPath({"kind": "line", **keys}, duration, why)


def _lasting(duration: float) -> float:
    return float(np.clip(round(duration), _LEAST, _MOST))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def _places(point: Sequence[float] | Array) -> list[float]:
    """To a tenth of a millimetre, m, without -0."""
    return [round(float(value), 4) + 0.0 for value in point]
