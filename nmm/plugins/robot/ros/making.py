"""ROS 2's messages of what nmm computes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, matrix, scalar, vector
from nmm.base.errors import InputError, expect
from nmm.model.robots.robot import Robot
from nmm.views.playback.placements import position_and_quaternion


class Rclpy(Mapping[str, type]):
    """The classes of rclpy's messages by their names ("geometry_msgs/msg/Twist"), imported when asked for."""

    def __getitem__(self, name: str) -> type:
        package, _, kind = name.split("/")
        try:
            message_class: type = getattr(import_module(f"{package}.msg"), kind)
        except ImportError:
            what = f"{package} of ROS 2 is not on Python's path: source its setup file, or give types"
            raise InputError(what, where="nmm.ros.Messages") from None
        return message_class

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


class Messages:
    """Makes messages of one robot's motion.

    Parameters
    ----------
    robot : whose
    types : the classes by name; rclpy's when not given, or `rosbags.typesys.get_typestore(...).types`
    odom, base : names of the frames (REP-105); the base is the robot's root link by default
    start : the clock's time at t = 0, s, added in whole nanoseconds: a float of this century's seconds holds
        0.2 µs

    Examples
    --------
    >>> from rosbags.typesys import Stores, get_typestore
    >>> types = get_typestore(Stores.ROS2_HUMBLE).types
    >>> robot = nmm.load("unicycle_2r")
    >>> messages = nmm.ros.Messages(robot, types)
    >>> messages.twist(robot.rest, [0.5, 0.2, 0, 0]).linear.x
    0.5
    >>> messages.joint_state(1.5, robot.q({"q1": 0.3})).name
    ['q1', 'q2']
    """

    def __init__(
        self,
        robot: Robot,
        types: Mapping[str, Any] | None = None,
        *,
        odom: str = "odom",
        base: str | None = None,
        start: float = 0.0,
    ) -> None:
        self.robot, self.odom, self.start = robot, odom, in_nanoseconds(start)
        self.base = root_link(robot) if base is None else base
        self.types = Rclpy() if types is None else types
        self._first = min(3, robot.platform.n_p)

    def joint_state(
        self,
        t: float,
        q: ArrayLike,
        q_dot: ArrayLike | None = None,
        wheels: Mapping[str, tuple[float, float]] | None = None,
    ) -> Any:
        """A JointState at t, s: the joints of q (n,), without x, y, theta, and their rates q_dot (n,) where
        given; angle and rate of further joints, rad and rad/s. Signs are the file's, and corrections of the
        robot's joints (`nmm.with_numbers`) are taken out again: what their encoders read."""
        more = {} if wheels is None else wheels
        names = [*joint_names(self.robot), *more]
        position = [*readings(self.robot, self.robot.q(q)), *(float(angle) for angle, _ in more.values())]
        rates: list[float] = []
        if q_dot is not None:
            rates = readings(self.robot, vector(q_dot, self.robot.n, "q_dot"), rates=True)
            rates += (float(rate) for _, rate in more.values())
        return self._joint_state(t, names, position, rates)

    def inputs(self, t: float, u: ArrayLike) -> Any:
        """A JointState whose velocities are the inputs u (n_u,), by their names."""
        u = vector(u, self.robot.n_u, "u")
        return self._joint_state(t, [*self.robot.u_names], [], u.tolist())

    def odometry(
        self, t: float, q: ArrayLike, q_dot: ArrayLike | None = None, covariance: ArrayLike | None = None
    ) -> Any:
        """An Odometry at t, s, of the platform at q (n,): pose in odom, twist along the base's axes, zero
        without q_dot (n,); the covariance (3, 3) of x, y, theta. One that is not known begins with -1, as
        sensor_msgs/Imu says it: zeros would be exact to a filter. That of the twist is never known."""
        q, unknown = self.robot.q(q), np.zeros((6, 6))
        unknown[0, 0] = -1.0
        spread = unknown if covariance is None else np.zeros((6, 6))
        if covariance is not None:
            spread[np.ix_([0, 1, 5], [0, 1, 5])] = matrix(covariance, (3, 3), "covariance")
        velocity = np.zeros(3)
        if q_dot is not None:
            velocity = body_twist(self.robot, q, vector(q_dot, self.robot.n, "q_dot"))
        pose = self._pose(*planar_pose(q[:3] if self._first else np.zeros(3)))
        covariances = [self._floats(block.ravel()) for block in (spread, unknown)]
        kinds = [f"geometry_msgs/msg/{name}WithCovariance" for name in ("Pose", "Twist")]
        return self._made(
            "nav_msgs/msg/Odometry",
            header=self._header(t, self.odom),
            child_frame_id=self.base,
            pose=self._made(kinds[0], pose=pose, covariance=covariances[0]),
            twist=self._made(kinds[1], twist=self._twist(velocity), covariance=covariances[1]),
        )

    def transforms(self, t: float, q: ArrayLike, map_to_odom: ArrayLike | None = None) -> Any:
        """A TFMessage at t, s: the base in odom at q (n,), and odom in map at a pose (3,) where it is given
        (`PoseFilter.map_to_odom`; q has `PoseFilter.odom` then)."""
        q = self.robot.q(q)
        at = planar_pose(q[:3] if self._first else np.zeros(3))
        edges = [(t, self.odom, self.base, *at)]
        if map_to_odom is not None:
            edges.insert(0, (t, "map", self.odom, *planar_pose(vector(map_to_odom, 3, "map_to_odom"))))
        return self.tf(edges)

    def tf(self, found: Sequence[tuple[float, str, str, Array, Array]]) -> Any:
        """A TFMessage of (t, frame, child, position (3,), quaternion (4,) x y z w)."""
        made = [
            self._made(
                "geometry_msgs/msg/TransformStamped",
                header=self._header(t, frame),
                child_frame_id=child,
                transform=self._made(
                    "geometry_msgs/msg/Transform",
                    translation=self._made("geometry_msgs/msg/Vector3", **_xyz(position)),
                    rotation=self._made("geometry_msgs/msg/Quaternion", **_xyzw(turn)),
                ),
            )
            for t, frame, child, position, turn in found
        ]
        return self._made("tf2_msgs/msg/TFMessage", transforms=made)

    def twist(self, q: ArrayLike, u: ArrayLike) -> Any:
        """A Twist (cmd_vel) of the inputs u (n_u,) at q (n,), along the base's axes."""
        q = self.robot.q(q)
        return self._twist(body_twist(self.robot, q, self.robot.S(q) @ vector(u, self.robot.n_u, "u")))

    def twist_stamped(self, t: float, q: ArrayLike, u: ArrayLike) -> Any:
        """The same with the time t, s, in the base's frame."""
        return self._made(
            "geometry_msgs/msg/TwistStamped", header=self._header(t, self.base), twist=self.twist(q, u)
        )

    def pose(self, t: float, placement: ArrayLike, frame: str | None = None) -> Any:
        """A PoseStamped of a pose (4, 4), m, in a frame, odom by default."""
        at, turn = position_and_quaternion(matrix(placement, (4, 4), "placement"))
        return self._pose_stamped(t, at, turn, frame or self.odom)

    def path(self, t: float, points: ArrayLike, frame: str | None = None) -> Any:
        """A Path of points (N, 3), m, in a frame, odom by default."""
        rows = array(points, "points")
        expect(rows.ndim == 2 and rows.shape[1] == 3, "points", "points of shape (N, 3)", rows)
        upright = np.array([0.0, 0.0, 0.0, 1.0])
        poses = [self._pose_stamped(t, point, upright, frame or self.odom) for point in rows]
        return self._made("nav_msgs/msg/Path", header=self._header(t, frame or self.odom), poses=poses)

    def joint_trajectory(self, t: ArrayLike, q: ArrayLike, q_dot: ArrayLike | None = None) -> Any:
        """A JointTrajectory of the arm along q (N, n) at times t (N,), s, from the first of them on, with its
        rates where given: the platform's own joints and mimic joints are left out. Positions and rates are
        what the joints' encoders read then (`Robot.reading`), as their drivers take them."""
        robot, times = self.robot, vector(t, None, "t")
        columns, count = robot.arm_coordinates, len(times)
        names = [robot.q_names[i] for i in columns]
        factors, offsets = np.array([robot.gear(name) for name in names]).reshape(-1, 2).T
        rows = (matrix(q, (count, robot.n), "q")[:, columns] - offsets) / factors
        rates = None if q_dot is None else matrix(q_dot, (count, robot.n), "q_dot")[:, columns] / factors
        points = [
            self._made(
                "trajectory_msgs/msg/JointTrajectoryPoint",
                positions=self._floats(rows[k]),
                velocities=self._floats([] if rates is None else rates[k]),
                accelerations=self._floats([]),
                effort=self._floats([]),
                time_from_start=self._duration(times[k] - times[0]),
            )
            for k in range(count)
        ]
        return self._made(
            "trajectory_msgs/msg/JointTrajectory",
            header=self._header(0.0, ""),
            joint_names=names,
            points=points,
        )

    def text(self, text: str) -> Any:
        """A std_msgs String."""
        return self._made("std_msgs/msg/String", data=text)

    def numbers(self, values: ArrayLike, labels: Sequence[str]) -> Any:
        """A Float64MultiArray of k values with a label of all their names."""
        row = np.asarray(values, dtype=np.float64)
        dimension = self._made(
            "std_msgs/msg/MultiArrayDimension", label=",".join(labels), size=len(row), stride=len(row)
        )
        layout = self._made("std_msgs/msg/MultiArrayLayout", dim=[dimension], data_offset=0)
        return self._made("std_msgs/msg/Float64MultiArray", layout=layout, data=self._floats(row))

    def log(self, t: float, name: str, text: str) -> Any:
        """A Log line (/rosout) of the level INFO."""
        return self._made(
            "rcl_interfaces/msg/Log",
            stamp=self._time(t), level=20, name=name, msg=text, file="", function="", line=0,
        )  # fmt: skip

    def _joint_state(self, t: float, names: list[str], position: list[float], velocity: list[float]) -> Any:
        return self._made(
            "sensor_msgs/msg/JointState",
            header=self._header(t, ""),
            name=names,
            position=self._floats(position),
            velocity=self._floats(velocity),
            effort=self._floats([]),
        )

    def _twist(self, velocity: Array) -> Any:
        vx, vy, omega = velocity.tolist()
        linear, angular = (
            self._made("geometry_msgs/msg/Vector3", **_xyz(np.array(xyz)))
            for xyz in ([vx, vy, 0.0], [0.0, 0.0, omega])
        )
        return self._made("geometry_msgs/msg/Twist", linear=linear, angular=angular)

    def _pose(self, position: Array, turn: Array) -> Any:
        return self._made(
            "geometry_msgs/msg/Pose",
            position=self._made("geometry_msgs/msg/Point", **_xyz(position)),
            orientation=self._made("geometry_msgs/msg/Quaternion", **_xyzw(turn)),
        )

    def _pose_stamped(self, t: float, position: Array, turn: Array, frame: str) -> Any:
        pose = self._pose(position, turn)
        return self._made("geometry_msgs/msg/PoseStamped", header=self._header(t, frame), pose=pose)

    def _header(self, t: float, frame: str) -> Any:
        return self._made("std_msgs/msg/Header", stamp=self._time(t), frame_id=frame)

    def nanoseconds(self, t: float) -> int:
        """The clock's time at t, s, in nanoseconds."""
        return self.start + in_nanoseconds(t)

    def _time(self, t: float) -> Any:
        sec, nanosec = divmod(self.nanoseconds(t), 1_000_000_000)
        return self._made("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def _duration(self, t: float) -> Any:
        sec, nanosec = divmod(in_nanoseconds(t), 1_000_000_000)
        return self._made("builtin_interfaces/msg/Duration", sec=sec, nanosec=nanosec)

    def _floats(self, values: ArrayLike) -> Any:
        """Arrays where the classes are those of rosbags, lists where rclpy's, which refuse arrays."""
        row = np.array(values, dtype=np.float64)
        of_rosbags = hasattr(self.types["sensor_msgs/msg/JointState"], "__dataclass_fields__")
        return row if of_rosbags else row.tolist()

    def _made(self, kind: str, **fields: Any) -> Any:
        return self.types[kind](**fields)


def in_nanoseconds(t: float) -> int:
    """A time, s, in whole nanoseconds, as ROS counts."""
    return round(scalar(t, "t") * 1e9)


def root_link(robot: Robot) -> str:
    """The link at the platform's reference point, or "reference_point" where no link is; of a fixed base the
    link at its root, of a base of joints the one that they move."""
    base, frames = base_joint(robot), robot.model.frames
    links = (frame for frame in frames if frame.parentJoint == base and frame.type.name == "BODY")
    at_rest = [link for link in links if link.placement.isIdentity(1e-9) and link.name != "universe"]
    moved = [note.values["names"][-1] for note in robot.notes if note.code == "base_of_joints"]
    carried = (link.name for link in at_rest if frames[link.parentFrame].name in moved)
    return next(carried, at_rest[0].name if at_rest else "reference_point")


def base_joint(robot: Robot) -> int:
    """Pinocchio's index of the joint that carries the root link."""
    return int(robot.model.getJointId("theta")) if robot.platform.n_p else 0


def joint_names(robot: Robot) -> tuple[str, ...]:
    """The joints of q: all coordinates but the platform's x, y and theta."""
    return robot.q_names[min(3, robot.platform.n_p) :]


def readings(robot: Robot, values: Array, rates: bool = False) -> list[float]:
    """What the encoders of those joints read where a row like q (n,), or its rates, has these values."""
    names = joint_names(robot)
    pairs = zip(names, values[robot.n - len(names) :].tolist(), strict=True)
    if rates:
        return [value / robot.gear(name)[0] for name, value in pairs]
    return [robot.reading(name, value) for name, value in pairs]


def rolled_readings(
    robot: Robot, wheels: Mapping[str, tuple[float, float]], q: Array, q_dot: Array
) -> dict[str, tuple[float, float]]:
    """What the encoders of wheels and their swivels read, by joint, rad and rad/s: as they roll, and where a
    car's steering angle is corrected its swivels as that angle reads at q (n,) and q_dot (n,)."""
    read = robot.swivel_readings(q, q_dot) if robot.corrections else {}
    return {name: read.get(name, rolled) for name, rolled in wheels.items()}


def body_twist(robot: Robot, q: Array, q_dot: Array) -> Array:
    """(3,) the platform's velocity q_dot along its own x and y, and about z; zero of a fixed base."""
    if not robot.platform.n_p:
        return np.zeros(3)
    c, s = math.cos(q[2]), math.sin(q[2])
    return np.array([c * q_dot[0] + s * q_dot[1], c * q_dot[1] - s * q_dot[0], q_dot[2]])


def planar_pose(pose: Array) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) x y z w of x, y, theta (3,)."""
    x, y, theta = pose
    return np.array([x, y, 0.0]), np.array([0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2)])


def _xyz(values: Array) -> dict[str, float]:
    return dict(zip("xyz", values.tolist(), strict=True))


def _xyzw(values: Array) -> dict[str, float]:
    return dict(zip("xyzw", values.tolist(), strict=True))
