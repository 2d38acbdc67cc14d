"""A robot's configuration from what its sensors say: absolute encoders of its joints, a localisation; and
how far wheels turned."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, scalar, vector
from nmm.base.errors import InputError, expect_known, few, no_such
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import steered_wheels

#: A locked joint that is measured farther from where it is locked makes another robot of it, rad or m.
HELD = 0.01
#: How far a reading may be beyond the turn that it is within, rad.
SLACK = 1e-3
#: A step is like those before if it is not more than twice as large, and this, rad.
ALIKE = 0.1
#: Without a time, a step of a wheel that is read within one turn may be so large, rad.
MOST = 0.75 * math.pi


class Encoders:
    """What the encoders of a robot's joints say of q."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.where = robot, f"q_from: {robot.name}"
        self.own = robot.q_names[min(3, robot.platform.n_p) :]
        self.renamed = robot.renamed
        self.steered = steered_wheels(robot)
        self.passive = {joint for wheel in robot.wheels for joint in wheel.joints}
        self.following = {mimic.joint for mimic in robot.mimic_joints}
        self.turning = [i for i in robot.following.independent.tolist() if robot.endless[i]]
        self._last: JointReadings | None = None

    def q(self, joints: Mapping[str, float], base: ArrayLike | None, near: ArrayLike | None) -> Array:
        """See `Robot.q_from`."""
        robot, where = self.robot, self.where
        names = tuple(joints)
        if self._last is None or self._last.names != names:
            self._last = JointReadings(self, names)
        values = [scalar(value, f"{where}: joint {name}") for name, value in joints.items()]
        q = np.zeros(robot.n)
        if robot.platform.n_p:
            if base is None:
                raise InputError(where=f"{where}: base", expected="x, y, theta of the platform", got=None)
            q[:3] = vector(base, 3, f"{where}: base")
        elif base is not None:
            raise InputError(where=f"{where}: base", expected="None: it stands on a fixed base", got=base)
        self._last.write(values, q, None if near is None else robot.q(near))
        return q


class JointReadings:
    """Where in q the readings of joints by these names, in this order, belong.

    names : of the readings; `InputError` for one that is no joint's
    others : those of them that are no joints'
    unmeasured : coordinates that may have no reading; they stay as they are

    A reading of a joint: its place among the readings, its coordinate, factor and offset (`Robot.gear`); of
    wheels that steer together: the coordinate, each one's place and angle, ratio and offset of the angle that
    they make (`Robot.corrections`); of mimic joints whose leader has none: where it is written, the leader,
    multiplier and offset.
    """

    def __init__(
        self,
        encoders: Encoders,
        names: tuple[str, ...],
        others: Collection[str] = (),
        unmeasured: Collection[str] = (),
    ) -> None:
        self.names, self._encoders = names, encoders
        robot, where, own = encoders.robot, encoders.where, encoders.own
        coordinate = {name: robot.n - len(own) + i for i, name in enumerate(own)}
        direct: dict[str, tuple[int, int, float, float]] = {}
        steered: dict[str, list[tuple[int, Callable[[float], float]]]] = {}
        self._locked: list[tuple[int, str]] = []
        for place, file_name in enumerate(names):
            name = encoders.renamed.get(file_name, file_name)
            if file_name in others:
                continue
            if name in own:
                direct[name] = place, coordinate[name], *robot.gear(name)
            elif name in encoders.steered:
                by, angle = encoders.steered[name]
                steered.setdefault(by, []).append((place, angle))
            elif name in robot.locked:
                self._locked.append((place, name))
            elif name not in encoders.passive:
                raise no_such("joint", name, (*own, *sorted(encoders.passive)), where)
        self._direct = [*direct.values()]
        self._steered = [
            (coordinate[by], wheels, *robot.corrections.get(by, (1.0, 0.0)))
            for by, wheels in steered.items()
            if by not in direct
        ]
        known = {*direct, *steered}
        self._leaders = []
        for mimic in robot.mimic_joints:
            if mimic.joint in known and mimic.multiplier and mimic.leader not in known:
                known.add(mimic.leader)
                places = coordinate[mimic.joint], coordinate[mimic.leader]
                self._leaders.append((*places, mimic.multiplier, mimic.offset))
        absent = [name for name in own if name not in (*known, *encoders.following, *unmeasured)]
        if absent:
            what = f"no measurement of {few(absent)}"
            raise InputError(what, where=where, expected="each joint's", got=few([*names]))

    def write(self, values: Sequence[float], q: Array, near: Array | None) -> None:
        """Put readings, rad or m, into q (n,), and angles without limits nearest to those of another q."""
        robot = self._encoders.robot
        for place, name in self._locked:
            _check_locked(name, values[place], robot.locked[name], self._encoders.where)
        for place, i, factor, offset in self._direct:
            q[i] = factor * values[place] + offset
        for i, wheels, ratio, offset in self._steered:
            angles = [angle(values[place]) for place, angle in wheels]
            middle = math.atan2(sum(map(math.sin, angles)), sum(map(math.cos, angles)))
            q[i] = ratio * middle + offset
        for i, leader, multiplier, offset in self._leaders:
            q[leader] = (float(q[i]) - offset) / multiplier
        if near is not None:
            for i in self._encoders.turning:
                by = near.item(i) - q.item(i)
                if abs(by) > math.pi:
                    q[i] += 2.0 * math.pi * round(by / (2.0 * math.pi))
        if robot.mimic_joints:
            q[:] = robot.following.placed(q)


