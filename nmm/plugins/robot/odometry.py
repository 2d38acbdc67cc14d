"""Odometry: where a platform is, by what its wheels turned and its own joints stand at."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, matrix, scalar, vector
from nmm.base.errors import InputError, expect_kind, expect_known, few, no_such
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import Memory
from nmm.base.text_format import apart
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates, wheel_shares
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.plugins.robot.counted_motion import INPUTS, MOVE, Counted, inputs_of_record, move_by_record
from nmm.plugins.robot.encoders import Encoders, JointReadings, Turns

#: A counter may run so much faster than the fastest, and jump by that, rad or m: stamps are not exact.
FASTER, JUMPS = 1.5, 0.1
#: Between two readings no counter goes farther, rad or m, whatever the time.
FARTHEST = 1e6
#: Counters whose rows are less regular may leave inputs undetermined.
DETERMINED = 1e-9


def counted_wheels(robot: Robot) -> list[str]:
    """The wheels on the main body or on steering joints, whose turning says how it moves; not a trailer's."""
    steered = {-1, *robot.rate_coordinates[: robot.platform.p].tolist()}
    return [name for name, row in zip(*wheel_rates(robot), strict=True) if int(row[4]) in steered]


class Counters:
    """What counts a platform's inputs: its wheels' encoders and, by the inputs' names, what counts these.

    names : the counters, in order; `InputError` for one that is no wheel whose turning the inputs determine
    """

    def __init__(self, robot: Robot, names: Mapping[str, float], where: str) -> None:
        self.robot, self.where = robot, where
        wheels, rows = wheel_rates(robot)
        platform = robot.platform
        #: Its own joints whose rates are inputs: by the index of the input.
        self.steered = {int(c): int(i) for i, c in enumerate(robot.rate_coordinates[: platform.p]) if c >= 3}
        self.names = tuple(names)
        counted = [*wheels, *platform.inputs]
        for name in names:
            if name not in counted:
                raise no_such("wheel", name, counted, where)
        places = [counted.index(name) for name in names]
        steered = np.full(platform.p, -1)
        steered[[*self.steered.values()]] = [*self.steered]
        #: What the step of odometry reads.
        self.record = Counted(
            platform.velocity_map.address,
            platform.parameters,
            platform.n_p,
            rows,
            np.array([place if place < len(wheels) else len(wheels) - 1 - place for place in places]),
            steered,
        )
        memory = Memory()
        memory.add(self.record)
        self.blocks = memory.blocks()
        self._write_inputs = checked_by_caller(inputs_of_record, INPUTS)

    def matrix(self, own: Array) -> tuple[Array, Array]:
        """What inputs (p,) add to the counters (k,) and to the platform's pose in its own axes (3,), with its
        own joints at `own` (n_p - 3,): (k, p), (3, p)."""
        p = self.robot.platform.p
        C, B = np.zeros((len(self.names), p)), np.zeros((3, p))
        self._write_inputs(*self.blocks, np.array(own, dtype=np.float64), C, B)
        return C, B

    def solved(self, M: Array, counts: Array, steered: Mapping[int, float]) -> Array:
        """The inputs (p,) nearest to the counts (k,), with those known that turn its own joints; `InputError`
        names inputs that are not determined."""
        known, free = np.zeros(M.shape[1]), np.ones(M.shape[1], dtype=bool)
        for coordinate, rate in steered.items():
            known[self.steered[coordinate]] = rate
            free[self.steered[coordinate]] = False
        slopes = np.zeros(M.T.shape)
        slopes[free] = np.linalg.pinv(M[:, free])
        seen = np.diag(slopes @ M)
        lost = [
            name
            for name, share, asked in zip(self.robot.platform.inputs, seen, free, strict=True)
            if asked and share < 1.0 - 1e-9
        ]
        if lost:
            what = f"the counters do not determine {few(lost)}"
            expected = "more wheels, or these inputs' own"
            raise InputError(what, where=self.where, expected=expected, got=few(self.names))
        return known + slopes @ (counts - M @ known)


