"""What a loop believes of where its robot is: measurements that can be, moved on by the inputs since."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.control.goal import METRES, unit_codes
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.held_history import HeldHistory
from nmm.plugins.robot.motion_monitor import Contradiction, MotionMonitor


class Refused(StrEnum):
    """Why a measurement was not used."""

    LOST = "lost"
    NOT_FINITE = "not_finite"
    FUTURE = "from_the_future"
    REPEATED = "repeated"
    OUT_OF_ORDER = "out_of_order"
    OLD = "old"
    FROZEN = "frozen"
    JUMP = "jump"


class Tolerances(NamedTuple):
    """watchdog, lag : s; metres, radians : by how much a measurement may be off; others as of `Loop`."""

    watchdog: float
    lag: float
    metres: float
    radians: float
    confirm: int | None
    slip: tuple[float, float] | None


class Jump(NamedTuple):
    """By how much the platform is elsewhere than it was believed, m and rad."""

    m: float
    rad: float


class MeasuredState:
    """Where the robot is, `q` (n,) at the time of the last call; `at` is the time of the last measurement
    that was used, s, -inf before the first one. `history` has to be given the inputs. `contradiction` is that
    of the last measurement with what the inputs asked for, None where there is none."""

    def __init__(self, robot: Robot, tolerances: Tolerances, period: float) -> None:
        self._robot, self._tolerances, self._period = robot, tolerances, period
        remembered = math.ceil((2.0 * tolerances.watchdog + tolerances.lag) / period) + 3
        self.history = HeldHistory(robot, remembered)
        lengths = unit_codes(robot.q_units) == METRES
        self._off = np.where(lengths, tolerances.metres, tolerances.radians)
        self._platform = robot.platform.n_p
        self._full = 2.0 * math.pi * robot.endless
        planar = np.arange(robot.n) < self._platform
        of_platform, of_joints = tolerances.slip or (0.0, 0.0)
        off = np.where(planar, 2.0, 1.0) * self._off  # a localisation is set right now and then
        self._monitor = MotionMonitor(np.where(planar, of_platform, of_joints), off, period)
        self.contradiction: Contradiction | None = None
        self.q = robot.rest
        self.forget()

    def forget(self) -> None:
        """The next measurement may be anywhere."""
        self.at, self._stamp = -math.inf, -math.inf
        self._used: Array | None = None
        self._candidate: Array | None = None
        self._seen: Array | None = None
        self._candidate_at, self._agreed = 0.0, 0
        self._monitor.begin()
        self._still = np.zeros(self._robot.n)
        self._frame: Array | None = None

    def expect_jump(self) -> None:
        """The next measurement that is in time is used wherever it is."""
        self._used = None
        self._monitor.begin()

    def move_frame(self, frame: Array) -> Jump | None:
        """Measurements go on without jumps in a frame that is at the pose `frame` (3,) now, m and rad: where
        the robot was goes with it. By how much, where a measurement may not be off by so much."""
        before, self._frame = self._frame, frame
        if before is None or self.at == -math.inf:
            return None
        earlier = self.q
        self.q = _carried(self.q, before, frame)
        if self._used is not None:
            self._used = _carried(self._used, before, frame)
        if self._candidate is not None:
            self._candidate = _carried(self._candidate, before, frame)
        gone = self.q - earlier
        jump = Jump(float(np.hypot(*gone[:2])), float(abs(gone[2])))
        allowed = jump.m <= self._tolerances.metres and jump.rad <= self._tolerances.radians
        return None if allowed else jump

    @property
    def q_odom(self) -> Array:
        """q (n,) with the platform in the frame in which measurements go on without jumps."""
        return self.q.copy() if self._frame is None else _carried(self.q, self._frame, np.zeros(3))

    @property
    def corrected(self) -> bool:
        """Whether that frame is known."""
        return self._frame is not None

    def move_on(self, since: float, until: float) -> None:
        """No measurement, but inputs, between two calls."""
        if self.at > -math.inf:
            self.q = self.history.moved(self.q, since, until)

    def take(self, now: float, q: ArrayLike | None, at: float) -> tuple[Refused | None, Jump | None]:
        """Use the measurement q (n,) made at the time `at`, or say why not; and whether it has the platform
        elsewhere."""
        refused, read = self._in_time(now, q, at)
        if read is None:
            return refused, None
        earlier, self._stamp = self._stamp, at
        if self._stands_still(read, earlier, at):
            return Refused.FROZEN, None
        jump, self.contradiction = None, None
        if self._used is not None:
            apart = read - self.history.moved(self._used, self.at, at)
            lagging = self.history.way(at - self._tolerances.lag, at)
            if self._is_beyond(apart, self.at, at).any():
                if not self._agrees(read, at):
                    return Refused.JUMP, None
                jump = Jump(float(np.hypot(*apart[:2])), float(abs(apart[2])))
                self._monitor.begin()
            elif self._tolerances.slip is not None:
                way = self.history.way(self.at, at)
                self.contradiction = self._monitor.add(at, apart, way, lagging)
        self._used, self.at, self._candidate = read, at, None
        self.q = self.history.moved(read, at, now)
        return None, jump

    def _in_time(self, now: float, q: ArrayLike | None, at: float) -> tuple[Refused | None, Array | None]:
        if q is None:
            return Refused.LOST, None
        try:
            read = np.array(q, dtype=np.float64)
        except (TypeError, ValueError):
            return Refused.NOT_FINITE, None
        if read.shape != (self._robot.n,) or not (math.isfinite(at) and np.isfinite(read).all()):
            return Refused.NOT_FINITE, None
        if at > now + self._period:
            return Refused.FUTURE, None
        if at <= self._stamp:
            return (Refused.REPEATED if at == self._stamp else Refused.OUT_OF_ORDER), None
        if at < now - self._tolerances.watchdog:
            return Refused.OLD, None
        if self.at > -math.inf:  # sensors wrap angles, q does not
            read += self._full * np.round((self.q - read) / (2.0 * math.pi))
        return None, read

    def _stands_still(self, read: Array, earlier: float, at: float) -> bool:
        """Whether a coordinate is, to the bit, where it was though the inputs moved it by more than what a
        measurement may be off."""
        if self._seen is None:
            self._seen = read
            return False
        changed = read != self._seen
        if self._platform >= 3:
            changed[:2] = changed[:2].any()
        self._seen = read
        self._still = np.where(changed, 0.0, self._still + self.history.way(earlier, at))
        behind = self.history.way(at - self._tolerances.lag, at)
        return bool(np.any(self._still > self._off + behind))

    def _beyond(self, start: Array, since: float, read: Array, at: float) -> Array:
        """Which coordinates (n,) the inputs cannot have brought from where they were to where they are read:
        a robot that lags or slips is somewhere between rest and twice its way."""
        return self._is_beyond(read - self.history.moved(start, since, at), since, at)

    def _is_beyond(self, apart: Array, since: float, at: float) -> Array:
        """The same of how far they are read from where the inputs brought them."""
        way = self.history.way(since - self._tolerances.lag, at)
        return np.asarray(np.abs(apart) > self._off + way)

    def _agrees(self, read: Array, at: float) -> bool:
        """Whether so many measurements in a row have the platform, and it alone, at another place."""
        confirm = self._tolerances.confirm
        if self._used is None or confirm is None or self._platform < 3:
            return False
        if self._beyond(self._used, self.at, read, at)[self._platform :].any():
            return False
        near = self._candidate is not None and not np.any(
            self._beyond(self._candidate, self._candidate_at, read, at)
        )
        self._agreed = self._agreed + 1 if near else 1
        self._candidate, self._candidate_at = read, at
        return self._agreed >= confirm


def _carried(q: Array, before: Array, frame: Array) -> Array:
    """q (n,) of a platform that moves with a frame from one pose (3,) to another."""
    turned = math.remainder(frame[2] - before[2], 2.0 * math.pi)
    c, s = math.cos(turned), math.sin(turned)
    x, y = q[:2] - before[:2]
    moved = q.copy()
    moved[:3] = frame[0] + c * x - s * y, frame[1] + s * x + c * y, q[2] + turned
    return moved
