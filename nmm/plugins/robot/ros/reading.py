"""What ROS 2's messages say, in nmm's terms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, increasing, vector
from nmm.base.errors import InputError, expect
from nmm.model.robots.robot import Robot

#: A platform whose z axis leans more, rad, is not read as one on level ground.
TILT = 0.2
#: How far from 1 the length of a quaternion may be that was rounded on its way.
UNIT = 1e-3
#: No coordinate, m or rad, and no rate of a robot is larger; far beyond, squares and differences overflow.
FARTHEST = 1e9


def stamp(message: Any) -> float:
    """The time of a message's header, s; of a TFMessage that of its first transform.

    Raises
    ------
    InputError : it has none

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> nmm.ros.stamp(Message(header=Message(stamp=Message(sec=3, nanosec=500_000_000))))
    3.5
    """
    return nanoseconds(message) / 1e9


def nanoseconds(message: Any) -> int:
    first = next(iter(getattr(message, "transforms", ())), message)
    time = first if hasattr(first, "sec") else getattr(getattr(first, "header", first), "stamp", None)
    if time is None:
        raise InputError(where=name_of(message), expected="a message with a header: it says no time")
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def joints(message: Any) -> dict[str, float]:
    """Positions of a JointState by joint, rad or m, for `Robot.q_from`; empty where it has velocities alone.

    Raises
    ------
    InputError : not a position for each name, a name twice, a number that is not finite

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> nmm.ros.joints(Message(name=["q2", "q1"], position=[0.5, 0.1], velocity=[]))
    {'q2': 0.5, 'q1': 0.1}
    """
    _field(message, "name")
    others = len(getattr(message, "velocity", ())) or len(getattr(message, "effort", ()))
    return {} if others and not len(message.position) else _by_name(message, "position")


def rates(message: Any) -> dict[str, float]:
    """Velocities of a JointState by joint, rad/s or m/s; empty where it has none. Errors as of `joints`.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> nmm.ros.rates(Message(name=["q1"], position=[0.1], velocity=[]))
    {}
    """
    return _by_name(message, "velocity") if len(_field(message, "velocity")) else {}


def placement(message: Any) -> Array:
    """The pose (4, 4), m, of a Pose, PoseStamped, PoseWithCovarianceStamped, Odometry, Transform or
    TransformStamped, in the frame of its header.

    Raises
    ------
    InputError : no pose; a number that is not finite; a quaternion whose length is not 1 (a message that
        nobody filled has zeros)

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> pose = M(position=M(x=1.0, y=2.0, z=0.0), orientation=M(x=0.0, y=0.0, z=1.0, w=0.0))
    >>> nmm.ros.placement(pose)[:3, 3], nmm.ros.base(pose).round(3)
    (array([1., 2., 0.]), array([1.   , 2.   , 3.142]))
    """
    numbers = pose_numbers(message)
    return _placed(numbers[:3], numbers[3:], name_of(message))


def pose_numbers(message: Any) -> tuple[float, ...]:
    """x, y, z, m, and a quaternion x, y, z, w of a message's pose, as they are."""
    part = message
    while (inner := getattr(part, "pose", None) or getattr(part, "transform", None)) is not None:
        part = inner
    at = getattr(part, "position", None) or getattr(part, "translation", None)
    turn = getattr(part, "orientation", None) or getattr(part, "rotation", None)
    if at is None or turn is None:
        raise InputError(where=name_of(message), expected="a message with a pose or a transform")
    return at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w


def lost(rows: Array) -> Flags:
    """Which rows (N, 3) or (N, 7) of places and quaternions tell nothing: numbers that are none, or a
    quaternion of zeros, as trackers send them of a target that is hidden."""
    none = np.isnan(rows).any(axis=1)
    return np.asarray(none | ~rows[:, 3:].any(axis=1) if rows.shape[1] > 3 else none)


def placements(rows: Array, where: str) -> Array:
    """Poses (N, 4, 4) of rows (N, 7): x, y, z, m, and a quaternion x, y, z, w. Errors as of `placement`."""
    place, turn = rows[:, :3], rows[:, 3:]
    lengths = np.linalg.norm(turn, axis=1)
    with np.errstate(invalid="ignore"):
        good = (np.abs(lengths - 1.0) <= UNIT) & (np.abs(place) <= FARTHEST).all(axis=1)
    for k in np.flatnonzero(~good).tolist():  # the next may be worse: by a last bit one is good after all
        _placed(tuple(place[k].tolist()), tuple(turn[k].tolist()), where)
    x, y, z, w = turn.T / lengths
    made = np.zeros((len(rows), 4, 4))
    made[:, 0, :3] = np.array([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]).T
    made[:, 1, :3] = np.array([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]).T
    made[:, 2, :3] = np.array([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]).T
    made[:, :3, 3], made[:, 3, 3] = place, 1.0
    return made


