"""What a log has of a robot: its joints, its odometry and the frames, as they were recorded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import vector
from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros import reading
from nmm.plugins.robot.ros.frames import Edge, Tree, carried, reference
from nmm.plugins.robot.ros.joint_states import parts, timed_joints
from nmm.plugins.robot.ros.reading import plain
from nmm.plugins.robot.ros.storage import TRANSFORMS, Log, Topic
from nmm.plugins.robot.ros.tracks import Track

JOINT_STATE, ODOMETRY = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"


@dataclass(frozen=True)
class Names:
    """Topics and frames of one robot's messages; topics without a slash in front are in its namespace."""

    joints: str | Sequence[str]
    odometry: str
    tf: str
    map: str
    odom: str
    base: str | None
    namespace: str
    prefix: str | None

    @property
    def of_joints(self) -> list[str]:
        """The topics of JointStates."""
        return [self.topic(name) for name in ([self.joints] if isinstance(self.joints, str) else self.joints)]

    def topic(self, name: str) -> str:
        space = self.namespace.strip("/")
        return name if name.startswith("/") else f"/{space}/{name}" if space else f"/{name}"


@contextmanager
def told_of(file: Path) -> Iterator[None]:
    """In the block, errors name the file."""
    try:
        yield
    except InputError as error:
        raise (error if str(file) in error.where else error.at(file)) from None


