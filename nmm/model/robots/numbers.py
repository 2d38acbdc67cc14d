"""A robot's numbers that can be learned from logs: wheels' radii, lengths, how joints are read, where they
are."""

from __future__ import annotations

import math
import statistics
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import pinocchio as pin

from nmm.base.arrays import positive, scalar
from nmm.base.errors import InputError, expect, expect_kind, expect_known, one_or_several
from nmm.base.findings import Finding
from nmm.model.platforms import DifferentialDrive, Mecanum, SkidSteer, SteeredWheel, WheeledPlatform
from nmm.model.platforms.wheel_layout import NEAR
from nmm.model.robots.number_change import Length, RobotChange
from nmm.model.robots.number_lengths import lengths_of, main_wheels
from nmm.model.robots.origins import (
    ORIGIN,
    PARTS,
    arm_joints,
    check_frame,
    joint_parts,
    listed_frames,
    movable_frames,
    origin_parts,
    placed_by,
    with_origins,
)
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates

#: Parts of a number's name before that of its joint.
RADIUS, OFFSET, RATIO = "radius.", "offset.", "ratio."
#: Of platforms whose inputs are speeds of wheels that have one radius, where the file shows no wheels.
COMMON = "radius"
#: Platforms whose inputs are speeds of wheels, of one radius.
OF_SPEEDS = DifferentialDrive | SkidSteer | Mecanum


@dataclass(frozen=True)
class RobotNumber:
    """A number of a robot.

    Attributes
    ----------
    value : what the robot has; nominal : what its file says, or `load` was told
    unit : "m", "rad" or "1"
    kind : "radius", "track", "wheelbase", "distance" (of wheels from the reference point), "centre" (of
        rotation), "hitch" (a trailer's), "offset", "ratio", "origin"
    of : the wheel's, the steered or the arm's joint, or the frame; "" for the platform's

    Examples
    --------
    >>> number = nmm.robot_numbers(nmm.load("differential_base"))["radius.left_wheel_joint"]
    >>> number.value, number.unit, number.kind, number.of
    (0.1, 'm', 'radius', 'left_wheel_joint')
    """

    value: float
    nominal: float
    unit: str
    kind: str
    of: str = ""


def robot_numbers(robot: Robot, frames: str | Sequence[str] = ()) -> dict[str, RobotNumber]:
    """A robot's numbers that say how it moves by what its wheels and joints turn, by name, in a fixed order:

    - ``radius.<joint>``, of each wheel whose turning the platform's motion determines, m (``radius``, of all,
      where the file shows no wheels)
    - ``track``, from the wheels at the right to those at the left, where these roll ahead and do not steer, m
    - ``wheelbase``, from the axle to the steered wheel, or to the mean of several, m
    - ``half_length_plus_width``, of mecanum wheels, half the sum of length and width, m
    - ``wheel_distance``, mean distance of other wheels from the reference point, m
    - ``left``, ``right``, ``ahead``: y, y and x of skid-steering's centres of rotation, m
    - ``H``, ``L``, or ``H1``, ``L1``, ... of a tractor's trailers as in its formulas: hitch behind the axle
      in front, and from hitch to axle, m; of a platform described by its wheels ``hitch.<joint>`` and
      ``length.<joint>``
    - ``offset.<joint>``, ``ratio.<joint>``, rad or m, and 1, of steering angles and the arm's joints:
      coordinate = ratio * reading + offset, the reading with the sign that the coordinate has; a ratio of -1
      is a gear the other way round
    - ``origin.<joint>.x``, ``y``, ``z``, ``roll``, ``pitch``, ``yaw``, m and rad, 0 by the file: an arm's
      joint is placed as the file has it, times SE3(rpy, xyz), in its own axes there; without that about (or
      along) its axis where this is an axis of its frame, which its offset says
    - ``origin.<frame>.x``, ... ``yaw``, the same of a frame, with all that is fixed to it and joints behind

    Parameters
    ----------
    frames : further frames (a camera, a tool, an arm's mount) that are to be listed, and that a fixed joint
        of the file places; those that the robot has elsewhere than its file are listed anyway

    Raises
    ------
    InputError : no robot, an unknown frame, one that no fixed joint places or that the wheels are on

    Examples
    --------
    >>> [*nmm.robot_numbers(nmm.load("differential_base"))]
    ['radius.left_wheel_joint', 'radius.right_wheel_joint', 'track']
    """
    expect_kind(robot, Robot, "robot", "a Robot, as nmm.load gives it")
    found: dict[str, tuple[float, str, str, str]] = {}
    for joint, radius in _radii(robot).items():
        found[RADIUS + joint] = radius, "m", "radius", joint
    if isinstance(robot.platform, OF_SPEEDS) and not main_wheels(robot):
        found[COMMON] = float(robot.platform.radius), "m", "radius", ""
    for name, length in lengths_of(robot).items():
        found[name] = length.value, "m", length.kind, ""
    joints = arm_joints(robot)
    for joint in (*steered_joints(robot), *joints):
        ratio, offset = robot.corrections.get(joint, (1.0, 0.0))
        found[OFFSET + joint] = offset, robot.q_units[robot.q_names.index(joint)], "offset", joint
        found[RATIO + joint] = ratio, "1", "ratio", joint
        if joint in joints:
            found |= origin_parts(robot, joint, joint_parts(robot, joint))
    for frame in listed_frames(robot, joints, one_or_several(frames, str, "frames", "names of frames")):
        found |= origin_parts(robot, frame, PARTS)
    return {
        name: RobotNumber(value, robot.nominal.get(name, value), *rest)
        for name, (value, *rest) in found.items()
    }


