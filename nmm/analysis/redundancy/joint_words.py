"""What a joint does to its arm, in words found by geometry: it opens, lifts, turns, extends."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.robots.configuration import Configuration
from nmm.robots.loading.tips import tips
from nmm.robots.robot import Robot

#: An axis is upright when its vertical component is larger than this.
UPRIGHT = 0.95
#: A distance or a height that changes by less than this part of its lever stays.
STAYS = 0.01
#: A point that is nearer to an axis than this part of the farthest one is on it, as a wrist's joints are.
NEAR = 1.0 / 3.0
#: Levers below this are none, m.
NO_LEVER = 1e-6
#: Axes whose sine is below this are parallel.
PARALLEL = 1e-3
#: A length along an axis below this part of the arm's longest is no link.
SHORT = 0.1


class Words(NamedTuple):
    """What a positive and a negative rate do; where one word has to do for both, the rate keeps its sign."""

    positive: str
    negative: str

    def phrase(self, rate: float, unit: str) -> str:
        """ "q2 opens at 1 rad/s"."""
        if self.positive == self.negative:
            return f"{self.positive} at {rate:+.2g} {unit}"
        return f"{self.positive if rate > 0.0 else self.negative} at {abs(rate):.2g} {unit}"


def joint_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each joint of the arm at q, by name.

    An elbow has its axis across the link before it and the link after it. It opens when the distance from
    where the one begins to where the other ends grows with its angle, and closes when it falls; stretched and
    folded, where the distance only falls or only grows, it bends and unfolds. A roll, whose axis runs along
    the link before or after it, turns. A shoulder, before which the arm only turns about one line, lifts or
    lowers the end of its link. Whatever is upright and no elbow turns left or right, as seen from above. A
    prismatic joint extends when it moves away from where the link before it begins. What does none of these
    turns or slides.
    """
    skeleton = _Skeleton(robot, q)
    return {name: skeleton.words(name) for name in robot.q_names[robot.platform.n_p :]}