def _check_locked(name: str, value: float, held: float, where: str) -> None:
    if abs(value - held) > HELD:
        what = f"{name} is locked at {held:g} (by lock, or --lock) and measured elsewhere"
        raise InputError(what, where=where, got=value)


class Turns:
    """How far wheels turned, by readings that count on, or that begin anew after each turn.

    Parameters
    ----------
    names : of the counters
    wheels : those of them that turn
    wrapped : whether all wheels, or which, are read within one turn, (-π, π] or [0, 2π); None: as the
        readings show, with a warning
    first : readings (k,), rad
    """

    def __init__(
        self,
        names: Sequence[str],
        wheels: Collection[str],
        wrapped: bool | Collection[str] | None,
        first: list[float],
        where: str,
    ) -> None:
        self._names, self._where, self.counts = names, where, first
        known = None if wrapped is None else bool(wrapped)
        self._wrapped = [known if name in wheels else False for name in names]
        if isinstance(wrapped, str) or (wrapped is not None and not isinstance(wrapped, bool)):
            some = (wrapped,) if isinstance(wrapped, str) else tuple(wrapped)
            for name in some:
                expect_known("wheel", name, [name for name in names if name in wheels], f"{where}: wrapped")
            self._wrapped = [name in some for name in names]
        self._first, self._least, self._largest = first, [*first], [*first]
        self._steps, self._most = 0, [0.0] * len(first)
        for k in range(len(first)):
            self._check_within(k, first[k])

    def after(self, readings: list[float], most: Sequence[float]) -> list[float]:
        """The counters (k,) at readings (k,), rad, since those before no more than `most` (k,) apart, rad, as
        far as that is known (finite); `InputError` where full turns are not; nothing is changed."""
        counts = [*readings]
        for k, reading in enumerate(readings):
            wrapped, by = self._wrapped[k], reading - self.counts[k]
            if wrapped or (wrapped is None and abs(by) > math.pi and self._anew(k, by, reading, most[k])):
                self._check_within(k, reading)
                short = math.remainder(by, 2.0 * math.pi)
                far = most[k] if math.isfinite(most[k]) else 0.0
                if far > math.pi or (far == 0.0 and abs(short) > MOST):
                    mend = "readings in shorter intervals, or fastest="
                    self._refuse(k, "may have turned more than half a turn", mend, max(far, abs(short)))
                counts[k] = self.counts[k] + short
        return counts

    def take(self, readings: list[float], counts: list[float]) -> None:
        """Go on from counters that `after` gave for these readings."""
        for k, reading in enumerate(readings):
            if self._wrapped[k] is False:
                continue
            if self._wrapped[k] is None:
                if counts[k] != reading:
                    self._wrapped[k] = True
                    name = self._names[k]
                    warnings.warn(
                        f"{self._where}: {name} is read within one turn: its turns are counted on "
                        f"(wrapped={name!r} says so, wrapped=False that it counts them itself)",
                        RuntimeWarning,
                        stacklevel=4,
                    )
                elif not self._within(k, reading):
                    self._wrapped[k] = False
            if reading < self._least[k]:
                self._least[k] = reading
            elif reading > self._largest[k]:
                self._largest[k] = reading
            self._most[k] = max(self._most[k], abs(counts[k] - self.counts[k]))
        self.counts, self._steps = counts, self._steps + 1

    def _anew(self, k: int, by: float, reading: float, most: float) -> bool:
        """Whether a step of more than half a turn is the end of a turn, not as many radians."""
        if not self._within(k, reading):
            return False
        short = abs(math.remainder(by, 2.0 * math.pi))
        if abs(by) > most:
            return short <= most
        before = 2.0 * self._most[k] + ALIKE
        if self._steps and abs(by) <= before:
            return False
        if not self._steps and self._first[k] == 0.0:
            return False
        if abs(by) > 1.5 * math.pi and short <= (before if self._steps else 0.5 * math.pi):
            return True
        what = "turned by more than half a turn, or is read within one"
        self._refuse(k, what, "wrapped=True, or wrapped=False", abs(by))
        return False

    def _within(self, k: int, reading: float) -> bool:
        """Whether all readings are within one turn."""
        least, largest = min(self._least[k], reading), max(self._largest[k], reading)
        half, whole = math.pi + SLACK, 2.0 * math.pi + SLACK
        return bool((least >= -half and largest <= half) or (least >= -SLACK and largest <= whole))

    def _check_within(self, k: int, reading: float) -> None:
        if self._wrapped[k] and not self._within(k, reading):
            expected = "an angle in (-π, π] or [0, 2π), as wrapped= says"
            raise InputError(where=f"{self._where}: {self._names[k]}", expected=expected, got=reading)

    def _refuse(self, k: int, what: str, expected: str, by: float) -> None:
        raise InputError(f"{self._names[k]} {what}", where=self._where, expected=expected, got=by)
