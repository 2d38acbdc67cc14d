"""`nmm.PoseFilter` in a robot's loop, and by ROS 2's messages."""

from __future__ import annotations

import collections
import json
import os
import re
import subprocess
import sys
from types import SimpleNamespace as Message

import numpy as np
import pytest
from places import ROOT
from planar_poses import matrix_of

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.zero_order_hold import HeldInputs

Array = np.ndarray


def test_a_loop_does_its_task_where_the_filter_says_that_the_robot_is() -> None:
    """A robot that is elsewhere than it is believed at first, and whose left wheel slips by 3 %: fixes 60 ms
    late at 10 Hz bring its hand to the target, where encoders alone leave it beside. `write` moves it."""
    robot = nmm.load("unicycle_2r", platform="differential")
    start, target, rng = robot.q({"q1": 0.3, "q2": 0.9}), np.array([2.0, 0.5]), np.random.default_rng(8)

    def drive_loop(with_fixes: bool) -> float:
        q, clock = start + np.array([0.1, -0.05, 0.1, 0.0, 0.0]), [0.0]
        read = dict.fromkeys([*robot.wheel_speeds(np.zeros(2)), "q1", "q2"], 0.0) | {"q1": 0.3, "q2": 0.9}
        pose_filter = nmm.PoseFilter(
            robot, start, read, -0.01, covariance=np.diag([0.01, 0.01, 0.02]), spread=1e-4,
            slip_noise=(0.02, 0.01, 0.05), scale_deviation=0.03,
        )  # fmt: skip
        task = nmm.Task(nmm.Position("ee", "xy"), target, gain=1.0)
        controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(alpha=1), dt=0.01)
        loop, seen = nmm.Loop(controller), []

        def measure() -> nmm.PoseFilter:
            t = clock[0]
            seen.append((t, q[:3] + 0.01 * rng.standard_normal(3)))
            pose_filter.update(read, t)
            if with_fixes and len(seen) % 10 == 0:
                was, pose = seen[-6 if len(seen) > 6 else 0]
                pose_filter.fix(pose, 1e-4 * np.eye(3), was)
            return pose_filter

        def write(u: Array) -> None:
            nonlocal q
            speeds = robot.wheel_speeds(u, q)
            true = robot.platform_inputs(
                {name: v * (0.97 if "left" in name else 1.0) for name, v in speeds.items()}, q
            )
            q = q + 0.01 * robot.S(q) @ np.concatenate([true, u[2:]])
            for name, v in speeds.items():
                read[name] += 0.01 * v
            read["q1"], read["q2"] = q[3:]

        def sleep(seconds: float) -> None:
            clock[0] += seconds

        loop.run(measure, write, duration=8.0, clock=lambda: clock[0], sleep=sleep)
        assert not loop.refused
        return float(np.linalg.norm(nmm.Configuration(robot, q).placement("ee").translation[:2] - target))

    assert drive_loop(True) < 0.03
    assert drive_loop(False) > 0.1


class Turning:
    """A loop and a filter of differential unicycle_2r that turns its wheels and joints as it asks."""

    def __init__(self) -> None:
        self.robot = nmm.load("unicycle_2r", platform="differential")
        start = self.robot.q({"q1": 0.3, "q2": 0.9})
        names = (*self.robot.wheel_speeds(np.zeros(2)), "q1", "q2")
        self.readings = dict(zip(names, (0.0, 0.0, 0.3, 0.9), strict=True))
        self.pose_filter = nmm.PoseFilter(
            self.robot, start, self.readings, -0.01, covariance=np.diag([0.04, 0.04, 0.04]), spread=1e-4,
            fastest=1e3,
        )  # fmt: skip
        task = nmm.Task(nmm.Position("ee", "xy"), np.array([3.0, 0.5]), gain=1.0)
        controller = nmm.Controller(self.robot, task, nmm.DampedLeastSquares(alpha=1), dt=0.01)
        self.loop, self.t = nmm.Loop(controller, soft_start=0.1), 0.0

    def go(self, count: int, jump: float = 0.0, arrays: bool = False) -> None:
        """Steps, the first with wheels that have turned by a `jump` more, rad."""
        for k in range(count):
            more = [jump, jump, 0.0, 0.0] if k == 0 else [0.0] * 4
            for name, rate, by in zip(self.readings, self.loop.u, more, strict=True):
                self.readings[name] += 0.01 * rate + by
            self.pose_filter.update(self.readings, self.t)
            if arrays:
                self.loop.step(self.t, self.pose_filter.q, self.t)
            else:
                self.loop.step(self.t, self.pose_filter)
            self.t += 0.01

    def fix(self, *by: float) -> None:
        """Where it is believed to be is wrong by this, m and rad."""
        pose = self.pose_filter.pose + by
        assert self.pose_filter.fix(pose, 1e-8 * np.eye(3), self.pose_filter.t) == "used"


