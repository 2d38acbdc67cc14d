"""A trajectory as a log of messages: an MCAP file that Foxglove, Rerun and ROS 2's tools open."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import Array, scalar
from nmm.errors import InputError, RobotError, expect
from nmm.files import replaceable, whole_file, written_at
from nmm.playback.placements import Placements, position_and_quaternion, rolling_joints
from nmm.playback.rolling import Rolling
from nmm.robots.loading.description import describe
from nmm.robots.loading.source import source_path
from nmm.ros.making import Messages, base_joint, planar_pose

if TYPE_CHECKING:
    from nmm.robots.robot import Robot
    from nmm.runs.trajectory import Trajectory

JOINTS, INPUTS, ODOMETRY, TWIST, ERROR = "/joint_states", "/inputs", "/odom", "/cmd_vel", "/error"
TF, TF_STATIC, EVENTS, DESCRIPTION = "/tf", "/tf_static", "/rosout", "/robot_description"
PATH, DESIRED = "/path", "/desired_path"
#: Topics whose last message is for whoever comes later.
LATCHED = (TF_STATIC, DESCRIPTION, PATH, DESIRED)
MAP = "map"
SUFFIX = ".mcap"
#: One message: nanoseconds, topic, message.
Timed = tuple[int, str, Any]


def rosbags(part: str) -> Any:
    """A module of the package rosbags; `InputError` says how to install it."""
    try:
        return import_module(f"rosbags.{part}")
    except ImportError:
        raise InputError("bags need the package rosbags: pip install rosbags") from None


def typestore() -> Any:
    """The definitions of ROS 2's messages; those used here are the same in Humble and later."""
    typesys = rosbags("typesys")
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def save_mcap(trajectory: Trajectory, path: str | Path, start: float = 0.0) -> Path:
    """See `Trajectory.save_mcap`."""
    file = Path(path)
    expect(file.suffix == SUFFIX, file, f"a file that ends in {SUFFIX}")
    expect(len(trajectory), file, "a run with at least one sample")
    replaceable(file)
    store, writing, interfaces = typestore(), rosbags("rosbag2"), rosbags("interfaces")
    made = Messages(trajectory.robot, store.types, start=scalar(start, "start", least=0.0))
    expect(made.nanoseconds(trajectory.t[0]) >= 0, "start", "a time at which no sample is before 1970", start)
    with written_at(file), whole_file(file) as temporary:
        folder = temporary.with_name("bag")
        with writing.Writer(folder, version=9, storage_plugin=writing.StoragePlugin.MCAP) as bag:
            topics: dict[str, Any] = {}
            for nanoseconds, topic, message in messages_of(trajectory, made):
                kind = message.__msgtype__
                if topic not in topics:
                    qos = [_latched(interfaces)] if topic in LATCHED else []
                    topics[topic] = bag.add_connection(topic, kind, typestore=store, offered_qos_profiles=qos)
                bag.write(topics[topic], nanoseconds, store.serialize_cdr(message, kind))
        (folder / f"{folder.name}{SUFFIX}").rename(temporary)
    return file


