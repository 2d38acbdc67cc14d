"""Motions in words: "drive back at 0.31 m/s while q2 opens at 1 rad/s"."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.configuration import Configuration
from nmm.loading.tips import tips
from nmm.robot import Robot


class Words(NamedTuple):
    """What a positive and a negative rate do; where one word has to do for both, the rate keeps its sign."""

    positive: str
    negative: str

    def phrase(self, rate: float, unit: str) -> str:
        """ "q2 opens at 1 rad/s"."""
        if self.positive == self.negative:
            return f"{self.positive} at {rate:+.2g} {unit}"
        return f"{self.positive if rate > 0.0 else self.negative} at {abs(rate):.2g} {unit}"


#: The platforms' inputs by name.
INPUTS: Mapping[str, Words] = {
    "v": Words("drive forward", "drive back"),
    "omega": Words("turn left", "turn right"),
    "vx": Words("drive forward", "drive back"),
    "vy": Words("slide left", "slide right"),
    "drive": Words("drive forward", "drive back"),
    "strafe": Words("slide left", "slide right"),
    "turn": Words("turn left", "turn right"),
    "omega_left": Words("left wheel forward", "left wheel back"),
    "omega_right": Words("right wheel forward", "right wheel back"),
    "steering_rate": Words("steer left", "steer right"),
}
#: Those of platforms that are described by their wheels, by the end of the name; {} is what stands before it.
ENDINGS: Mapping[str, Words] = {
    "_speed": Words("roll {} forward", "roll {} back"),
    "_spin": Words("turn {} forward", "turn {} back"),
    "_rate": Words("steer {} left", "steer {} right"),
}
#: The platforms' coordinates in their own axes, x ahead and y to the left.
COORDINATES: Mapping[str, Words] = {
    "x": Words("slide forward", "slide back"),
    "y": Words("slide left", "slide right"),
    "theta": Words("turn left", "turn right"),
}

#: A rate below this part of the largest is not worth a word.
WORTH = 1e-3
#: An axis is upright when its vertical component is larger than this.
UPRIGHT = 0.95
#: A distance or a height that changes by less than this part of its lever stays.
STAYS = 0.01
#: A point that is nearer to an axis than this part of the farthest one is on it, as a wrist's joints are.
NEAR = 1.0 / 3.0
#: Levers below this are none, m.
NO_LEVER = 1e-6


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
        if name.endswith(ending) and name != ending:
            stem = name.removesuffix(ending)
            return Words(words.positive.format(stem), words.negative.format(stem))
    return Words(name, name)


def motion_text(
    rates: Array, names: Sequence[str], units: Sequence[str], words: Mapping[str, Words], of_platform: int
) -> str:
    """A motion in a sentence: what the platform does, while the joints do the rest, a thousandth left out.

    Parameters
    ----------
    rates (m,), names, units : of the inputs or coordinates, the platform's first
    words : by name
    of_platform : how many are the platform's
    """
    moved = [k for k in range(len(rates)) if abs(rates[k]) > WORTH * np.abs(rates).max(initial=0.0)]
    phrases = {k: words[names[k]].phrase(float(rates[k]), units[k]) for k in moved}
    platform = [phrase for k, phrase in phrases.items() if k < of_platform]
    arm = [phrase for k, phrase in phrases.items() if k >= of_platform]
    if not phrases:
        return "nothing moves"
    if not platform:
        platform, arm = arm[:1], arm[1:]
    if not arm:
        return listed(platform) + (" alone" if len(phrases) == 1 else "")
    return f"{listed(platform)} while {listed(arm)}"


def listed(phrases: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join([", ".join(phrases[:-1]), phrases[-1]] if len(phrases) > 1 else phrases)


def joint_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each joint of the arm at q, by name.

    A joint between two links opens when the distance from where the link before it begins to where the
    link after it ends grows with its angle, and closes when it falls; stretched and folded, where the
    distance only falls or only grows, it bends and unfolds. An upright one that is no such elbow turns left
    or right, as seen from above. Another lifts or lowers the end of its link. A prismatic joint extends when
    it moves away from where the link before it begins. What does none of these turns or slides.
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
        if start is not None and end is not None:
            return _elbow(name, axis, start - origin, end - origin)
        if abs(axis[2]) > UPRIGHT:
            return _signed(name, "turns left", "turns right", axis[2])
        if end is not None:
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

    def _link_before(self, joint: int, axis: Array, origin: Array) -> Array | None:
        """Where the link before a joint begins: at the nearest turning joint of the arm off its axis."""
        points = []
        above = int(self.model.parents[joint])
        while above in self.arm:
            if self._turns(above):
                points.append(self._origin(above))
            above = int(self.model.parents[above])
        return _off_axis(points, axis, origin)

    def _link_after(self, joint: int, axis: Array, origin: Array) -> Array | None:
        """Where the link after a joint ends: at the next joint off its axis, or at the arm's end."""
        for last, end in self._ends.items():
            chain = [last]
            while chain[-1] > joint:  # a joint's number is above its parent's
                chain.append(int(self.model.parents[chain[-1]]))
            if chain[-1] == joint:
                points = [self._origin(later) for later in chain[-2::-1]]
                return _off_axis([*points, end], axis, origin)
        return None

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
