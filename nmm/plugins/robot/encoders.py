"""A robot's configuration from what its sensors say: absolute encoders of its joints, a localisation; and
how far wheels turned."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping, Sequence

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
        self._renamed = robot.renamed
        self._signs = dict.fromkeys(robot.reversed_joints, -1.0)
        self._steered = steered_wheels(robot)
        self._passive = {joint for wheel in robot.wheels for joint in wheel.joints}
        self._following = {one.joint for one in robot.mimic_joints}
        self._turning = [i for i in robot.following.independent.tolist() if robot.endless[i]]

    def q(self, joints: Mapping[str, float], base: ArrayLike | None, near: ArrayLike | None) -> Array:
        """See `Robot.q_from`."""
        robot, where, own = self.robot, self.where, self.own
        values: dict[str, float] = {}
        steering: dict[str, list[float]] = {}
        for name, given in joints.items():
            value = scalar(given, f"{where}: joint {name}")
            name = self._renamed.get(name, name)
            if name in own:
                values[name] = self._signs.get(name, 1.0) * value
            elif name in self._steered:
                coordinate, angle = self._steered[name]
                steering.setdefault(coordinate, []).append(angle(value))
            elif name in robot.locked:
                _check_locked(name, value, robot.locked[name], where)
            elif name not in self._passive:
                raise no_such("joint", name, (*own, *sorted(self._passive)), where)
        for name, angles in steering.items():
            values.setdefault(name, math.atan2(sum(map(math.sin, angles)), sum(map(math.cos, angles))))
        for one in robot.mimic_joints:
            if one.joint in values and one.multiplier:
                values.setdefault(one.leader, (values[one.joint] - one.offset) / one.multiplier)
        if missing := [name for name in own if name not in values and name not in self._following]:
            what = f"no measurement of {few(missing)}"
            raise InputError(what, where=where, expected="each joint's", got=few([*joints]))
        found = np.zeros(robot.n)
        found[robot.n - len(own) :] = [values.get(name, 0.0) for name in own]
        if robot.platform.n_p:
            if base is None:
                raise InputError(where=f"{where}: base", expected="x, y, theta of the platform", got=None)
            found[:3] = vector(base, 3, f"{where}: base")
        elif base is not None:
            raise InputError(where=f"{where}: base", expected="None: it stands on a fixed base", got=base)
        if near is not None:
            by = (robot.q(near) - found)[self._turning]
            found[self._turning] += 2.0 * math.pi * np.round(by / (2.0 * math.pi))
        return robot.following.placed(found)


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
        first: Array,
        where: str,
    ) -> None:
        self._names, self._where, self.counts = names, where, first
        known = None if wrapped is None else bool(wrapped)
        self._wrapped = {name: known if name in wheels else False for name in names}
        if isinstance(wrapped, str) or (wrapped is not None and not isinstance(wrapped, bool)):
            some = (wrapped,) if isinstance(wrapped, str) else tuple(wrapped)
            for name in some:
                expect_known("wheel", name, [name for name in names if name in wheels], f"{where}: wrapped")
            self._wrapped = {name: name in some for name in names}
        self._first, self._least, self._largest = first, first.copy(), first.copy()
        self._steps, self._most = 0, np.zeros(len(first))
        for k in range(len(first)):
            self._check_within(k, first[k])

    def after(self, readings: Array, most: Array) -> Array:
        """The counters (k,) at readings (k,), rad, since those before no more than `most` (k,) apart, rad, as
        far as that is known (finite); `InputError` where full turns are not; nothing is changed."""
        counts = readings.copy()
        for k, by in enumerate((readings - self.counts).tolist()):
            wrapped = self._wrapped[self._names[k]]
            if wrapped or (wrapped is None and abs(by) > math.pi and self._anew(k, by, readings[k], most[k])):
                self._check_within(k, readings[k])
                short = math.remainder(by, 2.0 * math.pi)
                far = most[k] if math.isfinite(most[k]) else 0.0
                if far > math.pi or (far == 0.0 and abs(short) > MOST):
                    mend = "readings in shorter intervals, or fastest="
                    self._refuse(k, "may have turned more than half a turn", mend, max(far, abs(short)))
                counts[k] = self.counts[k] + short
        return counts

    def take(self, readings: Array, counts: Array) -> None:
        """Go on from counters that `after` gave for these readings."""
        for k, name in enumerate(self._names):
            if self._wrapped[name] is None:
                if counts[k] != readings[k]:
                    self._wrapped[name] = True
                    warnings.warn(
                        f"{self._where}: {name} is read within one turn: its turns are counted on "
                        f"(wrapped={name!r} says so, wrapped=False that it counts them itself)",
                        RuntimeWarning,
                        stacklevel=4,
                    )
                elif not self._within(k, readings[k]):
                    self._wrapped[name] = False
        np.minimum(self._least, readings, out=self._least)
        np.maximum(self._largest, readings, out=self._largest)
        np.maximum(self._most, np.abs(counts - self.counts), out=self._most)
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
        if self._wrapped[self._names[k]] and not self._within(k, reading):
            expected = "an angle in (-π, π] or [0, 2π), as wrapped= says"
            raise InputError(where=f"{self._where}: {self._names[k]}", expected=expected, got=float(reading))

    def _refuse(self, k: int, what: str, expected: str, by: float) -> None:
        raise InputError(f"{self._names[k]} {what}", where=self._where, expected=expected, got=by)