def with_numbers(robot: Robot, values: Mapping[str, float]) -> Robot:
    """The same robot with some of its numbers changed (`robot_numbers`): its wheels, platform, joints and
    frames move by them, and `robot.nominal` keeps what its file says.

    Inputs that are wheel speeds of one radius take the mean of the wheels', so that they keep their meaning.
    Limits of a joint with an offset or a ratio are those of its readings. Shapes of the platform stay as they
    are drawn; those of the arm go with their links. With what its file says (`robot.nominal`), joints and
    frames of the arm are where they were, bit for bit, all else to the last digits.

    Parameters
    ----------
    values : by name, m, rad or 1; those not named stay; of any frame, listed or not

    Raises
    ------
    InputError : an unknown name, a number that is not finite or out of range: a length that is not above
        zero, a ratio of zero, an angle of more than half a turn, centres of rotation in the wrong order

    Examples
    --------
    >>> robot = nmm.with_numbers(nmm.load("differential_base"), {"track": 0.56})
    >>> robot.platform.track, dict(robot.nominal)
    (0.56, {'track': 0.5})
    """
    expect_kind(robot, Robot, "robot", "a Robot, as nmm.load gives it")
    where = f"with_numbers: {robot.name}"
    expect_kind(values, Mapping, where, "a value for each number's name")
    numbers = numbers_for(robot, values)
    for name in values:
        _check_name(robot, name, numbers, where)
    lengths = lengths_of(robot)
    checked = {name: _checked(name, numbers[name], lengths.get(name), values[name], where) for name in values}
    changed = {name: value for name, value in checked.items() if value != numbers[name].value}
    if not changed:
        return robot
    draft = RobotChange(robot)
    _resize(draft, {numbers[name].of: v for name, v in changed.items() if name.startswith(RADIUS)})
    if COMMON in changed:
        setattr(draft.platform, COMMON, changed[COMMON])
    for name, length in lengths.items():
        if name in changed:
            length.change(draft, changed[name])
    if isinstance(draft.platform, SkidSteer):
        left, right = draft.platform.left, draft.platform.right
        expect(left > right, f"{where}: left, right", "left above right, y in m", (left, right))
    corrections = {
        joint: (changed.get(RATIO + joint, ratio), changed.get(OFFSET + joint, offset))
        for joint in (*steered_joints(robot), *arm_joints(robot))
        for ratio, offset in (robot.corrections.get(joint, (1.0, 0.0)),)
    }
    corrections = {joint: pair for joint, pair in corrections.items() if pair != (1.0, 0.0)}
    nominal = {name: numbers[name].nominal for name in numbers if name in (*robot.nominal, *changed)}
    nominal = {name: own for name, own in nominal.items() if changed.get(name, math.nan) != own}
    made, origins = draft.made(), _origins(numbers, changed)
    for name in [name for name in lengths if name not in lengths_of(made)]:
        expected = f"more than {2.0 * NEAR:g} m: wheels that are nearer are taken for one"
        raise InputError(where=f"{where}: {name}", expected=expected, got=changed.get(name))
    if origins != robot.origins:
        made = with_origins(made, origins)
    return _read_by(made, corrections, nominal)


def numbers_for(robot: Robot, names: Collection[str]) -> dict[str, RobotNumber]:
    """`robot_numbers` with the frames that these names of numbers speak of, as far as it has such."""
    joints = arm_joints(robot)
    frames = dict.fromkeys(placed_by(name) for name in names)
    asked = [frame for frame in frames if frame and frame not in joints and frame not in robot.origins]
    movable = movable_frames(robot) if asked else ()
    return robot_numbers(robot, [frame for frame in asked if frame in movable])


def prefixed(name: str, prefix: str) -> str:
    """A number's name where its joint or frame has a prefix before its own; of other numbers this name."""
    kind, dot, of = name.partition(".")
    return f"{kind}.{prefix}{of}" if dot and f"{kind}." in (OFFSET, RATIO, ORIGIN) else name


