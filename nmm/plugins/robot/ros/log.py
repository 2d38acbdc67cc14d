"""A trajectory as a log of messages: an MCAP file that Foxglove, Rerun and ROS 2's tools open."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import scalar
from nmm.base.errors import InputError, expect, few
from nmm.base.files import replaceable, whole_file, written_at
from nmm.model.robots.configuration import Configuration
from nmm.plugins.robot.ros.description import description
from nmm.plugins.robot.ros.making import Messages, rolled_readings
from nmm.plugins.robot.ros.placed import PlacedFrames
from nmm.views.playback.placements import rolling_joints
from nmm.views.playback.rolling import Rolling

if TYPE_CHECKING:
    from nmm.motion.trajectory import Trajectory

JOINTS, INPUTS, ODOMETRY, TWIST, ERROR = "/joint_states", "/inputs", "/odom", "/cmd_vel", "/error"
TF, TF_STATIC, EVENTS, DESCRIPTION = "/tf", "/tf_static", "/rosout", "/robot_description"
PATH, DESIRED = "/path", "/desired_path"
BASE_POSE, FRAME_POSE, DESIRED_POSE = "/base_pose", "/end_effector_pose", "/desired_pose"
#: Topics whose last message is for whoever comes later.
LATCHED = (TF_STATIC, DESCRIPTION, PATH, DESIRED)
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
        bag = writing.Writer(folder, version=9, storage_plugin=writing.StoragePlugin.MCAP)
        bag.set_compression(writing.CompressionMode.STORAGE, writing.CompressionFormat.ZSTD)
        with bag:
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
    placed = PlacedFrames(robot, made.base, made.odom, believed=run.believed is not None)
    world, ground = placed.world, placed.ground
    counted = run.q if run.believed is None else run.believed
    rolling = Rolling(robot)
    angles, wheels = rolling.angles(counted, run.u), rolling_joints(robot)
    begin = float(run.t[0])
    first = made.nanoseconds(begin)
    text, left_out = description(robot, placed.links)
    yield first, DESCRIPTION, made.text(text)
    if left_out:
        words = f"shapes that a URDF has no words for are not drawn: {few(left_out)}"
        yield first, EVENTS, made.log(begin, DESCRIPTION, words)
    if placed.still:
        yield first, TF_STATIC, made.tf([(begin, *transform) for transform in placed.still])
    for topic, points in ((PATH, run.path), (DESIRED, run.moving)):
        if points is not None and len(points):
            yield first, topic, made.path(begin, [ground.act(point) for point in points], world)
    posed = run.frame is not None and run.frame in robot.frames
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
        yield now, JOINTS, made.joint_state(t, q, q_dot, rolled_readings(robot, turned, seen, q_dot))
        yield now, ODOMETRY, made.odometry(t, seen, q_dot)
        yield now, BASE_POSE, made.pose(t, placed.stand(seen))
        if posed:
            reached = ground * Configuration(robot, q).placement(str(run.frame))
            yield now, FRAME_POSE, made.pose(t, reached.homogeneous, world)
        if run.desired is not None and np.isfinite(run.desired[k]).all():
            wanted = pin.SE3(np.eye(3), ground.act(run.desired[k]))
            yield now, DESIRED_POSE, made.pose(t, wanted.homogeneous, world)
        yield now, TF, made.tf([(t, *transform) for transform in placed.at(q, seen, angles[k])])
        yield now, TWIST, made.twist_stamped(t, seen, u)
        yield now, INPUTS, made.inputs(t, u)
        if run.r_names:
            yield now, ERROR, made.numbers(run.error[k], run.r_names)


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
