"""Joints that follow others (URDF's mimic), and the limits that they leave the joints that they follow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError

#: How far a follower may be from its leader, and limits from meeting, rad or m: files have a few digits.
SLACK = 1e-9


@dataclass(frozen=True)
class Follower:
    """A joint that stands at `multiplier` times another's value plus `offset` (rad or m).

    Examples
    --------
    >>> finger = nmm.Follower("right_finger", "left_finger", multiplier=-1.0, offset=0.01)
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

    def renamed(self, prefix: str) -> Follower:
        """The same with a prefix before both names."""
        return Follower(prefix + self.joint, prefix + self.leader, self.multiplier, self.offset)


def settled(
    followers: Iterable[Follower], standing: Mapping[str, float]
) -> tuple[dict[str, tuple[str, float]], tuple[Follower, ...]]:
    """Those that stand still with their leader, which and where (rad or m); and those that move.

    Parameters
    ----------
    followers : each after the one that it follows
    standing : joints that stand still, and their values, rad or m
    """
    values = dict(standing)
    still: dict[str, tuple[str, float]] = {}
    moving = []
    for follower in followers:
        if follower.leader in values:
            values[follower.joint] = follower.value(values[follower.leader])
            still[follower.joint] = follower.leader, values[follower.joint]
        else:
            moving.append(follower)
    return still, tuple(moving)


def first_leaders(followers: Iterable[Follower]) -> tuple[Follower, ...]:
    """The same followers (each after the one that it follows), each by the joint that follows nobody."""
    found: dict[str, Follower] = {}
    for one in followers:
        ahead = found.get(one.leader)
        if ahead is not None:
            one = Follower(
                one.joint, ahead.leader, one.multiplier * ahead.multiplier, one.value(ahead.offset)
            )
        found[one.joint] = one
    return tuple(found.values())


class Following:
    """Who follows whom among n coordinates, in numbers: q[columns] = multipliers q[leaders] + offsets.

    Attributes
    ----------
    followers : each by a coordinate that follows nobody
    columns, leaders (k,) : indices of the followers and of the coordinates that they follow
    multipliers, offsets (k,) : 1 and rad, or m (of a sliding joint that follows a turning one m/rad, ...)
    independent (n - k,) : indices of the coordinates that follow nobody, in order

    Raises
    ------
    InputError : a name that is no coordinate, a joint that follows two, or one that follows itself or a
        follower
    """

    def __init__(self, followers: Sequence[Follower], names: Sequence[str]) -> None:
        joints = [one.joint for one in followers]
        for one in followers:
            absent = [name for name in (one.joint, one.leader) if name not in names]
            if absent or one.leader in joints or joints.count(one.joint) > 1:
                why = (
                    f"{absent[0]} is no coordinate" if absent else "expected one leader, which follows nobody"
                )
                raise InputError(f"followers: {one}: {why}")
        self.followers = tuple(followers)
        self.columns = np.array([names.index(name) for name in joints], dtype=np.int64)
        self.leaders = np.array([names.index(one.leader) for one in followers], dtype=np.int64)
        self.multipliers = np.array([one.multiplier for one in followers], dtype=np.float64)
        self.offsets = np.array([one.offset for one in followers], dtype=np.float64)
        self.independent = np.setdiff1d(np.arange(len(names)), self.columns)

    @property
    def table(self) -> Array:
        """A follower, its leader, its multiplier and its offset in each row, (k, 4), for compiled code."""
        return np.column_stack([self.columns, self.leaders, self.multipliers, self.offsets])

    @property
    def carried(self) -> Array:
        """What a unit of each coordinate that follows nobody moves, (n, n - k): itself and its followers."""
        rows = np.eye(len(self.independent) + len(self.columns))
        rows[self.columns] = self.multipliers[:, np.newaxis] * rows[self.leaders]
        return rows[:, self.independent]

    def placed(self, q: Array) -> Array:
        """A copy of q (..., n) with the followers where their leaders have them."""
        found = np.array(q, dtype=np.float64)
        found[..., self.columns] = self.multipliers * found[..., self.leaders] + self.offsets
        return found

    def narrowed(self, limits: Array) -> tuple[Array, tuple[Follower, ...]]:
        """Limits (n, 2) of coordinates, rad or m, within which each keeps every other within its own.

        A leader's are narrowed to what its followers allow; a follower's are what its leader makes of them.
        Files give followers limits of the wrong sign: those that would leave a leader no room are not heeded,
        and their followers are returned.
        """
        found, contrary = limits.copy(), []
        for one, f, leader in zip(self.followers, self.columns, self.leaders, strict=True):
            own = limits[f] - one.offset
            allowed = np.sort(own / one.multiplier) if one.multiplier else np.array([-np.inf, np.inf])
            room = max(allowed[0], found[leader, 0]), min(allowed[1], found[leader, 1])
            had_room = found[leader, 1] - found[leader, 0] > SLACK
            fits = own[0] <= SLACK and own[1] >= -SLACK if not one.multiplier else room[1] - room[0] > SLACK
            if fits:
                found[leader] = room
            elif had_room or room[1] - room[0] < -SLACK:
                contrary.append(one)
        for one, f, leader in zip(self.followers, self.columns, self.leaders, strict=True):
            found[f] = np.sort([one.value(end) for end in found[leader]]) if one.multiplier else one.offset
        return found, tuple(contrary)

    def slowed(self, speeds: Array) -> Array:
        """Largest speeds (n,) of coordinates, rad/s or m/s, in which followers keep theirs."""
        found = speeds.copy()
        for f, leader, m in zip(self.columns, self.leaders, np.abs(self.multipliers), strict=True):
            if m:
                found[leader] = min(found[leader], speeds[f] / m)
        return found