def messages_of(trajectory: Trajectory, made: Messages) -> Iterator[Timed]:
    """All messages of a log in the order of their times."""
    run, robot = trajectory, trajectory.robot
    world = "odom" if run.believed is None else MAP
    counted = run.q if run.believed is None else run.believed
    links, rolling = Links(robot, made.base), Rolling(robot)
    angles, wheels = rolling.angles(counted, run.u), rolling_joints(robot)
    begin = float(run.t[0])
    first = made.nanoseconds(begin)
    if text := description(robot):
        yield first, DESCRIPTION, made.text(text)
    if links.fixed:
        yield first, TF_STATIC, made.tf([(begin, *one) for one in links.fixed])
    for topic, points in ((PATH, run.path), (DESIRED, run.moving)):
        if points is not None and len(points):
            yield first, topic, made.path(begin, points, world)
    events = sorted(run.events, key=lambda event: event.t)
    for k, t in enumerate(run.t.tolist()):
        while events and (events[0].t <= t or k == len(run) - 1):
            event = events.pop(0)
            words = f"{event.what}: {event.why}" if event.why else event.what
            yield made.nanoseconds(event.t), EVENTS, made.log(event.t, event.task, words)
        now, q, u, seen = made.nanoseconds(t), run.q[k], run.u[k], counted[k]
        spins = rolling.rates(seen, u, angles[k]) if wheels else np.zeros(0)
        q_dot = run.q_dot[k] if run.believed is None else robot.S(seen) @ u
        turned = dict(zip(wheels, zip(angles[k], spins, strict=True), strict=True))
        yield now, JOINTS, made.joint_state(t, q, q_dot, turned)
        yield now, ODOMETRY, made.odometry(t, seen, q_dot)
        moved = [(t, *one) for one in links.moving(q, angles[k])]
        place = planar_pose(seen[:3] if robot.platform.n_p else np.zeros(3))
        frames = [(t, made.odom, made.base, *place)]
        if run.believed is not None:
            off = planar_matrix(q) @ np.linalg.inv(planar_matrix(seen))
            frames.append((t, MAP, made.odom, *position_and_quaternion(off)))
        yield now, TF, made.tf([*frames, *moved])
        yield now, TWIST, made.twist_stamped(t, seen, u)
        yield now, INPUTS, made.inputs(t, u)
        if run.r_names:
            yield now, ERROR, made.numbers(run.error[k], run.r_names)


def planar_matrix(q: Array) -> Array:
    """The platform's pose (4, 4) at q."""
    x, y, theta = q[:3]
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)


class Links:
    """Where a robot's links are in one another, as transforms: (parent, child, position, quaternion).

    fixed : those that do not move
    """

    def __init__(self, robot: Robot, base: str) -> None:
        self._placements = Placements(robot)
        model, root = robot.display_model, base_joint(robot)
        frames = [one for one in model.frames if one.type.name == "BODY" and one.name != "universe"]
        self._names, self._places = {root: base}, {root: np.eye(4)}
        for frame in frames:
            if frame.parentJoint > root and frame.parentJoint not in self._names:
                self._names[frame.parentJoint] = frame.name
                self._places[frame.parentJoint] = frame.placement.homogeneous
        for joint in range(root + 1, model.njoints):
            self._names.setdefault(joint, str(model.names[joint]))
            self._places.setdefault(joint, np.eye(4))
        self._parents = {joint: int(model.parents[joint]) for joint in self._names if joint > root}
        self.fixed = [
            self._transform(
                frame.parentJoint, frame.name, np.linalg.inv(self._places[frame.parentJoint]) @ placement
            )
            for frame in frames
            if frame.parentJoint in self._names and frame.name != self._names[frame.parentJoint]
            for placement in [frame.placement.homogeneous]
        ]

    def moving(self, q: Array, wheels: Array) -> list[tuple[str, str, Array, Array]]:
        """Those of links on joints, at q (n,) and the wheels' angles (D,)."""
        relative, places = self._placements.relative(q, wheels), self._places
        return [
            self._transform(
                parent, self._names[j], np.linalg.inv(places[parent]) @ relative[j - 1] @ places[j]
            )
            for j, parent in self._parents.items()
        ]

    def _transform(self, parent: int, child: str, placement: Array) -> tuple[str, str, Array, Array]:
        return (self._names[parent], child, *position_and_quaternion(placement))


def description(robot: Robot) -> str:
    """The URDF text of a robot that is one file's; "" of others."""
    try:
        return describe(source_path(robot.source, ()), robot.arguments).xml
    except RobotError:
        return ""


def _latched(interfaces: Any) -> Any:
    never = interfaces.QosTime(0, 0)
    return interfaces.Qos(
        interfaces.QosHistory.KEEP_LAST,
        1,
        interfaces.QosReliability.RELIABLE,
        interfaces.QosDurability.TRANSIENT_LOCAL,
        never,
        never,
        interfaces.QosLiveliness.SYSTEM_DEFAULT,
        never,
        False,
    )