class Odometry:
    """A platform's pose by its wheels' encoders, exact along arcs, with a covariance. Made by
    `Robot.odometry`.

    Between two readings inputs are taken as constant. The way is integrated by a Magnus expansion of fourth
    order: without error where the platform's own joints stand still, else with one of the fifth power of the
    step. Steering angles are measured; hitches may be: without encoder they follow as they roll.

    Attributes
    ----------
    q (n,) : where the robot is by its encoders, m and rad; theta is not wrapped
    covariance (3, 3) : of x, y, theta, m and rad

    Examples
    --------
    >>> robot = nmm.load("differential_base")
    >>> odometry = robot.odometry(robot.rest, {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0})
    >>> odometry.update({"left_wheel_joint": 2.0, "right_wheel_joint": 2.0}).round(3)
    array([0.2, 0. , 0. ])
    """

    def __init__(
        self,
        robot: Robot,
        q: ArrayLike,
        encoders: Mapping[str, float],
        slip: float | Mapping[str, float] = 1.0,
        spread: float = 0.0,
        covariance: ArrayLike | None = None,
        fastest: float | Mapping[str, float] | None = None,
        wrapped: bool | Collection[str] | None = None,
        t: float | None = None,
    ) -> None:
        expect_kind(robot, Robot, "odometry: robot", "a Robot, as nmm.load gives it")
        expect_kind(encoders, Mapping, f"odometry: {robot.name}: encoders", "readings by name")
        self._where = f"odometry: {robot.name}"
        if robot.platform.n_p < 3:
            raise InputError(where=self._where, expected="a platform that moves", got=robot.platform.name)
        self.robot = robot
        self.q = robot.q(q)
        counted = [name for name in encoders if name in (*counted_wheels(robot), *robot.platform.inputs)]
        self._counters = Counters(robot, dict.fromkeys(counted, 0.0), self._where)
        #: What the step of odometry reads.
        self.record = self._counters.record
        where = f"{self._where}: slip"
        #: Of each counter, the share of its turning that moves the platform (k,).
        self.shares = by_counter(slip, counted, np.ones(len(counted)), where)
        limits = {wheel.joint: wheel.velocity for wheel in robot.wheels}
        usual = np.array([limits.get(name, math.inf) for name in counted])
        self._fastest = by_counter(fastest, counted, usual, f"{self._where}: fastest").tolist()
        self._t = math.nan if t is None else scalar(t, f"{self._where}: t")
        #: How far the counters went at the last update (k,), rad or m.
        self.last_counts = np.zeros(len(counted))
        self._spread = np.full(len(counted), scalar(spread, f"{self._where}: spread", least=0.0))
        self.covariance = np.zeros((3, 3))
        if covariance is not None:
            self.covariance = matrix(covariance, (3, 3), f"{self._where}: covariance")
        own = robot.q_names[3 : robot.platform.n_p]
        self._names: tuple[str, ...] = ()
        self._up = np.zeros(robot.n_u)
        self._hitches = [name for name in own if robot.coordinate(name) not in self._counters.steered]
        self._held = HeldInputs(robot)
        self._encoders = Encoders(robot)
        wheels, first = counted_wheels(robot), self._read(encoders)[0]
        self._turns = Turns(self._counters.names, wheels, wrapped, first, self._where)
        self._move = checked_by_caller(move_by_record, MOVE)
        self._check_determined(self.q[3 : robot.platform.n_p])

    @property
    def counters(self) -> tuple[str, ...]:
        """What counts, by name, in the order of the encoders at first."""
        return self._counters.names

    def update(self, encoders: Mapping[str, float], t: float | None = None) -> Array:
        """q (n,) at these readings, rad or m: of the wheels that were counted at first, and of the joints.

        Parameters
        ----------
        encoders : by name
        t : when they were read, s; since the reading before, no counter can have moved more than half as much
            again as its `fastest`, and 0.1 rad or m

        Raises
        ------
        InputError : a wheel or joint is missing, a number is not finite, a counter jumped; nothing is changed
            then
        """
        readings, ahead = self._read(encoders)
        most, lasted = [math.inf] * len(readings), math.nan
        if t is not None:
            t = scalar(t, f"{self._where}: t")
            lasted = max(t - self._t, 0.0)
            most = [FASTER * rate * lasted + JUMPS for rate in self._fastest]  # infinite * 0 is no number
        counts = self._turns.after(readings, most)
        by = [count - before for count, before in zip(counts, self._turns.counts, strict=True)]
        for k, way in enumerate(by):
            if abs(way) > min(most[k], FARTHEST):
                within = "between two readings" if t is None else f"in {lasted:.3g} s"
                what = f"{self._counters.names[k]} jumped: it cannot turn so far {within}"
                _, allowed = apart(abs(way), min(most[k], FARTHEST), digits=3)
                raise InputError(what, where=self._where, expected=f"at most {allowed}", got=way)
        self.last_counts[:] = by
        q, n_p = self.q, self.robot.platform.n_p
        P = self.covariance.copy()
        blocks, noise, up = self._counters.blocks, self._spread, self._up
        if self._move(*blocks, q, ahead, self.last_counts, self.shares, noise, up, P) < DETERMINED:
            self._check_determined(0.5 * (q[3:n_p] + ahead[3:n_p]))
        if self._unmeasured:
            rolled = self._held(q, up, 1.0)
            for i in self._unmeasured:
                ahead[i] = rolled[i]
        self.covariance = P
        self._turns.take(readings, counts)
        self.q = ahead
        self._t = math.nan if t is None else t
        return ahead.copy()

    def _check_determined(self, own: Array) -> None:
        """`InputError` for inputs that the counters do not show with its own joints at `own` (n_p - 3,)."""
        M, _ = self._counters.matrix(own)
        counts = np.zeros(len(self._counters.names))
        self._counters.solved(M, counts, dict.fromkeys(self._counters.steered, 0.0))

    def correct(self, pose: ArrayLike, covariance: ArrayLike | None = None) -> None:
        """Put the platform at a pose (3,) that was measured, m and rad, with its covariance (3, 3), zero by
        default. Theta is taken nearest to what it was."""
        x, y, theta = vector(pose, 3, f"{self._where}: pose")
        new = np.zeros((3, 3))
        if covariance is not None:
            new = matrix(covariance, (3, 3), f"{self._where}: covariance")
        q = self.q.copy()
        q[:3] = x, y, q[2] + math.remainder(theta - q[2], 2.0 * math.pi)
        self.q, self.covariance = q, new

    def _read(self, encoders: Mapping[str, float]) -> tuple[list[float], Array]:
        """The counters' readings, and q with the joints where they are measured."""
        if not isinstance(encoders, dict):
            expect_kind(encoders, Mapping, f"{self._where}: encoders", "readings by name")
        names = tuple(encoders)
        if names != self._names:
            self._name(names)
        values = [*encoders.values()]
        for i, value in enumerate(values):
            if not (isinstance(value, float) and math.isfinite(value)):
                values[i] = scalar(value, f"{self._where}: {names[i]}")
        q = self.q.copy()
        self._joints.write(values, q, self.q)
        return [float(values[i]) for i in self._places], q

    def _name(self, names: tuple[str, ...]) -> None:
        """Find where readings by these names, in this order, belong."""
        counters, robot = self._counters.names, self.robot
        absent = [name for name in counters if name not in names]
        if absent:
            raise InputError(f"no reading of {few(absent)}", where=self._where, got=[*names])
        self._joints = JointReadings(self._encoders, names, robot.platform.inputs, self._hitches)
        self._places = [names.index(name) for name in counters]
        self._unmeasured = [robot.coordinate(name) for name in self._hitches if name not in names]
        self._names = names