class Recorded:
    """The messages of one robot in a log.

    own : names of q's joints
    positions, velocities : by joint, tracks of rows (1,), rad or m, with the file's signs
    positions_of : the joints in `positions` of which q is made
    odometry : the poses of the Odometry's child in its frame, if there are any
    twists : its velocities (3,) at the platform's reference point, along its axes
    inputs : u (n_u,), of a log of nmm's
    tree : all transforms
    """

    def __init__(self, robot: Robot, file: Path, names: Names) -> None:
        self.robot, self.names = robot, names
        self.own, self._needed = self._joints()
        self.positions, self.velocities = dict[str, Track](), dict[str, Track]()
        self.inputs, self.twists, self.tree = Track(), Track(), Tree()
        self._odometry: dict[tuple[str, str], tuple[Edge, list[Any]]] = {}
        self._known = self._needed | {*robot.locked}
        self._not_finite: dict[str, int] = {}
        log = Log(file)
        takes = self._takes(log.topics)
        self.prefix = names.namespace.strip("/") if names.prefix is None else names.prefix
        for topic, recorded, message in log.messages([*takes]):
            for take in (take for (asked, _), take in takes.items() if asked == topic):
                take(topic, recorded, message)
        self.findings = [*log.findings, *self.tree.place()]
        self.odometry = self._one_odometry()
        self._finish(log)

    def _joints(self) -> tuple[tuple[str, ...], set[str]]:
        """The joints of q, and those whose positions are kept."""
        return self.robot.q_names[min(3, self.robot.platform.n_p) :], timed_joints(self.robot)

    @property
    def odometry_topic(self) -> str:
        return self.names.topic(self.names.odometry)

    def position(self, joint: str) -> Track:
        return self.positions[joint]

    @property
    def positions_of(self) -> list[str]:
        return [name for name in self.positions if name in self._needed]

    def tracks(self) -> Iterator[tuple[str, Track]]:
        """The tracks beside transforms, with the topics that they come from."""
        joints = ", ".join(self.names.of_joints)
        for some in (self.positions, self.velocities):
            yield from ((joints, track) for track in some.values())
        yield self.odometry_topic, self.twists
        yield self.names.topic("inputs"), self.inputs

    @property
    def _framed(self) -> bool:
        """Whether odometry and transforms are read."""
        return bool(self.robot.platform.n_p)

    def _takes(self, topics: list[Topic]) -> dict[Topic, Callable[[str, int, Any], None]]:
        """The method that takes each topic's messages; `InputError` for a topic that the log lacks."""
        names = self.names
        present = {topic for topic, _ in topics}
        tf, static = (
            own if (own := names.topic(name)) in present else f"/{name.lstrip('/')}"  # that of all robots
            for name in (names.tf, f"{names.tf}_static")
        )
        joints = names.of_joints
        asked: list[tuple[str, tuple[str, ...], Callable[[str, int, Any], None]]] = [
            *((topic, (JOINT_STATE,), self._take_joints) for topic in joints),
            (names.topic("inputs"), (JOINT_STATE,), self._take_inputs),
        ]
        if self._framed:
            asked += [
                (self.odometry_topic, (ODOMETRY,), self._take_odometry),
                (tf, TRANSFORMS, self._take_transforms),
                (static, TRANSFORMS, self._take_transforms),
            ]
        takes = {
            (topic, kind): take for topic, kinds, take in asked for kind in kinds if (topic, kind) in topics
        }
        kinds = {kind for _, kind in takes if (_, kind) != (names.topic("inputs"), JOINT_STATE)}
        for what, some in self._needs(f"{JOINT_STATE} on {' or '.join(joints)}", tf):
            if not some & kinds:
                near = sorted(topics, key=lambda topic: topic[1] not in some)
                available = [f"{topic} ({kind})" for topic, kind in near]
                raise InputError(expected=f"a topic of {what}", available=available)
        return takes

    def _needs(self, joints: str, tf: str) -> list[tuple[str, set[str]]]:
        """What there must be, in words, and the types of messages of which any will do."""
        needed = [(joints, {JOINT_STATE})] if self.own else []
        if self.robot.platform.n_p:
            what = f"{ODOMETRY} on {self.odometry_topic} or {TRANSFORMS[0]} on {tf}"
            needed.append((what, {ODOMETRY, *TRANSFORMS}))
        return needed

    def _take_joints(self, _: str, recorded: int, message: Any) -> None:
        positions, velocities = parts(message, self._known, self.prefix)
        if not positions and not velocities:
            return
        stamp = reading.nanoseconds(message)
        for some, tracks in ((positions, self.positions), (velocities, self.velocities)):
            for name, value in some.items():
                if reading.is_reached(value):
                    tracks.setdefault(name, Track()).add(stamp, recorded, np.array([value]))
                elif tracks is self.positions and name in self._needed:
                    self._not_finite[name] = self._not_finite.get(name, 0) + 1

    def _take_inputs(self, _: str, recorded: int, message: Any) -> None:
        names = self.robot.u_names
        if {*names} <= {*message.name} and len(message.velocity) == len(message.name):
            rates = reading.rates(message)
            self.inputs.add(reading.nanoseconds(message), recorded, np.array([rates[name] for name in names]))

    def _take_odometry(self, topic: str, recorded: int, message: Any) -> None:
        pair = plain(message.header.frame_id), plain(message.child_frame_id)
        edge, twists = self._odometry.setdefault(pair, (Edge(*pair, topic=topic), []))
        stamp = reading.nanoseconds(message)
        edge.track.add(stamp, recorded, reading.placement(message))
        twists.append((stamp, recorded, reading.velocities(message)))

    def _take_transforms(self, topic: str, recorded: int, message: Any) -> None:
        self.tree.add(message, topic, topic.endswith("_static"), recorded)

    def _one_odometry(self) -> Edge | None:
        """The robot's odometry; `InputError` where a topic has that of several frames."""
        own = {pair: of for pair, of in self._odometry.items() if pair[1].startswith(plain(self.prefix))}
        several = own if self.prefix and own else self._odometry
        if not several:
            return None
        if len(several) > 1:
            available = [f"{child} in {frame}" for frame, child in several]
            raise InputError("odometry of several frames on one topic", where=self.odometry_topic,
                             expected="prefix=, or another topic", available=available)  # fmt: skip
        ((edge, twists),) = several.values()
        pose = np.eye(4)
        if edge.child:
            pose = reference(self.robot, edge.child, self.prefix, self.tree, self.names.base)
        for stamp, recorded, (linear, angular) in twists:
            self.twists.add(
                stamp, recorded, vector(carried(linear, angular, pose), 3, f"{edge.topic}: twist")
            )
        return edge

    def _finish(self, log: Log) -> None:
        """Joints without a number, and angles that were counted on."""
        for name, count in self._not_finite.items():
            expect(name in self.positions, f"position of {name}", "a finite number", math.nan)
            self.findings.append(Finding("values_not_finite", {"name": name, "count": count}))
        if self.own and not self.positions_of:
            raise InputError(
                f"has no joint of {self.robot.name}", where=log.path, expected=" or ".join(self.own[:4])
            )
        for name, endless in zip(self.robot.q_names, self.robot.endless, strict=True):
            if endless and name in self.positions:
                _count_on(self.positions[name])


def _count_on(track: Track) -> None:
    """Angles that were taken within one turn, the short way from one to the next."""
    order = np.argsort(track.stamps, kind="stable")
    angles = np.array(track.rows)[order, 0]
    slack = 1e-3
    if np.abs(angles).max() <= np.pi + slack or (
        angles.min() >= -slack and angles.max() <= 2 * np.pi + slack
    ):
        for k, angle in zip(order.tolist(), np.unwrap(angles).tolist(), strict=True):
            track.rows[k] = np.array([angle])
