"""Motions in words: "the platform drives back at 0.31 m/s while q2 opens at 1 rad/s".

What a joint does to its arm is found by geometry: it opens, lifts, turns, extends.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.text_format import listed
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.reach import tips
from nmm.model.robots.robot import Robot

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
#: A rate below this part of the largest is not worth a word.
WORTH = 1e-3


class Words(NamedTuple):
    """What a positive and a negative rate do; where one word has to do for both, the rate keeps its sign."""

    positive: str
    negative: str

    def phrase(self, rate: float, unit: str) -> str:
        """ "q2 opens at 1 rad/s"."""
        if self.positive == self.negative:
            return f"{self.positive} at {rate:+.2g} {unit}"
        return f"{self.positive if rate > 0.0 else self.negative} at {abs(rate):.2g} {unit}"


#: Who it is in the platform's phrases.
WHO = "the platform "
DRIVES = Words(f"{WHO}drives forward", f"{WHO}drives back")
SLIDES = Words(f"{WHO}slides left", f"{WHO}slides right")
TURNS = Words(f"{WHO}turns left", f"{WHO}turns right")
#: The platforms' inputs by name.
INPUTS: Mapping[str, Words] = {
    "v": DRIVES,
    "omega": TURNS,
    "vx": DRIVES,
    "vy": SLIDES,
    "drive": DRIVES,
    "strafe": SLIDES,
    "turn": TURNS,
    "omega_left": Words("the left wheel rolls forward", "the left wheel rolls back"),
    "omega_right": Words("the right wheel rolls forward", "the right wheel rolls back"),
    "steering_rate": Words(f"{WHO}steers left", f"{WHO}steers right"),
}
#: Those of platforms that are described by their wheels, by the end of the name; {} is what stands before it.
ENDINGS: Mapping[str, Words] = {
    "_speed": Words("{} rolls forward", "{} rolls back"),
    "_spin": Words("{} turns forward", "{} turns back"),
    "_rate": Words("{} steers left", "{} steers right"),
}
#: The platforms' coordinates in their own axes, x ahead and y to the left.
COORDINATES: Mapping[str, Words] = {
    "x": Words(f"{WHO}slides forward", f"{WHO}slides back"),
    "y": SLIDES,
    "theta": TURNS,
}


def input_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each input at q, by name: the platform's by their meaning, the joints' by their geometry."""
    return {name: _of_input(name) for name in robot.platform.inputs} | joint_words(robot, q)


def coordinate_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each coordinate at q, by name, x and y being those along the platform's own axes."""
    own = {name: Words(f"{name} turns", f"{name} turns") for name in robot.platform.coordinates}
    return own | {name: COORDINATES[name] for name in own if name in COORDINATES} | joint_words(robot, q)


def _of_input(name: str) -> Words:
    if name in INPUTS:
        return INPUTS[name]
    for ending, words in ENDINGS.items():
        stem = name.removesuffix(ending)
        if stem not in ("", name):
            return Words(words.positive.format(stem), words.negative.format(stem))
    return Words(f"{name} runs", f"{name} runs")


def motion_text(
    rates: Array, names: Sequence[str], units: Sequence[str], words: Mapping[str, Words], of_platform: int
) -> str:
    """A motion in a clause: what the platform (the first `of_platform` rates) does while the joints move."""
    moved = [k for k in range(len(rates)) if abs(rates[k]) > WORTH * np.abs(rates).max(initial=0.0)]
    phrases = {k: words[names[k]].phrase(float(rates[k]), units[k]) for k in moved}
    platform = [phrase for k, phrase in phrases.items() if k < of_platform]
    # Of two in a row, the second goes without who it is.
    follows = [k > 0 and platform[k - 1].startswith(WHO) for k in range(len(platform))]
    platform = [p.removeprefix(WHO) if after else p for p, after in zip(platform, follows, strict=True)]
    arm = [phrase for k, phrase in phrases.items() if k >= of_platform]
    if not phrases:
        return "nothing moves"
    if not platform:
        platform, arm = arm[:1], arm[1:]
    if not arm:
        return listed(platform) + (" alone" if len(phrases) == 1 else "")
    return f"{listed(platform)} while {listed(arm)}"