def by_counter(
    value: float | Mapping[str, float] | None, names: Sequence[str], usual: Array, where: str
) -> Array:
    """Numbers (k,), one a counter: the same for all, or by name."""
    if isinstance(value, Mapping):
        for name, number in value.items():
            expect_known("wheel", name, names, where)
            usual[names.index(name)] = scalar(number, f"{where} of {name}")
    elif value is not None:
        usual[:] = scalar(value, where)
    return usual


def wheel_speeds(robot: Robot, u: ArrayLike, q: ArrayLike | None = None) -> dict[str, float]:
    """See `Robot.wheel_speeds`."""
    names, rows = wheel_rates(robot)
    p, n_p = robot.platform.p, robot.platform.n_p
    up = vector(u, (p, robot.n_u), f"wheel_speeds: {robot.name}")[:p]
    at = robot.q(q)
    rates = wheel_shares(rows, at[np.newaxis])[0][:, :n_p] @ robot.platform.G(at[:n_p]) @ up
    return dict(zip(names, rates.tolist(), strict=True))


def platform_inputs(robot: Robot, speeds: Mapping[str, float], q: ArrayLike | None = None) -> Array:
    """See `Robot.platform_inputs`."""
    where = f"platform_inputs: {robot.name}"
    counters = Counters(robot, speeds, where)
    given = np.array([scalar(value, f"{where}: {name}") for name, value in speeds.items()])
    M, _ = counters.matrix(robot.q(q)[3 : robot.platform.n_p])
    return counters.solved(M, given, {})
