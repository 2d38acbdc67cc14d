"""What a bag has of joints that count, and of a reference: its poses or points."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.frames import Edge
from nmm.plugins.robot.ros.reading import lost, nanoseconds, placement, plain, pose_numbers
from nmm.plugins.robot.ros.recorded import JOINT_STATE, ODOMETRY, Names, Recorded
from nmm.plugins.robot.ros.storage import TRANSFORMS, Log, Topic
from nmm.plugins.robot.ros.tracks import Track

#: The messages that tell where a robot is, with and without a heading.
POINT = "geometry_msgs/msg/PointStamped"
POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    ODOMETRY,
)
#: As a reference: transforms.
TF = "tf"


class RecordedSeen(Recorded):
    """The messages of some joints, positions and rates, and of a reference on a topic.

    seen : of the reference's topic, poses (4, 4) or points (3,); frames : those they are in, each with whose
    poses they are, "" where messages do not say so
    kind : their type; topic : theirs, None for transforms
    lost : of how many messages nothing is known, as trackers send them of a target that is hidden
    """

    #: What a reference may be beside a topic, in words.
    beside = repr(TF)

    def __init__(
        self, robot: Robot, file: Path, names: Names, joints: Collection[str], topic: str | None
    ) -> None:
        self._joints_asked, self.topic = {*joints}, None if topic is None else names.topic(topic)
        self.seen, self.frames, self.kind, self.lost = Track(), set[tuple[str, str]](), "", 0
        super().__init__(robot, file, names)

    def only(self) -> tuple[str, str]:
        """The frame that the topic's poses are in, and whose they are; `InputError` for several, and for
        none."""
        where = f"reference {self.topic}"
        if self.lost and not len(self.seen):
            raise InputError(
                "all are without a pose, or a point", where=where, expected="numbers, a quaternion"
            )
        expect(len(self.seen) > 1, where, "at least two messages", len(self.seen))
        if len(self.frames) > 1:
            available = [f"{child or 'poses'} in {frame}" for frame, child in sorted(self.frames)]
            raise InputError("poses in several frames on one topic", where=where, available=available)
        ((frame, child),) = self.frames
        return frame, child

    def _joints(self) -> tuple[tuple[str, ...], set[str]]:
        return (), self._joints_asked

    def _needs(self, joints: str, tf: str) -> list[tuple[str, set[str]]]:
        needed = [(joints, {JOINT_STATE})]
        if self.topic is None:
            needed.append((f"{TRANSFORMS[0]} on {tf}, or reference=", {*TRANSFORMS}))
        return needed

    def _takes(self, topics: list[Topic]) -> dict[Topic, Callable[[str, int, Any], None]]:
        takes = super()._takes(topics)
        if self.topic is None:
            return takes
        kinds = [kind for topic, kind in topics if topic == self.topic and kind in (POINT, *POSES)]
        if not kinds:
            raise self._no_reference(f"poses or points on {self.topic}, or {self.beside}", topics)
        self.kind = kinds[0]
        both, taken = (self.topic, self.kind), takes.get((self.topic, self.kind))

        def take(topic: str, recorded: int, message: Any) -> None:
            if taken is not None:
                taken(topic, recorded, message)
            self._take_seen(topic, recorded, message)

        return takes | {both: take}

    def _no_reference(self, expected: str, topics: list[Topic]) -> InputError:
        near = sorted(topics, key=lambda topic: topic[1] not in (POINT, *POSES))
        available = [f"{topic} ({kind})" for topic, kind in near]
        return InputError(where="reference", expected=expected, available=available)

    def _one_odometry(self) -> Edge | None:
        return super()._one_odometry() if self.topic is None else None

    def _take_seen(self, _: str, recorded: int, message: Any) -> None:
        child = plain(getattr(message, "child_frame_id", ""))
        if self.kind == POINT:
            numbers = np.array([message.point.x, message.point.y, message.point.z])
        else:
            numbers = np.array(pose_numbers(message))
        if lost(numbers[np.newaxis])[0]:
            self.lost += 1
            return
        self.frames.add((plain(message.header.frame_id), child))
        row = numbers if self.kind == POINT else placement(message)
        self.seen.add(nanoseconds(message), recorded, row)

    def _finish(self, log: Log) -> None:
        for name, count in self._not_finite.items():
            self.findings.append(Finding("values_not_finite", {"name": name, "count": count}))
        if self.lost:
            self.findings.append(Finding("looks_lost", {"topic": self.topic, "count": self.lost}))