def test_what_a_fix_corrects_is_no_jump_and_what_a_counter_jumps_is() -> None:
    """A fix that moves it by 4 cm is gone on with, one of 30 cm with a soft start, at once; without a filter,
    the loop takes the first for a fault of a sensor. 0.5 m by the wheels is refused."""
    robot = Turning()
    robot.go(50)
    assert str(robot.loop.state) == "running"
    robot.fix(0.03, -0.03, 0.02)
    robot.go(1)
    assert str(robot.loop.state) == "running"
    assert not robot.loop.findings
    np.testing.assert_allclose(robot.loop.q[:3], robot.pose_filter.pose, rtol=0, atol=1e-9)
    robot.pose_filter.restart(robot.pose_filter.pose, np.diag([0.04, 0.04, 0.04]))
    robot.fix(0.3, 0.0, 0.0)
    robot.go(1)
    assert [finding.code for finding in robot.loop.findings] == ["relocated"]
    assert robot.loop.findings[0].values["m"] == pytest.approx(0.3, abs=1e-3)
    assert str(robot.loop.state) == "starting"
    np.testing.assert_allclose(robot.loop.q[:3], robot.pose_filter.pose, rtol=0, atol=1e-9)
    robot.go(30)
    assert str(robot.loop.state) == "running"
    assert not robot.loop.refused
    robot.go(2, jump=5.0)
    assert robot.loop.refused["jump"] == 2
    of_arrays = Turning()
    of_arrays.go(50, arrays=True)
    of_arrays.fix(0.2, 0.0, 0.0)
    of_arrays.go(1, arrays=True)
    assert of_arrays.loop.refused["jump"] == 1


def test_a_fix_moves_where_it_is_believed_to_be_without_new_readings() -> None:
    """From where the fix has it, moved on by the inputs since."""
    robot = Turning()
    robot.go(80)
    robot.fix(0.02, 0.03, 0.05)
    u, q = robot.loop.u, robot.pose_filter.q
    robot.loop.step(robot.t, robot.pose_filter)
    assert np.linalg.norm(q[:2]) > 0.1
    expected = HeldInputs(robot.robot)(q, u, 0.01)
    np.testing.assert_allclose(robot.loop.q, expected, rtol=0, atol=1e-9)


def test_a_filter_without_new_readings_is_a_measurement_that_came_again() -> None:
    robot = Turning()
    robot.go(50)
    for k in range(3):
        robot.loop.step(robot.t + 0.01 * k, robot.pose_filter)
    assert robot.loop.refused == {"repeated": 3}
    assert str(robot.loop.state) == "running"


def test_it_runs_as_plain_python_to_the_same_numbers() -> None:
    script = (
        "import sys; sys.path[:0] = sys.argv[1:]\n"
        "from pose_filters import drive, fixes_of\n"
        "pose_filter, _, odom = drive(fixes_of([0.3, 0.0, 0.4, 0.2, 0.05, 0.6, 0.0, 0.39]))\n"
        "print([float(x) for x in [*pose_filter.pose, *pose_filter.state_covariance.ravel(), *odom.ravel()]])"
    )
    paths = [str(ROOT / "tests" / part) for part in ("plugins/robot", "helpers")]
    plain, compiled = (
        subprocess.run(
            [sys.executable, "-c", script, *paths],
            env=os.environ | {"NUMBA_DISABLE_JIT": disabled},
            capture_output=True, text=True, check=True,
        ).stdout
        for disabled in ("1", "0")
    )  # fmt: skip
    np.testing.assert_allclose(json.loads(plain), json.loads(compiled), rtol=0, atol=1e-12)