def changed_numbers(robot: Robot) -> dict[str, float]:
    """See `Robot.changed_numbers`."""
    numbers = robot_numbers(robot) if robot.nominal else {}
    return {name: numbers[name].value for name in robot.nominal}


def without_changes(robot: Robot) -> Robot:
    """The robot with the numbers of its file."""
    return with_numbers(robot, robot.nominal)


def steered_joints(robot: Robot) -> tuple[str, ...]:
    """The coordinates that are steering angles: their rates are inputs, or follow from others'."""
    own = robot.q_names[3 : robot.platform.n_p]
    moved = {robot.q_names[i] for i in robot.rate_coordinates[: robot.platform.p] if i >= 3}
    if isinstance(robot.platform, WheeledPlatform):
        moved |= {wheel.joint for wheel in robot.platform.wheels if isinstance(wheel, SteeredWheel)}
        moved -= {hitch.joint for hitch in robot.platform.hitches}
    return tuple(name for name in own if name in moved)


def _check_name(robot: Robot, name: str, numbers: Mapping[str, RobotNumber], where: str) -> None:
    if name not in numbers and (frame := placed_by(name)) and frame not in arm_joints(robot):
        check_frame(robot, frame, f"{where}: {name}")
    expect_known("number", name, numbers, where)


def _origins(
    numbers: Mapping[str, RobotNumber], changed: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Of all joints and frames that are elsewhere than in the file."""
    found: dict[str, dict[str, float]] = {}
    for name, number in numbers.items():
        if number.kind == "origin":
            found.setdefault(number.of, {})[name.rpartition(".")[2]] = changed.get(name, number.value)
    rows = {of: tuple(parts.get(part, 0.0) for part in PARTS) for of, parts in found.items()}
    return {of: row for of, row in rows.items() if any(row)}


def _radii(robot: Robot) -> dict[str, float]:
    names, _ = wheel_rates(robot)
    return {wheel.joint: float(wheel.radius) for wheel in robot.wheels if wheel.joint in names}


def _checked(name: str, number: RobotNumber, length: Length | None, value: float, where: str) -> float:
    at = f"{where}: {name}"
    if length is not None:
        return scalar(value, at, above=length.least)
    if number.kind == "radius":
        return positive(value, at)
    if number.kind in ("offset", "origin"):
        most = math.pi if number.unit == "rad" else math.inf
        return scalar(value, at, least=-most, most=most)
    ratio = scalar(value, at)
    if ratio == 0.0:
        raise InputError(where=at, expected="a number other than 0", got=ratio)
    return ratio


def _resize(draft: RobotChange, radii: Mapping[str, float]) -> None:
    """Wheels get other radii, m, and a platform that has one for all the mean of those on its main body."""
    main = [wheel.joint for wheel in main_wheels(draft.robot)]
    before = [draft.wheels[joint].radius for joint in main]
    for joint, radius in radii.items():
        draft.resize(joint, radius)
    if main and isinstance(draft.platform, OF_SPEEDS):
        after = [draft.wheels[joint].radius for joint in main]
        draft.platform.radius *= statistics.mean(after) / statistics.mean(before)


def _read_by(
    robot: Robot, corrections: Mapping[str, tuple[float, float]], nominal: Mapping[str, float]
) -> Robot:
    """The robot whose joints are read so, with limits of the coordinates as of the readings."""
    models = {"model": robot.model, "display_model": robot.display_model}
    if corrections != robot.corrections:
        models = {name: model.copy() for name, model in models.items()}
        for joint in {*corrections, *robot.corrections}:
            before, after = (of.get(joint, (1.0, 0.0)) for of in (robot.corrections, corrections))
            for model in models.values():
                _relimit(model, joint, before, after)
    made = replace(robot, **robot.shapes._asdict(), **models, corrections=corrections, nominal=nominal)
    told = {name: [nominal[name], value] for name, value in changed_numbers(made).items()}
    notes = (*(note for note in robot.notes if note.code != "calibrated"),)
    notes += (Finding("calibrated", {"numbers": told}),) if told else ()
    return replace(made, **made.shapes._asdict(), notes=notes)


def _relimit(model: pin.Model, joint: str, before: tuple[float, float], after: tuple[float, float]) -> None:
    if not model.existJointName(joint):
        return
    found = model.joints[model.getJointId(joint)]
    i, v = found.idx_q, found.idx_v
    ends = [
        after[0] * (float(end[i]) - before[1]) / before[0] + after[1]
        for end in (model.lowerPositionLimit, model.upperPositionLimit)
    ]
    model.lowerPositionLimit[i], model.upperPositionLimit[i] = sorted(ends)
    model.velocityLimit[v] *= abs(after[0] / before[0])