class _Skeleton:
    """Origins and axes of the joints at q, in the world."""

    def __init__(self, robot: Robot, q: Array) -> None:
        self.robot = robot
        self.configuration = Configuration(robot, q)
        self.model = robot.model
        self.arm = {robot.model.getJointId(name) for name in robot.q_names[robot.platform.n_p :]}
        self._ends = {
            int(self.model.frames[robot.frame_id(tip)].parentJoint): self.configuration.placement(
                tip
            ).translation
            for tip in tips(robot)
        }
        self._frames: dict[int, int] = {}
        for i, frame in enumerate(self.model.frames):
            if frame.name != "universe" and robot.frame_id(frame.name) == i:
                self._frames.setdefault(int(frame.parentJoint), i)

    def words(self, name: str) -> Words:
        """A joint's."""
        joint = self.model.getJointId(name)
        if not self._turns(joint):
            return self._prismatic(name, joint)
        axis, origin = self._axis(joint, angular=True), self._origin(joint)
        start, end = self._link_before(joint, axis, origin), self._link_after(joint, axis, origin)
        roll = self._is_roll(joint, axis, origin)
        if start is not None and end is not None and not roll and not self._is_shoulder(joint, axis):
            return _elbow(name, axis, start - origin, end - origin)
        if abs(axis[2]) > UPRIGHT:
            return _signed(name, "turns left", "turns right", axis[2])
        if end is not None and not roll:
            rise = float(np.cross(axis, end - origin)[2])
            if abs(rise) > STAYS * float(np.linalg.norm(np.cross(axis, end - origin))):
                return _signed(name, "lifts", "lowers", rise)
        return Words(f"{name} turns", f"{name} turns")

    def _prismatic(self, name: str, joint: int) -> Words:
        away = self._origin(joint) - self._origin(int(self.model.parents[joint]))
        growth = float(self._axis(joint, angular=False) @ away)
        if abs(growth) <= STAYS * float(np.linalg.norm(away)):
            return Words(f"{name} slides", f"{name} slides")
        return _signed(name, "extends", "retracts", growth)

    def _is_shoulder(self, joint: int, axis: Array) -> bool:
        """Whether the joints before one only turn the arm about a line that is not parallel to its axis."""
        axes = [self._axis(above, angular=True) for above in self._above(joint) if self._turns(above)]
        column = len(axes) == 1 or all(abs(one[2]) > UPRIGHT for one in axes)
        return column and all(float(np.linalg.norm(np.cross(one, axis))) > PARALLEL for one in axes)

    def _is_roll(self, joint: int, axis: Array, origin: Array) -> bool:
        """Whether the arm runs on along a joint's axis, rather than across it.

        Compared are the parts of the axis and of the common normals of Denavit and Hartenberg, which depend
        neither on the posture nor on where the file puts the joint's origin on its axis.
        """
        above, (below, end) = self._above(joint), self._below(joint)
        if not any(self._turns(one) for one in above):
            return False
        feet, gaps = [], []
        for neighbours in (above, below):
            turning = next((one for one in neighbours if self._turns(one)), None)
            point = end if turning is None else self._origin(turning)
            # Behind a prismatic joint an axis does not stay where it is: there its origin counts.
            rigid = turning is not None and turning == neighbours[0]
            other = self._axis(neighbours[0], angular=True) if rigid else axis
            foot, gap = _common_normal(axis, point - origin, other)
            feet.append(foot)
            gaps.append(gap)
        return abs(feet[1] - feet[0]) > max(*gaps, SHORT * self._longest)

    @cached_property
    def _longest(self) -> float:
        """The longest way from a joint of the arm to the next, m."""
        pairs = [(joint, above[0]) for joint in self.arm if (above := self._above(joint))]
        return max((float(np.linalg.norm(self._origin(a) - self._origin(b))) for a, b in pairs), default=0.0)

    def _above(self, joint: int) -> list[int]:
        """The arm's joints before one, the nearest first."""
        found = []
        above = int(self.model.parents[joint])
        while above in self.arm:
            found.append(above)
            above = int(self.model.parents[above])
        return found

    def _below(self, joint: int) -> tuple[list[int], Array]:
        """The joints after one, the nearest first, and the arm's end; of several branches the first."""
        for last, end in self._ends.items():
            chain = [last, *self._above(last)]
            if joint in chain:
                return chain[: chain.index(joint)][::-1], end
        return [], self._origin(joint)

    def _link_before(self, joint: int, axis: Array, origin: Array) -> Array | None:
        """Where the link before a joint begins: at the nearest turning joint of the arm off its axis."""
        points = [self._origin(above) for above in self._above(joint) if self._turns(above)]
        return _off_axis(points, axis, origin)

    def _link_after(self, joint: int, axis: Array, origin: Array) -> Array | None:
        """Where the link after a joint ends: at the next joint off its axis, or at the arm's end."""
        below, end = self._below(joint)
        return _off_axis([*(self._origin(later) for later in below), end], axis, origin)

    def _turns(self, joint: int) -> bool:
        return self.robot.q_units[self.model.joints[joint].idx_q] == "rad"

    def _origin(self, joint: int) -> Array:
        if joint not in self._frames:  # the universe
            return np.zeros(3)
        frame = self.model.frames[self._frames[joint]]
        placement = self.configuration.placement(frame.name) * frame.placement.inverse()
        return np.array(placement.translation)

    def _axis(self, joint: int, *, angular: bool) -> Array:
        frame = self.model.frames[self._frames[joint]].name
        column = self.configuration.jacobian(frame)[:, self.model.joints[joint].idx_q]
        return column[3:] if angular else column[:3]


def _signed(name: str, positive: str, negative: str, sign: float) -> Words:
    up, down = f"{name} {positive}", f"{name} {negative}"
    return Words(up, down) if sign > 0.0 else Words(down, up)


def _common_normal(axis: Array, to: Array, other: Array) -> tuple[float, float]:
    """Where the common normal of two axes meets the first, counted along it, and how long it is, m.

    `to` leads from the first axis to the other; of parallel ones the normal at its end is taken.
    """
    normal = np.cross(axis, other)
    size = float(np.linalg.norm(normal))
    if size < PARALLEL:
        return float(axis @ to), float(np.linalg.norm(np.cross(axis, to)))
    return float(np.cross(to, other) @ normal) / size**2, abs(float(to @ normal)) / size


def _off_axis(points: Sequence[Array], axis: Array, origin: Array) -> Array | None:
    """The first point with a lever about the axis that is not small beside the longest."""
    levers = [float(np.linalg.norm(np.cross(axis, point - origin))) for point in points]
    longest = max(levers, default=0.0)
    if longest <= NO_LEVER:
        return None
    return next(point for point, lever in zip(points, levers, strict=True) if lever >= NEAR * longest)


def _elbow(name: str, axis: Array, start: Array, end: Array) -> Words:
    """Words for a joint from the ends of the links that meet in it, seen from its origin."""
    # Half the derivative of |end - start|² by the angle, and its second derivative there.
    growth = float((end - start) @ np.cross(axis, end))
    levers = float(np.linalg.norm(np.cross(axis, end)) * np.linalg.norm(np.cross(axis, start)))
    if abs(growth) > STAYS * levers:
        return _signed(name, "opens", "closes", growth)
    bends = float(np.cross(axis, start) @ np.cross(axis, end)) < 0.0
    word = f"{name} bends" if bends else f"{name} unfolds"
    return Words(word, word)
