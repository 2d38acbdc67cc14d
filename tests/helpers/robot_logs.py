"""Logs as robots record them: messages of rosbags, with stamps and times of recording of their own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import nmm
from nmm.model.robots.robot import Robot

STORE, FIRST = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
for _name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
    FIRST.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _name))
#: When it was recorded (s), topic, message.
Sent = tuple[float, str, Any]
NUMBER = count()

WHEEL = """<link name="{side}_wheel"><visual><origin rpy="1.5708 0 0"/>
<geometry><cylinder radius="0.1" length="0.02"/></geometry></visual></link>
<joint name="{side}_wheel_joint" type="continuous"><parent link="base_link"/><child link="{side}_wheel"/>
<origin xyz="{x} {y} 0.1"/><axis xyz="0 1 0"/><limit effort="9" velocity="20"/></joint>"""
JOINT = """<link name="a{i}"/><joint name="j{i}" type="{kind}"><parent link="{parent}"/><child link="a{i}"/>
<origin xyz="0.1 0 0.3"/><axis xyz="0 {y} {z}"/>{more}</joint>"""
LIMIT = '<limit lower="-3" upper="3" effort="9" velocity="2"/>'
CAMERA = """<link name="camera"/><joint name="camera_joint" type="fixed"><parent link="{parent}"/>
<child link="camera"/><origin xyz="0.3 0.1 0.5" rpy="-1.5707963267948966 0 -1.5707963267948966"/></joint>"""


def wheeled(folder: Path, axle: float = 0.0, kind: str = "revolute", more: str = "", **options: Any) -> Robot:
    """Two wheels, `axle` m ahead of base_link, and an arm of two joints."""
    wheels = "".join(WHEEL.format(side=side, x=axle, y=y) for side, y in (("left", 0.25), ("right", -0.25)))
    first = JOINT.format(i=1, kind=kind, parent="base_link", y=0, z=1, more=LIMIT * (kind != "continuous"))
    second = JOINT.format(i=2, kind="revolute", parent="a1", y=1, z=0, more=LIMIT)
    path = folder / f"bot{next(NUMBER)}.urdf"
    path.write_text(f'<robot name="bot"><link name="base_link"/>{wheels}{first}{second}{more}</robot>')
    if axle:
        options["axle"] = (axle, 0.0)
    return nmm.load(path, **options)


def header(t: float, frame: str, store: Any = STORE) -> Any:
    ns = round(t * 1e9)
    time = store.types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    more = {} if store is STORE else {"seq": 0}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **more)


def joints(
    t: float, position: Mapping[str, float], velocity: Iterable[float] = (), store: Any = STORE
) -> Any:
    values = [value for value in position.values() if value is not None]
    return store.types["sensor_msgs/msg/JointState"](
        header=header(t, "", store),
        name=[*position],
        position=np.array(values, float),
        velocity=np.array([*velocity], float),
        effort=np.zeros(0),
    )


def _pose(
    at: Iterable[float], yaw: float, kinds: tuple[str, str, str], names: tuple[str, str], store: Any
) -> Any:
    types = store.types
    place, turn, whole = (types[f"geometry_msgs/msg/{kind}"] for kind in kinds)
    x, y, *z = at
    quaternion = turn(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    point = place(x=float(x), y=float(y), z=float(z[0]) if z else 0.0)
    return whole(**dict(zip(names, (point, quaternion), strict=True)))


def transform(
    t: float, frame: str, child: str, at: Iterable[float], yaw: float = 0.0, store: Any = STORE
) -> Any:
    """A TransformStamped."""
    names = ("translation", "rotation")
    pose = _pose(at, yaw, ("Vector3", "Quaternion", "Transform"), names, store)
    kind = store.types["geometry_msgs/msg/TransformStamped"]
    return kind(header=header(t, frame, store), child_frame_id=child, transform=pose)


def tf(*transforms: Any, store: Any = STORE, kind: str = "tf2_msgs/msg/TFMessage") -> Any:
    return store.types[kind](transforms=[*transforms])


def odom(
    t: float,
    pose: Iterable[float],
    twist: Iterable[float] = (0, 0, 0, 0, 0, 0),
    frame: str = "odom",
    child: str = "base_link",
    store: Any = STORE,
) -> Any:
    """An Odometry: x, y, yaw; linear and angular velocity (6,)."""
    types, (x, y, yaw), rates = store.types, pose, [float(one) for one in twist]
    vector = types["geometry_msgs/msg/Vector3"]
    linear, angular = (vector(**dict(zip("xyz", part, strict=True))) for part in (rates[:3], rates[3:]))
    none = np.zeros(36)
    at = _pose((x, y), yaw, ("Point", "Quaternion", "Pose"), ("position", "orientation"), store)
    return types["nav_msgs/msg/Odometry"](
        header=header(t, frame, store),
        child_frame_id=child,
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=at, covariance=none),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](
            twist=types["geometry_msgs/msg/Twist"](linear=linear, angular=angular), covariance=none
        ),
    )


def bag(folder: Path, sent: Iterable[Sent], mcap: bool = False) -> Path:
    """A rosbag2 folder."""
    path = folder / f"bag{next(NUMBER)}"
    plugin = rosbag2.StoragePlugin.MCAP if mcap else rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as out:
        made: dict[str, Any] = {}
        for t, topic, message in sorted(sent, key=lambda one: one[0]):
            kind = message.__msgtype__
            if topic not in made:
                made[topic] = out.add_connection(topic, kind, typestore=STORE)
            out.write(made[topic], round(t * 1e9), STORE.serialize_cdr(message, kind))
    return path


def bag_of_ros1(folder: Path, sent: Iterable[Sent]) -> Path:
    path = folder / f"bag{next(NUMBER)}.bag"
    with rosbag1.Writer(path) as out:
        made: dict[str, Any] = {}
        for t, topic, message in sorted(sent, key=lambda one: one[0]):
            kind = message.__msgtype__
            if topic not in made:
                made[topic] = out.add_connection(topic, kind, typestore=FIRST)
            out.write(made[topic], round(t * 1e9), FIRST.serialize_ros1(message, kind))
    return path