def _placed(at: tuple[float, ...], turn: tuple[float, ...], where: str) -> Array:
    # One number at a time: arrays of three or four take ten times as long.
    x, y, z, w = _numbers(turn, where, "orientation")
    length = math.hypot(x, y, z, w)
    expect(abs(length - 1.0) <= UNIT, f"{where}: orientation", "a quaternion of length 1", length)
    x, y, z, w = x / length, y / length, z / length, w / length
    place = _numbers(at, where, "position")
    _expect_reached(place, f"{where}: position", "m")
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), place[0]],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), place[1]],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), place[2]],
        [0.0, 0.0, 0.0, 1.0],
    ])  # fmt: skip


def _numbers(values: tuple[float, ...], where: str, part: str) -> Sequence[float]:
    if all(type(value) is float and math.isfinite(value) for value in values):
        return values
    return list(vector(list(values), len(values), f"{where}: {part}").tolist())


def _expect_reached(values: Sequence[float], where: str, unit: str) -> None:
    if any(abs(value) > FARTHEST for value in values):
        raise InputError(where=where, expected=f"at most {FARTHEST:g} {unit}", got=list(values))


def base(message: Any, frame: str | None = None, child: str | None = None) -> Array:
    """x, y, theta (3,) of a platform's pose, m and rad, θ within ±π, for `Robot.q_from`.

    Parameters
    ----------
    message : as for `placement`
    frame : in which the pose has to be, by its header: "map" or "odom"; None for any
    child : whose pose it has to be, where the message says so: the robot's root link; None for any

    Raises
    ------
    InputError : another frame; a platform that leans by more than 0.2 rad; the causes of `placement`

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> pose = M(position=M(x=1.0, y=2.0, z=0.0), orientation=M(x=0.0, y=0.0, z=0.0, w=1.0))
    >>> nmm.ros.base(M(header=M(frame_id="odom"), pose=pose), frame="map")
    Traceback (most recent call last):
        ...
    nmm.base.errors.InputError: SimpleNamespace: header.frame_id: expected 'map', got 'odom'
    """
    where, header = name_of(message), getattr(message, "header", None)
    frame_id, about = getattr(header, "frame_id", None), getattr(message, "child_frame_id", None)
    if frame is not None and frame_id is not None:
        expect(plain(frame_id) == plain(frame), f"{where}: header.frame_id", f"{frame!r}", frame_id)
    if child is not None and about is not None:
        expect(plain(about) == plain(child), f"{where}: child_frame_id", f"{child!r}", about)
    return planar(placement(message), where)


def base_covariance(message: Any) -> Array:
    """(3, 3) of x, y, theta, m and rad, in the axes of the header's frame, for `PoseFilter.fix`: of a
    PoseWithCovariance, PoseWithCovarianceStamped or Odometry.

    Raises
    ------
    InputError : no covariance of 36 finite numbers; one that begins with -1, which is not known

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> nmm.ros.base_covariance(M(pose=M(covariance=np.eye(6).ravel())))[2]
    array([0., 0., 1.])
    """
    where, part = f"{name_of(message)}: covariance", message
    while getattr(part, "covariance", None) is None and getattr(part, "pose", None) is not None:
        part = part.pose
    numbers = getattr(part, "covariance", None)
    expect(numbers is not None, where, "a message with a covariance", None)
    full = vector(np.asarray(numbers, dtype=np.float64), 36, where).reshape(6, 6)
    expect(full[0, 0] >= 0.0, where, "one that is known", "-1")
    return full[np.ix_([0, 1, 5], [0, 1, 5])]


def planar(pose: Array, where: str) -> Array:
    """x, y, theta of a pose (4, 4)."""
    leans = math.acos(min(1.0, max(-1.0, float(pose[2, 2]))))
    expect(leans <= TILT, f"{where}: orientation", f"a platform on level ground (within {TILT} rad)", leans)
    return np.array([pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])])


def planar_rows(poses: Array, where: str) -> Array:
    """The same of poses (N, 4, 4): (N, 3)."""
    lowest = int(np.argmin(poses[:, 2, 2]))
    planar(poses[lowest], where)
    return np.column_stack([poses[:, :2, 3], np.arctan2(poses[:, 1, 0], poses[:, 0, 0])])


def twist(message: Any) -> Array:
    """(3,) the platform's velocity along its own x and y, m/s, and about z, rad/s, of a Twist, a TwistStamped
    or an Odometry (whose twist is in its child's axes).

    Raises
    ------
    InputError : no twist, a number that is not finite

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> nmm.ros.twist(M(linear=M(x=0.5, y=0.0, z=0.0), angular=M(x=0.0, y=0.0, z=0.2)))
    array([0.5, 0. , 0.2])
    """
    linear, angular = velocities(message)
    return vector([linear[0], linear[1], angular[2]], 3, f"{name_of(message)}: twist")