def test_a_filter_speaks_in_messages_with_its_frames_apart() -> None:
    """A PoseWithCovarianceStamped is a fix; map → odom → base chain to where the filter has the robot."""
    typesys = pytest.importorskip("rosbags.typesys")
    robot = nmm.load("differential_base")
    names = ("left_wheel_joint", "right_wheel_joint")
    still = dict.fromkeys(names, 0.0)
    pose_filter = nmm.PoseFilter(
        robot, robot.rest, still, 0.0, covariance=np.diag([0.1, 0.1, 0.1]), spread=1e-3
    )
    pose_filter.update(dict(zip(names, (3.0, 5.0), strict=True)), 1.0)
    covariance = np.arange(1.0, 37.0).reshape(6, 6)
    covariance[np.ix_([0, 1, 5], [0, 1, 5])] = np.diag([0.02, 0.03, 0.04])
    pose = Message(
        position=Message(x=0.5, y=0.1, z=0.0),
        orientation=Message(x=0.0, y=0.0, z=np.sin(0.2), w=np.cos(0.2)),
    )
    message = Message(pose=Message(pose=pose, covariance=covariance.ravel()))
    np.testing.assert_array_equal(nmm.ros.base_covariance(message), np.diag([0.02, 0.03, 0.04]))
    assert pose_filter.fix(nmm.ros.base(message), nmm.ros.base_covariance(message), 1.0) == "used"
    messages = nmm.ros.Messages(robot, typesys.get_typestore(typesys.Stores.ROS2_JAZZY).types)
    q = pose_filter.q
    q[:3] = pose_filter.odom
    transforms = nmm.ros.Transforms()
    transforms.add(messages.transforms(1.0, q, pose_filter.map_to_odom))
    in_map, in_odom = (transforms.base(frame, robot) for frame in ("map", "odom"))
    np.testing.assert_allclose(matrix_of(in_map), matrix_of(pose_filter.pose), atol=1e-12)
    np.testing.assert_allclose(matrix_of(in_odom), matrix_of(pose_filter.odom), atol=1e-12)
    assert np.abs(in_map - in_odom).max() > 0.01


class Node:
    """A ROS node whose clock goes on by half a millisecond whenever it is read, and which is its own
    localisation and driver of a robot that stands: fixes of the last time that was read, of which one is in
    another frame, and one of a covariance that is not known."""

    def __init__(self, readings: dict[str, float]) -> None:
        self.readings, self.warned = readings, list[str]()
        self.nanoseconds = 1_800_000_000_000_000_000
        self.reads = self.writes = 0
        self.warning = self.warned.append

    def get_clock(self) -> Node:
        return self

    def now(self) -> Message:
        self.nanoseconds += 500_000
        return Message(nanoseconds=self.nanoseconds)

    def get_logger(self) -> Node:
        return self

    def encoders(self) -> dict[str, float]:
        self.reads += 1
        return self.readings

    def yaw_rate(self) -> float:
        return 0.0

    def new(self) -> list[Message]:
        covariance = np.diag([0.01] * 6).ravel()
        if self.reads == 4:
            covariance[0] = -1.0
        turn = Message(x=0.0, y=0.0, z=0.0, w=1.0)
        pose = Message(position=Message(x=0.0, y=0.0, z=0.0), orientation=turn)
        sec, nanosec = divmod(self.nanoseconds, 1_000_000_000)
        frame = "odom" if self.reads == 2 else "map"
        header = Message(frame_id=frame, stamp=Message(sec=sec, nanosec=nanosec))
        return [Message(header=header, pose=Message(pose=pose, covariance=covariance))]

    def write(self, u: Array) -> None:
        self.writes += 1
        if self.writes == 8:
            raise StopIteration("that is enough")


def test_the_example_of_the_page_uses_its_fixes_and_bears_messages_that_are_none() -> None:
    """`docs/deploy.md`, as it is, with a driver that ends it."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "deploy.md").read_text("utf-8"), re.S)
    [example] = [block for block in blocks if "nmm.PoseFilter(" in block]
    robot = nmm.load("unicycle_2r", platform="differential")
    names = (*robot.wheel_speeds(np.zeros(2)), "q1", "q2")
    encoders = dict(zip(names, (0.0, 0.0, 0.3, 0.9), strict=True))
    task = nmm.Task(nmm.Position("ee", "xy"), np.array([3.0, 0.5]), gain=1.0)
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(alpha=1), dt=0.005)
    node = Node(encoders)
    names_of_page = {
        "nmm": nmm, "np": np, "collections": collections, "robot": robot,
        "start": robot.q({"q1": 0.3, "q2": 0.9}), "encoders": encoders, "controller": controller,
        "node": node, "driver": node, "localisation": node,
    }  # fmt: skip
    with pytest.raises(StopIteration, match="enough"):
        exec(example, names_of_page)
    assert len(node.warned) == 2
    assert names_of_page["outcomes"] == {"used": node.reads - 2, "refused": 2}


def test_a_covariance_that_is_not_known_is_no_fix() -> None:
    unknown = np.zeros(36)
    unknown[0] = -1.0
    for message, expected in (
        (Message(pose=Message(covariance=unknown)), "one that is known"),
        (Message(pose=Message()), "a message with a covariance"),
        (Message(covariance=np.zeros(9)), "36 numbers"),
    ):
        with pytest.raises(InputError) as caught:
            nmm.ros.base_covariance(message)
        assert caught.value.expected == expected
