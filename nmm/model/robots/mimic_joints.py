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
    for mimic in mimic_joints:
        if mimic.leader in values:
            values[mimic.joint] = mimic.value(values[mimic.leader])
            still[mimic.joint] = mimic.leader, values[mimic.joint]
    return still, tuple(mimic for mimic in mimic_joints if mimic.joint not in still)


def first_leaders(mimic_joints: Iterable[MimicJoint]) -> tuple[MimicJoint, ...]:
    """The mimic joints, each after its leader, made to follow independent joints."""
    resolved: dict[str, MimicJoint] = {}
    for mimic in mimic_joints:
        ahead = resolved.get(mimic.leader)
        if ahead is not None:
            factor, offset = mimic.multiplier * ahead.multiplier, mimic.value(ahead.offset)
            mimic = MimicJoint(mimic.joint, ahead.leader, factor, offset)
        resolved[mimic.joint] = mimic
    return tuple(resolved.values())


class MimicJoints:
    """The mimic joints among n coordinates: q[columns] = multipliers q[leaders] + offsets.

    columns, leaders (k,) : indices of the mimic joints and of their independent leaders
    multipliers, offsets (k,) : 1 and rad, or m (m/rad for a sliding joint that follows a turning one)
    independent (n - k,) : indices of the independent coordinates

    `InputError` for an unknown coordinate, and for a joint with two leaders or a mimic joint as leader."""

    def __init__(self, mimic_joints: Sequence[MimicJoint], names: Sequence[str]) -> None:
        joints = [mimic.joint for mimic in mimic_joints]
        for mimic in mimic_joints:
            where = f"followers: {mimic}"
            for name in (mimic.joint, mimic.leader):
                expect_known("coordinate", name, names, where)
            independent = mimic.leader not in joints and joints.count(mimic.joint) == 1
            expect(independent, where, "one leader, which follows no other joint")
        self.mimic_joints = tuple(mimic_joints)
        self.columns = np.array([names.index(name) for name in joints], dtype=np.int64)
        self.leaders = np.array([names.index(mimic.leader) for mimic in mimic_joints], dtype=np.int64)
        self.multipliers = np.array([mimic.multiplier for mimic in mimic_joints], dtype=np.float64)
        self.offsets = np.array([mimic.offset for mimic in mimic_joints], dtype=np.float64)
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
        placed = np.array(q, dtype=np.float64)
        placed[..., self.columns] = self.multipliers * placed[..., self.leaders] + self.offsets
        return placed

    def narrowed(self, limits: Array) -> tuple[Array, tuple[MimicJoint, ...]]:
        """Limits (n, 2), rad or m, narrowed to keep mimic joints within their own; and mimic joints ignored
        because they would leave their leader no room: files give them limits of the wrong sign."""
        bounds, contrary = limits.copy(), []
        for mimic, f, leader in zip(self.mimic_joints, self.columns, self.leaders, strict=True):
            own = limits[f] - mimic.offset
            allowed = np.sort(own / mimic.multiplier) if mimic.multiplier else np.array([-np.inf, np.inf])
            room = max(allowed[0], bounds[leader, 0]), min(allowed[1], bounds[leader, 1])
            had_room = bounds[leader, 1] - bounds[leader, 0] > SLACK
            fits = own[0] <= SLACK and own[1] >= -SLACK if not mimic.multiplier else room[1] - room[0] > SLACK
            if fits:
                bounds[leader] = room
            elif had_room or room[1] - room[0] < -SLACK:
                contrary.append(mimic)
        for mimic, f, leader in zip(self.mimic_joints, self.columns, self.leaders, strict=True):
            bounds[f] = (
                np.sort([mimic.value(end) for end in bounds[leader]]) if mimic.multiplier else mimic.offset
            )
        return bounds, tuple(contrary)

    def slowed(self, speeds: Array) -> Array:
        """Largest speeds (n,), rad/s or m/s, that keep mimic joints within theirs."""
        bounds = speeds.copy()
        for f, leader, m in zip(self.columns, self.leaders, np.abs(self.multipliers), strict=True):
            if m:
                bounds[leader] = min(bounds[leader], speeds[f] / m)
        return bounds