def velocities(message: Any) -> tuple[Array, Array]:
    """The linear (3,) and angular (3,) velocity of a message with a twist, whatever they are."""
    part = message
    while (inner := getattr(part, "twist", None)) is not None:
        part = inner
    linear, angular = getattr(part, "linear", None), getattr(part, "angular", None)
    if linear is None or angular is None:
        raise InputError(where=name_of(message), expected="a message with a twist")
    rates = linear.x, linear.y, linear.z, angular.x, angular.y, angular.z
    _expect_reached(rates, f"{name_of(message)}: twist", "m/s and rad/s")
    both = np.array(rates)
    return both[:3], both[3:]


def inputs(robot: Robot, q: ArrayLike, velocity: ArrayLike, joint_rates: Mapping[str, float]) -> Array:
    """u (n_u,) at q of a platform's twist (3,), as of `twist`, and rates of joints by name, rad/s or m/s: the
    nearest to both by least squares, since wheels admit fewer motions than a message may ask for.

    Raises
    ------
    InputError : the rate of a joint is missing or not finite

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> nmm.ros.inputs(robot, robot.rest, [0.5, 0.0, 0.2], {"q1": 0.1, "q2": 0.0}).round(3)
    array([0.5, 0.2, 0.1, 0. ])
    """
    at = robot.q(q)
    q_dot = np.zeros(robot.n)
    first = min(3, robot.platform.n_p)
    for i, name in enumerate(robot.q_names[first:], first):
        if name in joint_rates:
            q_dot[i] = robot.gear(name)[0] * float(joint_rates[name])
        elif i >= robot.platform.n_p and i in robot.following.independent:
            raise InputError(f"no rate of {name}", where=f"inputs: {robot.name}")
    known = np.array([i < first or name in joint_rates for i, name in enumerate(robot.q_names)])
    if first:
        vx, vy, omega = vector(velocity, 3, "velocity")
        c, s = math.cos(at[2]), math.sin(at[2])
        q_dot[:3] = c * vx - s * vy, s * vx + c * vy, omega
    u = np.linalg.lstsq(robot.S(at)[known], vector(q_dot, robot.n, "joint_rates")[known], rcond=None)[0]
    return np.asarray(u)


def joint_trajectory(message: Any) -> tuple[Array, dict[str, Array]]:
    """Times (N,), s from its start, and positions (N,) by joint, rad or m, of a JointTrajectory: what the
    joints' encoders read then, so that of a robot with corrections `Robot.q_from` makes coordinates of them.

    Raises
    ------
    InputError : no points; not a position for each joint; times that do not ascend

    Examples
    --------
    >>> from rosbags.typesys import Stores, get_typestore
    >>> types = get_typestore(Stores.ROS2_HUMBLE).types
    >>> robot = nmm.load("unicycle_2r")
    >>> message = nmm.ros.Messages(robot, types).joint_trajectory([0, 1], [robot.rest, robot.q({"q1": 0.5})])
    >>> nmm.ros.joint_trajectory(message)
    (array([0., 1.]), {'q1': array([0. , 0.5]), 'q2': array([0., 0.])})
    """
    where, names, points = name_of(message), [*message.joint_names], [*message.points]
    expect(points, where, "at least one point")
    expect(len({*names}) == len(names), f"{where}: joint_names", "each joint once", names)
    times = np.array([nanoseconds(point.time_from_start) / 1e9 for point in points])
    increasing(times, f"{where}: time_from_start")
    rows = [
        vector(np.asarray(point.positions), len(names), f"{where}: points.{i}.positions")
        for i, point in enumerate(points)
    ]
    return times, dict(zip(names, np.array(rows).T, strict=True))


def _by_name(message: Any, part: str) -> dict[str, float]:
    where, names = name_of(message), [*_field(message, "name")]
    values = _field(message, part)
    expect(len({*names}) == len(names), f"{where}: name", "each joint once", names)
    expect(
        len(values) == len(names), f"{where}: {part}", f"{len(names)} numbers, as many as names", len(values)
    )
    for name, value in zip(names, values, strict=True):
        expect_reached(value, f"{where}: {part} of {name}")
    return {str(name): float(value) for name, value in zip(names, values, strict=True)}


def _field(message: Any, name: str) -> Sequence[Any]:
    if not hasattr(message, name):
        raise InputError(where=name_of(message), expected=f"a message with the field {name}")
    values: Sequence[Any] = getattr(message, name)
    return values


def is_reached(value: float) -> bool:
    """Whether a coordinate or a rate may be a robot's."""
    return abs(value) <= FARTHEST


def expect_reached(value: float, where: str) -> None:
    """`InputError` for what cannot be a robot's coordinate or rate."""
    expected = f"a number up to {FARTHEST:g}" if math.isfinite(value) else "a finite number"
    expect(is_reached(value), where, expected, float(value))


def name_of(message: Any) -> str:
    return str(getattr(message, "__msgtype__", type(message).__name__))


def plain(frame: str) -> str:
    """A frame's name as ROS 2 writes it: that of ROS 1 may begin with a slash."""
    return frame.lstrip("/")