def joint_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each joint of the arm at q, by name.

    An elbow, whose axis crosses both its links, opens when the distance between their far ends grows with its
    angle, else it closes; stretched and folded, it bends and unfolds. A roll, with its axis along a link,
    turns. A shoulder, before which the arm turns about one line only, lifts or lowers its link's end. Other
    upright joints turn left or right, seen from above. Prismatic joints extend away from the previous link's
    start. Others turn or slide.
    """
    skeleton = _Skeleton(robot, q)
    return {name: skeleton.words(name) for name in robot.q_names[robot.platform.n_p :]}


class _Skeleton:
    """Origins (3,) of the joints at q, in the world, and axes (3,) of the arm's, by the joints' numbers."""

    def __init__(self, robot: Robot, q: Array) -> None:
        self.model = model = robot.model
        configuration = Configuration(robot, q)
        self.arm = {model.getJointId(name) for name in robot.q_names[robot.platform.n_p :]}
        self.turning = {joint for joint in self.arm if robot.q_units[model.joints[joint].idx_q] == "rad"}
        self.origins = defaultdict[int, Array](lambda: np.zeros(3))
        self.axes: dict[int, Array] = {}
        for i, frame in enumerate(model.frames):
            joint = int(frame.parentJoint)
            if frame.name == "universe" or joint in self.origins or robot.frame_id(frame.name) != i:
                continue
            placement = configuration.placement(frame.name) * frame.placement.inverse()
            self.origins[joint] = np.array(placement.translation)
            if joint in self.arm:
                column = configuration.jacobian(frame.name)[:, model.joints[joint].idx_q]
                self.axes[joint] = column[3:] if joint in self.turning else column[:3]
        self._ends: dict[int, Array] = {}
        for tip in tips(robot):
            joint = int(model.frames[robot.frame_id(tip)].parentJoint)
            self._ends[joint] = configuration.placement(tip).translation

    def words(self, name: str) -> Words:
        joint = self.model.getJointId(name)
        axis, origin = self.axes[joint], self.origins[joint]
        if joint not in self.turning:
            away = origin - self.origins[int(self.model.parents[joint])]
            growth = float(axis @ away)
            stays = abs(growth) <= STAYS * float(np.linalg.norm(away))
            slides = Words(f"{name} slides", f"{name} slides")
            return slides if stays else _signed(name, "extends", "retracts", growth)
        # Where the link before begins, at a turning joint; and where the one after ends, or the arm.
        above, (below, tip) = self._above(joint), self._below(joint)
        start = _off_axis([self.origins[i] for i in above if i in self.turning], axis, origin)
        end = _off_axis([*(self.origins[i] for i in below), tip], axis, origin)
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

    def _is_shoulder(self, joint: int, axis: Array) -> bool:
        """Whether the joints before one only turn the arm about a line that is not parallel to its axis."""
        axes = [self.axes[above] for above in self._above(joint) if above in self.turning]
        column = len(axes) == 1 or all(abs(other[2]) > UPRIGHT for other in axes)
        return column and all(float(np.linalg.norm(np.cross(other, axis))) > PARALLEL for other in axes)

    def _is_roll(self, joint: int, axis: Array, origin: Array) -> bool:
        """Whether the arm continues along a joint's axis rather than across it.

        Judged by Denavit-Hartenberg lengths, which depend on neither posture nor joint origins.
        """
        above, (below, end) = self._above(joint), self._below(joint)
        if not any(i in self.turning for i in above):
            return False
        feet, gaps = [], []
        for neighbours in (above, below):
            turning = next((i for i in neighbours if i in self.turning), None)
            point = end if turning is None else self.origins[turning]
            # Behind a prismatic joint an axis does not stay where it is: there its origin counts.
            rigid = turning is not None and turning == neighbours[0]
            other = self.axes[neighbours[0]] if rigid else axis
            foot, gap = _common_normal(axis, point - origin, other)
            feet.append(foot)
            gaps.append(gap)
        return abs(feet[1] - feet[0]) > max(*gaps, SHORT * self._longest)

    @cached_property
    def _longest(self) -> float:
        """The longest way from a joint of the arm to the next, m."""
        pairs = [(joint, above[0]) for joint in self.arm if (above := self._above(joint))]
        return max((float(np.linalg.norm(self.origins[a] - self.origins[b])) for a, b in pairs), default=0.0)

    def _above(self, joint: int) -> list[int]:
        """The arm's joints before a joint, the nearest first."""
        joints = []
        above = int(self.model.parents[joint])
        while above in self.arm:
            joints.append(above)
            above = int(self.model.parents[above])
        return joints

    def _below(self, joint: int) -> tuple[list[int], Array]:
        """The joints after one, the nearest first, and the arm's end; of several branches the first."""
        for last, end in self._ends.items():
            chain = [last, *self._above(last)]
            if joint in chain:
                return chain[: chain.index(joint)][::-1], end
        return [], self.origins[joint]


def _signed(name: str, positive: str, negative: str, sign: float) -> Words:
    up, down = f"{name} {positive}", f"{name} {negative}"
    return Words(up, down) if sign > 0.0 else Words(down, up)


def _common_normal(axis: Array, to: Array, other: Array) -> tuple[float, float]:
    """Where the common normal meets the first axis, counted along it, and its length, m.

    `to` leads from the first axis to the other; of parallel axes, the normal at its end is taken.
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
