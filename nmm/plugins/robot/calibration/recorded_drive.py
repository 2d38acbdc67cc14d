"""What a bag has of a drive: all that may be counted, and a reference's poses or points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.log_units import Counter
from nmm.plugins.robot.ros.frames import Edge
from nmm.plugins.robot.ros.reading import nanoseconds, placement, plain
from nmm.plugins.robot.ros.recorded import JOINT_STATE, ODOMETRY, TRANSFORMS, Names, Recorded
from nmm.plugins.robot.ros.storage import Log, Topic
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


class RecordedDrive(Recorded):
    """The messages of a drive: positions and rates of all that may be counted, and of a reference on a topic.

    seen : of the reference's topic, poses (4, 4) or points (3,); seen_in : the frame they are in
    of : whose poses they are, where messages say so
    kind : their type
    """

    def __init__(
        self, robot: Robot, file: Path, names: Names, counters: dict[str, Counter], topic: str | None
    ) -> None:
        self._counters, self.topic = counters, None if topic is None else names.topic(topic)
        self.seen, self.frames, self.kind = Track(), set[tuple[str, str]](), ""
        super().__init__(robot, file, names)

    def _joints(self) -> tuple[tuple[str, ...], set[str]]:
        return (), {*self._counters}

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
            near = sorted(topics, key=lambda topic: topic[1] not in (POINT, *POSES))
            available = [f"{topic} ({kind})" for topic, kind in near]
            expected = f"poses or points on {self.topic}, or {TF!r}"
            raise InputError(where="reference", expected=expected, available=available)
        self.kind = kinds[0]
        both, taken = (self.topic, self.kind), takes.get((self.topic, self.kind))

        def take(topic: str, recorded: int, message: Any) -> None:
            if taken is not None:
                taken(topic, recorded, message)
            self._take_seen(topic, recorded, message)

        return takes | {both: take}

    def _one_odometry(self) -> Edge | None:
        return super()._one_odometry() if self.topic is None else None

    def _take_seen(self, _: str, recorded: int, message: Any) -> None:
        child = plain(getattr(message, "child_frame_id", ""))
        self.frames.add((plain(message.header.frame_id), child))
        if self.kind == POINT:
            point = message.point
            row = np.array([point.x, point.y, point.z])
            expect(bool(np.isfinite(row).all()), f"{self.topic}: point", "finite numbers", row)
        else:
            row = placement(message)
        self.seen.add(nanoseconds(message), recorded, row)

    def _finish(self, log: Log) -> None:
        for name, count in self._not_finite.items():
            self.findings.append(Finding("values_not_finite", {"name": name, "count": count}))
