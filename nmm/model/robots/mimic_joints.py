"""Mimic joints, and the limits that they leave the joints that they follow."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import expect, expect_known

#: How far a follower may be from its leader, and limits from meeting, rad or m: files have a few digits.
SLACK = 1e-9


@dataclass(frozen=True)
class MimicJoint:
    """A mimic joint: it stands at `multiplier` times another's value plus `offset` (rad or m).

    Examples
    --------
    >>> finger = nmm.extending.MimicJoint("right_finger", "left_finger", multiplier=-1.0, offset=0.01)
    >>> str(finger), round(finger.value(0.03), 6)
    ('right_finger = -left_finger + 0.01', -0.02)
    """

    joint: str
    leader: str
    multiplier: float = 1.0
    offset: float = 0.0

    def __str__(self) -> str:
        """ "k = -0.5 j + 0.1"."""
        factor = {1.0: "", -1.0: "-"}.get(self.multiplier, f"{self.multiplier:.6g} ")
        ahead = f" {'-' if self.offset < 0.0 else '+'} {abs(self.offset):.6g}" if self.offset else ""
        return f"{self.joint} = {factor}{self.leader}{ahead}"

    def value(self, leader: float) -> float:
        """Where it stands with its leader there."""
        return self.multiplier * leader + self.offset

    def with_names(self, names: Mapping[str, str]) -> MimicJoint:
        """The same with new names of joints, by the old ones."""
        joint, leader = (names.get(name, name) for name in (self.joint, self.leader))
        return MimicJoint(joint, leader, self.multiplier, self.offset)

    def renamed(self, prefix: str) -> MimicJoint:
        """The same with a prefix before both names."""
        return MimicJoint(prefix + self.joint, prefix + self.leader, self.multiplier, self.offset)

    def reversed(self, names: Collection[str]) -> MimicJoint:
        """The same where these joints count their angles with the other sign."""
        own, leaders = (-1.0 if name in names else 1.0 for name in (self.joint, self.leader))
        return MimicJoint(self.joint, self.leader, own * leaders * self.multiplier, own * self.offset)


def settled(
    mimic_joints: Sequence[MimicJoint], standing: Mapping[str, float]
) -> tuple[dict[str, tuple[str, float]], tuple[MimicJoint, ...]]:
    """Mimic joints fixed with their leaders in `standing`, with leader and value (rad or m); and those that
    move, each after its leader."""
    values = dict(standing)
    still: dict[str, tuple[str, float]] = {}
    for one in mimic_joints:
        if one.leader in values:
            values[one.joint] = one.value(values[one.leader])
            still[one.joint] = one.leader, values[one.joint]
    return still, tuple(one for one in mimic_joints if one.joint not in still)


def first_leaders(mimic_joints: Iterable[MimicJoint]) -> tuple[MimicJoint, ...]:
    """The mimic joints, each after its leader, made to follow independent joints."""
    found: dict[str, MimicJoint] = {}
    for one in mimic_joints:
        ahead = found.get(one.leader)
        if ahead is not None:
            factor, offset = one.multiplier * ahead.multiplier, one.value(ahead.offset)
            one = MimicJoint(one.joint, ahead.leader, factor, offset)
        found[one.joint] = one
    return tuple(found.values())


class MimicJoints:
    """The mimic joints among n coordinates: q[columns] = multipliers q[leaders] + offsets.

    columns, leaders (k,) : indices of the mimic joints and of their independent leaders
    multipliers, offsets (k,) : 1 and rad, or m (m/rad for a sliding joint that follows a turning one)
    independent (n - k,) : indices of the independent coordinates

    `InputError` for an unknown coordinate, and for a joint with two leaders or a mimic joint as leader."""

    def __init__(self, mimic_joints: Sequence[MimicJoint], names: Sequence[str]) -> None:
        joints = [one.joint for one in mimic_joints]
        for one in mimic_joints:
            where = f"followers: {one}"
            for name in (one.joint, one.leader):
                expect_known("coordinate", name, names, where)
            independent = one.leader not in joints and joints.count(one.joint) == 1
            expect(independent, where, "one leader, which follows no other joint")
        self.mimic_joints = tuple(mimic_joints)
        self.columns = np.array([names.index(name) for name in joints], dtype=np.int64)
        self.leaders = np.array([names.index(one.leader) for one in mimic_joints], dtype=np.int64)
        self.multipliers = np.array([one.multiplier for one in mimic_joints], dtype=np.float64)
        self.offsets = np.array([one.offset for one in mimic_joints], dtype=np.float64)
        self.independent = np.setdiff1d(np.arange(len(names)), self.columns)

    @property
    def table(self) -> Array:
        """Rows of mimic joint, leader, multiplier and offset, (k, 4), for compiled code."""
        return np.column_stack([self.columns, self.leaders, self.multipliers, self.offsets])

    @property
    def carried(self) -> Array:
        """What a unit of each independent coordinate moves, (n, n - k): itself and its mimic joints."""
        rows = np.eye(len(self.independent) + len(self.columns))
        rows[self.columns] = self.multipliers[:, np.newaxis] * rows[self.leaders]
        return rows[:, self.independent]

    def placed(self, q: Array) -> Array:
        """A copy of q (..., n) with the mimic joints where their leaders put them."""
        found = np.array(q, dtype=np.float64)
        found[..., self.columns] = self.multipliers * found[..., self.leaders] + self.offsets
        return found

    def narrowed(self, limits: Array) -> tuple[Array, tuple[MimicJoint, ...]]:
        """Limits (n, 2), rad or m, narrowed to keep mimic joints within their own; and mimic joints ignored
        because they would leave their leader no room: files give them limits of the wrong sign."""
        found, contrary = limits.copy(), []
        for one, f, leader in zip(self.mimic_joints, self.columns, self.leaders, strict=True):
            own = limits[f] - one.offset
            allowed = np.sort(own / one.multiplier) if one.multiplier else np.array([-np.inf, np.inf])
            room = max(allowed[0], found[leader, 0]), min(allowed[1], found[leader, 1])
            had_room = found[leader, 1] - found[leader, 0] > SLACK
            fits = own[0] <= SLACK and own[1] >= -SLACK if not one.multiplier else room[1] - room[0] > SLACK
            if fits:
                found[leader] = room
            elif had_room or room[1] - room[0] < -SLACK:
                contrary.append(one)
        for one, f, leader in zip(self.mimic_joints, self.columns, self.leaders, strict=True):
            found[f] = np.sort([one.value(end) for end in found[leader]]) if one.multiplier else one.offset
        return found, tuple(contrary)

    def slowed(self, speeds: Array) -> Array:
        """Largest speeds (n,), rad/s or m/s, that keep mimic joints within theirs."""
        found = speeds.copy()
        for f, leader, m in zip(self.columns, self.leaders, np.abs(self.multipliers), strict=True):
            if m:
                found[leader] = min(found[leader], speeds[f] / m)
        return found
