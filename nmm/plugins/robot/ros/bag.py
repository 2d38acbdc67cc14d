"""Logs of robots read back: a rosbag2 folder, an .mcap, .db3 or ROS 1's .bag file as a trajectory."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.control.step.quantities import saved
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import Verdict
from nmm.plugins.robot.ros.recorded import Names, Recorded, told_of
from nmm.plugins.robot.ros.routes import Route, routes
from nmm.plugins.robot.ros.tracks import by_differences, contradict, settle

#: More samples are no bag that one looks at.
MOST = 2_000_000
#: What is left out, or missing in between, for longer, s, is told.
LONG = 1.0


def read_bag(
    path: str | Path,
    robot: Robot,
    *,
    joints: str | Sequence[str] = "joint_states",
    odometry: str = "odom",
    tf: str = "tf",
    map: str = "map",
    odom: str = "odom",
    base: str | None = None,
    namespace: str = "",
    prefix: str | None = None,
    frame: str | None = None,
) -> Trajectory:
    """The motion of a robot in a rosbag2 folder, an .mcap, a .db3 or ROS 1's .bag file.

    It is sampled where joint states come, each joint linear between its own stamps; the platform is where the
    frame `map` has it or, in a bag without, where odometry does. Each edge of a chain of transforms is
    interpolated on its own stamps; one that jumps stays until then. With both, odometry is `believed`. Inputs
    are those recorded (in a log of nmm's), or the nearest to the velocities recorded, or else to differences
    of q. Times are the messages' headers', from the first sample on; messages out of order are sorted. Joints
    that the robot does not have are left out. What is doubtful is a warning of the trajectory, and a
    `RuntimeWarning`.

    Parameters
    ----------
    path : the bag; of one that lacks its end, what is there is read
    robot : whose it is
    joints, odometry, tf : topics of JointState (or several), Odometry and TFMessage, /tf_static beside the
        latter; without a slash in front in the namespace, where /tf may be all robots'
    map, odom : frames
    base : a frame of the platform; by default any that the robot's file, or what is static in TF, has fixed
        to it. Poses and velocities of such frames are brought to the reference point. One that neither knows
        is taken for the reference point's
    namespace : that of the topics
    prefix : what the names of the robot's frames begin with; the namespace, where there are such frames
    frame : the end-effector's frame, whose path is shown

    Returns
    -------
    Trajectory : without a task: r, errors and objective are empty or zero

    Raises
    ------
    InputError : no bag, a damaged one, or one of another robot: a joint is missing; no such topic; odometry
        of a frame from which nothing leads to the platform

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    >>> recorded = nmm.read_bag(run.save_mcap("run.mcap"), run.robot, frame="ee")
    >>> bool(np.abs(recorded.q - run.q).max() < 1e-12)
    True
    """
    file = Path(path)
    names = Names(joints, odometry, tf, map, odom, base, namespace, prefix)
    with told_of(file):
        motion = _RecordedMotion(Recorded(robot, file, names))
    t = (motion.times - motion.times[0]) / 1e9
    for finding in motion.findings:
        warnings.warn(f"{file.name}: {finding}", RuntimeWarning, stacklevel=2)
    return as_trajectory(
        robot, t, motion.q, motion.u, motion.findings, believed=motion.believed, frame=frame, label=file.stem,
        resolver="bag",
    )  # fmt: skip


def as_trajectory(
    robot: Robot,
    t: Array,
    q: Array,
    u: Array,
    findings: Sequence[Finding],
    *,
    frame: str | None,
    label: str,
    resolver: str,
    believed: Array | None = None,
) -> Trajectory:
    """A trajectory of what was recorded: times (N,), s, q (N, n), u (N, n_u); without a task."""
    count = len(t)
    q_dot = np.einsum("kij,kj->ki", velocity_maps(robot, q), u)
    place = None
    if frame is not None:
        place = np.array([Configuration(robot, at).placement(frame).translation for at in q])
    sizes = {"N": count, "n": robot.n, "m": robot.n_u}
    arrays = {quantity.name: quantity.absent(**sizes) for quantity in saved() if not quantity.optional}
    arrays |= {"t": t, "q": q, "u": u, "q_dot": q_dot, "path": place, "believed": believed}
    return Trajectory.of(
        arrays,
        robot=robot,
        r_names=(),
        r_units=(),
        resolver=resolver,
        method="recorded",
        dt=float(np.median(np.diff(t))) if count > 1 else 0.0,
        verdict=Verdict().after(findings),
        frame=frame,
        label=label,
    )


class _RecordedMotion:
    """Times (N,), ns, q (N, n), u (N, n_u) of what was recorded, and `believed`, what odometry has beside a
    map."""

    def __init__(self, recorded: Recorded) -> None:
        self.recorded, self.robot = recorded, recorded.robot
        self.findings = list(recorded.findings)
        world, counted = routes(recorded) if self.robot.platform.n_p else (None, None)
        both = [route for route in (world, counted) if route is not None]
        edges = {edge: None for route in both for edge, _ in route.way if not edge.static}
        self.findings += settle([*recorded.tracks(), *((edge.topic, edge.track) for edge in edges)])
        for route in both:
            self.findings += route.findings
        self.times = self._times(world)
        self.q, self.believed = self._configurations(world, counted)
        for edge, jump in {edge: jump for route in both for edge, jump in route.told_jumps().items()}.items():
            at = (jump.pop("ns") - self.times[0]) / 1e9
            self.findings.append(Finding("pose_jumps", {"edge": edge.name, **jump}, {"t": at}))
        self.u = self._inputs(world, counted)
        self.findings = [*{str(finding): finding for finding in self.findings}.values()]

    def _times(self, world: Route | None) -> Integers:
        """When there are samples: where any joint's position comes, all are known, and the platform is."""
        recorded = self.recorded
        if recorded.own:
            known = {name: recorded.positions[name].sorted()[0] for name in recorded.positions_of}
            times = np.unique(np.concatenate([*known.values()]))
            times = times[times >= max(stamps[0] for stamps in known.values())]
            self._tell_silent(known, times)
        elif world is not None and world.carrier is not None:
            times = world.carrier.poses[0]
        else:
            raise InputError("neither joints nor a platform that moves: no times")
        expect(len(times) < MOST, "joint states", f"at most {MOST}", len(times))
        if world is None:
            return times
        first, last = world.span()
        within = (times >= first) & (times <= last)
        if not within.any():
            apart = f"{(first - times[0]) / 1e9:.3g} to {(last - times[0]) / 1e9:.3g} s"
            what = f"the platform's pose is known from {apart} after the first joint state, the last is at"
            what += f" {(times[-1] - times[0]) / 1e9:.3g} s"
            raise InputError(what, expected="joint states while the platform's pose is known")
        left = (np.ptp(times) - np.ptp(times[within])) / 1e9
        if left > LONG:
            self.findings.append(Finding("platform_unknown", {"s": left}))
        return np.asarray(times[within])

    def _tell_silent(self, known: dict[str, Integers], times: Integers) -> None:
        for name, stamps in known.items():
            usual = 3 * np.diff(stamps).max() if len(stamps) > 1 else 0
            if len(times) and times[-1] - stamps[-1] > max(usual, 1e9 * LONG):
                t = max(0.0, (stamps[-1] - times[0]) / 1e9)
                where = {"t": t, "last": (times[-1] - times[0]) / 1e9}
                self.findings.append(Finding("joint_silent", {"name": name}, where))

    def _configurations(self, world: Route | None, counted: Route | None) -> tuple[Array, Array | None]:
        robot, times, recorded = self.robot, self.times, self.recorded
        q = np.zeros((len(times), robot.n))
        if recorded.own:
            names = [*recorded.positions]
            rows = np.column_stack([recorded.position(name).between(times) for name in names])
            base = np.zeros(3) if robot.platform.n_p else None
            steered = not {*names} <= {*recorded.own, *robot.locked}
            for k, row in enumerate(rows.tolist()):  # swivels say an angle up to full turns
                near = q[k - 1] if steered and k else None
                q[k] = robot.q_from(dict(zip(names, row, strict=True)), base, near)
        if world is None:
            return q, None
        q[:, :3] = world.base(times)
        self._tell_gaps(world)
        if counted is None:
            return q, None
        believed = q.copy()
        believed[:, :3] = counted.base(times)
        believed[:, 2] += 2 * np.pi * np.round((q[0, 2] - believed[0, 2]) / (2 * np.pi))
        return q, believed

    def _tell_gaps(self, world: Route) -> None:
        stamps = self.times[:0] if world.carrier is None else world.carrier.poses[0]
        lasts = np.diff(stamps)
        for k in np.flatnonzero(lasts > max(1e9 * LONG, 10 * np.median(lasts) if len(lasts) else 0)):
            if np.any((self.times > stamps[k]) & (self.times < stamps[k + 1])):
                t, end = ((stamps[i] - self.times[0]) / 1e9 for i in (k, k + 1))
                self.findings.append(Finding("platform_silent", {}, {"t": float(t), "end": float(end)}))

    def _inputs(self, world: Route | None, counted: Route | None) -> Array:
        robot, times, recorded = self.robot, self.times, self.recorded
        if len(recorded.inputs):
            return recorded.inputs.between(times)
        if len(times) == 1:
            return np.zeros((1, robot.n_u))
        t = (times - times[0]) / 1e9
        q_dot = by_differences(t, self.q, np.zeros(len(times) - 1, dtype=bool))
        contradicted: dict[bool, list[str]] = {}
        for i, name in enumerate(recorded.own, robot.n - len(recorded.own)):
            if name in recorded.velocities and name in recorded.positions:
                position, velocity = recorded.position(name), recorded.velocities[name]
                stamps, values = position.sorted()
                if contradict(stamps, values, velocity.between(stamps)):
                    zero = not np.any(velocity.rows)
                    contradicted.setdefault(zero, []).append(name)
                else:
                    q_dot[:, i] = robot.gear(name)[0] * velocity.between(times)[:, 0]
        if world is not None:
            q_dot[:, :3] = self._platform_rates(counted or world, t, contradicted)
        self.findings += [
            Finding("rates_contradict", {"names": names, "zero": zero})
            for zero, names in contradicted.items()
        ]
        maps = velocity_maps(robot, self.q)
        least = np.linalg.pinv(maps, rcond=np.finfo(float).eps * max(maps.shape[1:]))
        return np.einsum("kij,kj->ki", least, q_dot)

    def _platform_rates(self, route: Route, t: Array, contradicted: dict[bool, list[str]]) -> Array:
        """Rates (N, 3) of x, y, theta: of the twists, or by differences of what counts the motion, which no
        localisation corrects."""
        twists, pose = self.recorded.twists, route.base(self.times)
        if len(twists) and not self._contradicts(route):
            return along(twists.between(self.times), self.q[:, 2])
        if len(twists):
            source = f"the twist of {self.recorded.odometry_topic}"
            contradicted.setdefault(not np.any(twists.rows), []).append(source)
        rates = by_differences(t, pose, route.breaks(self.times))
        return along(rates, self.q[:, 2] - pose[:, 2])

    def _contradicts(self, route: Route) -> bool:
        """Whether the twists are not those of the poses."""
        stamps, twists = self.recorded.twists.sorted()
        first, last = route.span()
        within = (stamps >= first) & (stamps <= last)
        stamps, twists = stamps[within], twists[within]
        if len(stamps) < 3:
            return False
        pose = route.base(stamps)
        rates = along(twists, pose[:, 2])
        parts = np.split(np.arange(len(stamps)), np.flatnonzero(route.breaks(stamps)) + 1)
        return any(
            contradict(stamps[part], pose[part][:, some], rates[part][:, some])
            for part in parts
            for some in ([0, 1], [2])
        )


def velocity_maps(robot: Robot, q: Array) -> Array:
    """S (N, n, n_u) at N samples q (N, n): of the arm the same at all."""
    n_p, p, following = robot.platform.n_p, robot.platform.p, robot.following
    maps = np.tile(robot.S(q[0]), (len(q), 1, 1))
    maps[:, :n_p, :p] = robot.platform.velocity_maps(q[:, :n_p])[0]
    maps[:, following.columns] = following.multipliers[:, np.newaxis] * maps[:, following.leaders]
    return maps


def along(rates: Array, angle: Array) -> Array:
    """Velocities (N, 3) of x, y and theta on axes turned by -angle (N,)."""
    c, s = np.cos(angle), np.sin(angle)
    vx, vy, omega = rates.T
    return np.column_stack([c * vx - s * vy, s * vx + c * vy, omega])
