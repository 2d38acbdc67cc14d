"""Logs of robots read back: a rosbag2 folder, .mcap or .db3 file as a trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import Array, Integers, interpolated
from nmm.control.quantities import saved
from nmm.errors import InputError, RunError, expect
from nmm.files import expect_file
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot
from nmm.ros import reading
from nmm.ros.joint_states import JointStates
from nmm.ros.log import INPUTS, JOINTS, MAP, ODOMETRY, TF, TF_STATIC, rosbags, typestore
from nmm.ros.making import root_link
from nmm.runs.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

#: The messages' types by the topics that are read.
TYPES = {
    "joints": "sensor_msgs/msg/JointState",
    "odometry": "nav_msgs/msg/Odometry",
    "tf": "tf2_msgs/msg/TFMessage",
}
#: More samples are no bag that one looks at.
MOST = 2_000_000


@dataclass
class Track:
    """Values (k,) at times, ns, as they come."""

    times: list[int] = field(default_factory=list)
    rows: list[Array] = field(default_factory=list)

    def add(self, time: int, row: Array) -> None:
        self.times.append(time)
        self.rows.append(row)

    def sorted(self) -> tuple[Integers, Array]:
        """Times (N,), ns, that increase, and rows (N, k); of equal times the last."""
        latest = dict(zip(self.times, self.rows, strict=True))
        times = np.array(sorted(latest), dtype=np.int64)
        return times, np.array([latest[time] for time in times.tolist()])


def read_bag(
    path: str | Path,
    robot: Robot,
    *,
    joints: str = JOINTS,
    odometry: str = ODOMETRY,
    base: str | None = None,
    frame: str | None = None,
) -> Trajectory:
    """The motion of a robot in a rosbag2 folder, an .mcap or a .db3 file.

    It is sampled where joint states come; the platform is where the frame `map` has it or, in a bag without,
    where odometry does, linearly in between. With both, odometry is `believed`. Inputs are those recorded (in
    a log of nmm's), or the nearest to the velocities recorded, or else to differences of q. Times are the
    messages' headers', from the first sample on; messages out of order are sorted. Joints that the robot does
    not have are left out; those that come in several messages are joined.

    Parameters
    ----------
    path : the bag
    robot : whose it is
    joints, odometry : topics of JointState and Odometry
    base : the platform's frame in TF; the robot's root link by default
    frame : the end-effector's frame, whose path is shown

    Returns
    -------
    Trajectory : without a task: r, errors and objective are empty or zero

    Raises
    ------
    InputError : no bag, a damaged one, or one of another robot: a joint is missing; no such topic; numbers
        that are not finite

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    >>> found = nmm.read_bag(run.save_mcap("run.mcap"), run.robot, frame="ee")
    >>> bool(np.abs(found.q - run.q).max() < 1e-12)
    True
    """
    file = Path(path)
    at = root_link(robot) if base is None else base
    found = _Reader(robot, file, joints, odometry, at).read()
    times, q, u, believed = found
    t = (times - times[0]) / 1e9
    count = len(t)
    q_dot = np.array([robot.S(here) @ now for here, now in zip(q, u, strict=True)])
    place = None
    if frame is not None:
        place = np.array([Configuration(robot, here).placement(frame).translation for here in q])
    sizes = {"N": count, "n": robot.n, "m": robot.n_u}
    arrays = {one.name: one.absent(**sizes) for one in saved() if not one.optional}
    arrays |= {"t": t, "q": q, "u": u, "q_dot": q_dot, "path": place, "believed": believed}
    return Trajectory.of(
        arrays,
        robot=robot,
        r_names=(),
        r_units=(),
        resolver="bag",
        method="recorded",
        dt=float(np.median(np.diff(t))) if count > 1 else 0.0,
        frame=frame,
        label=file.stem,
    )


class _Reader:
    def __init__(self, robot: Robot, file: Path, joints: str, odometry: str, base: str) -> None:
        self.robot, self.file, self.base = robot, file, base
        self.topics = {joints: "joints", odometry: "odometry", TF: "tf", TF_STATIC: "tf", INPUTS: "inputs"}
        self._own = robot.q_names[min(3, robot.platform.n_p) :]
        self._states = JointStates(robot)
        self._missing: InputError | None = None
        self.joints, self.rates, self.inputs = Track(), Track(), Track()
        self.odometry, self.twists, self.map, self.moved = Track(), Track(), Track(), Track()
        self._frames = reading.Transforms()

    def read(self) -> tuple[Integers, Array, Array, Array | None]:
        """Times (N,), ns, q (N, n), u (N, n_u), and what odometry has beside a map."""
        for kind, message in self._messages():
            try:
                self._take(kind, message)
            except InputError as error:
                raise error.at(self.file) from None
        times, q, believed = self._configurations()
        return times, q, self._inputs(times, q), believed

    def _messages(self) -> Iterator[tuple[str, Any]]:
        try:
            expect_file(self.file)
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", where=self.file) from None
        rosbag2, store = rosbags("rosbag2"), typestore()
        try:
            with rosbag2.Reader(self.file) as bag:
                wanted = [one for one in bag.connections if self._wanted(one)]
                self._check_topics(bag.connections, [self.topics[one.topic] for one in wanted])
                for connection, _, data in bag.messages(connections=wanted):
                    yield self.topics[connection.topic], store.deserialize_cdr(data, connection.msgtype)
        except (InputError, RunError):
            raise
        except Exception as error:  # of a stranger's bytes the reader says all kinds
            reason = str(error) or type(error).__name__
            raise InputError(f"is no bag of ROS 2, or a damaged one ({reason})", where=self.file) from None

    def _wanted(self, connection: Any) -> bool:
        kind = self.topics.get(connection.topic)
        return kind is not None and connection.msgtype == TYPES.get(kind, TYPES["joints"])

    def _check_topics(self, connections: Sequence[Any], kinds: Sequence[str]) -> None:
        asked = {kind: topic for topic, kind in reversed(self.topics.items())}
        needed = [["joints"]] if self._own else []
        needed += [["odometry", "tf"]] if self.robot.platform.n_p else []
        for some in needed:
            if not {*some} & {*kinds}:
                topics = " or ".join(f"{TYPES[kind]} on {asked[kind]}" for kind in some)
                there = [f"{one.topic} ({one.msgtype})" for one in connections]
                raise InputError(where=self.file, expected=f"a topic of {topics}", available=there)

    def _take(self, kind: str, message: Any) -> None:
        if kind == "joints":
            self._take_joints(message)
        elif kind == "inputs":
            rates = reading.rates(message)
            if {*self.robot.u_names} <= {*rates}:
                self.inputs.add(
                    reading.nanoseconds(message), np.array([rates[x] for x in self.robot.u_names])
                )
        elif kind == "odometry":
            time = reading.nanoseconds(message)
            self.odometry.add(time, reading.base(message))
            self.twists.add(time, reading.twist(message))
        elif kind == "tf" and message.transforms:
            self._frames.add(message)
            for frame, track in ((MAP, self.map), ("odom", self.moved)):
                if self._frames.connects(frame, self.base):
                    track.add(reading.nanoseconds(message), self._frames.base(frame, self.base))

    def _take_joints(self, message: Any) -> None:
        if not self._states.add(message):
            return
        try:
            base = np.zeros(3) if self.robot.platform.n_p else None
            near = self.joints.rows[-1] if self.joints.rows else None
            q = self.robot.q_from(self._states.joints, base, near)
        except InputError as error:
            self._missing = error  # told if it stays so
            return
        expect(len(self.joints.times) < MOST, self.file, f"at most {MOST} joint states")
        time = reading.nanoseconds(message)
        self.joints.add(time, q)
        if len(message.velocity) == len(message.name) and np.isfinite(message.velocity).all():
            self.rates.add(time, np.array([reading.rates(message).get(name, np.nan) for name in self._own]))

    def _configurations(self) -> tuple[Integers, Array, Array | None]:
        robot, mobile = self.robot, bool(self.robot.platform.n_p)
        counted = self.odometry if self.odometry.times else self.moved
        world = self.map if self.map.times else counted
        if self._own and not self.joints.times:
            if self._missing is not None:
                raise self._missing.at(self.file)
            raise InputError(f"has no joint of {robot.name}", where=self.file, available=self._own)
        if mobile and not world.times:
            what = f"no transforms from map or odom to {self.base}, and no odometry"
            raise InputError(what, where=self.file, expected="base= or another topic")
        times, q = self.joints.sorted() if self._own else (world.sorted()[0], None)
        if q is None:
            q = np.zeros((len(times), robot.n))
        q = np.where(robot.endless, np.unwrap(q, axis=0), q)
        believed = None
        if mobile:
            first, last = min(world.times), max(world.times)
            within = (times >= first) & (times <= last)
            expect(within.any(), self.file, "joint states while the platform's pose is known")
            times, q = times[within], q[within]
            q[:, :3] = _between(times, *world.sorted())
            if world is self.map and counted.times:
                believed = q.copy()
                believed[:, :3] = _between(times, *counted.sorted())
                turns = np.round((q[0, 2] - believed[0, 2]) / (2 * np.pi))
                believed[:, 2] += 2 * np.pi * turns
        return times, q, believed

    def _inputs(self, times: Integers, q: Array) -> Array:
        robot = self.robot
        if self.inputs.times:
            return _between(times, *self.inputs.sorted(), turns=False)
        if len(times) == 1:
            return np.zeros((1, robot.n_u))
        q_dot = np.gradient(q, times / 1e9, axis=0)
        rates = self.rates.sorted() if self.rates.times else None
        if self._own and rates is not None and np.isfinite(rates[1]).all():
            signs = np.array([-1.0 if name in robot.reversed_joints else 1.0 for name in self._own])
            q_dot[:, robot.n - len(self._own) :] = signs * _between(times, *rates, turns=False)
        if self.twists.times and robot.platform.n_p:
            vx, vy, omega = _between(times, *self.twists.sorted(), turns=False).T
            c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
            q_dot[:, :3] = np.column_stack([c * vx - s * vy, s * vx + c * vy, omega])
        pairs = zip(q, q_dot, strict=True)
        return np.array([np.linalg.lstsq(robot.S(at), rate, rcond=None)[0] for at, rate in pairs])


def _between(times: Integers, given: Integers, rows: Array, turns: bool = True) -> Array:
    """Rows (N, k) at given times, ns, linear in between at the times; `turns`: the third is an angle."""
    if turns:
        rows = rows.copy()
        rows[:, 2] = np.unwrap(rows[:, 2])
    start = given[0]
    return interpolated((times - start) / 1e9, (given - start) / 1e9, rows)
