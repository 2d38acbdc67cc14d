"""A robot's links in one another: the tree of TF and of its description."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.making import base_joint
from nmm.views.playback.placements import Placements, position_and_quaternion

#: Pinocchio's kinds of frames that are links: a file's, and those of a model made by hand.
_LINKS = ("BODY", "OP_FRAME")
#: Parent, child, position (3,) and quaternion (4,) x y z w.
Transform = tuple[str, str, Array, Array]


@dataclass(frozen=True, eq=False)
class Link:
    """A link.

    name : as in the file
    on : the joint of `display_model` that carries it, Pinocchio's index
    place : (4, 4) its place in that joint's frame
    parent : the link that it hangs on, "" for the root
    joint : the name of the joint between both
    moves : whether that joint moves; the link's frame is the joint's then
    """

    name: str
    on: int
    place: Array
    parent: str = ""
    joint: str = ""
    moves: bool = False


class Links:
    """Every link of a robot, by name, from the root `base` on, the platform's reference point; and those that
    the platform drives on, where they are in the world (`ground`)."""

    def __init__(self, robot: Robot, base: str) -> None:
        self._placements, self._model = Placements(robot), robot.display_model
        self.root = base_joint(robot)
        frames, first = list(self._model.frames), {self.root: base}
        names: dict[int, str] = {}
        self.ground: list[tuple[str, pin.SE3]] = []
        for index, frame in enumerate(frames):
            if frame.type.name not in _LINKS or frame.name in ("universe", *names.values()):
                continue
            if frame.parentJoint >= self.root:
                names[index] = frame.name
                if frame.placement.isIdentity(1e-9):
                    first.setdefault(frame.parentJoint, frame.name)
            elif frame.parentJoint == 0:
                self.ground.append((frame.name, frame.placement))
        for joint in range(self.root, self._model.njoints):
            if joint not in first:
                first[joint] = _free(str(self._model.names[joint]), {*names.values(), *first.values()})
        self._names, self._first = names, first
        self.links = {base: Link(base, self.root, np.eye(4))}
        for joint in range(self.root + 1, self._model.njoints):
            own = str(self._model.names[joint])
            above = frames[self._model.getFrameId(own, pin.FrameType.JOINT)].parentFrame
            parent = self.holder(above, self._model.parents[joint])
            self.links[first[joint]] = Link(first[joint], joint, np.eye(4), parent, own, moves=True)
        joints = {link.joint for link in self.links.values()}
        for index, name in names.items():
            if name not in self.links:
                frame, above = frames[index], frames[frames[index].parentFrame]
                wanted = above.name if above.type.name == "FIXED_JOINT" else f"{name}_fixed"
                by = _free(wanted, joints)
                joints.add(by)
                parent, at = self.holder(frame.parentFrame, frame.parentJoint), frame.placement.homogeneous
                self.links[name] = Link(name, frame.parentJoint, at, parent, by)

    def holder(self, index: int, joint: int) -> str:
        """The nearest link on a joint from a frame upwards; the first where none is, as of a shape that names
        no frame."""
        frames = self._model.frames
        while 0 < index < len(frames) and frames[index].parentJoint == joint:
            if index in self._names:
                return self._names[index]
            index = frames[index].parentFrame
        return self._first[joint]

    def placement(self, link: Link, at: Array | None = None) -> Array:
        """(4, 4) where a link is in its parent, with its joint `at` (4, 4) in its parent joint, by default at
        zero."""
        if not link.moves:
            at = link.place
        elif at is None:
            at = self._model.jointPlacements[link.on].homogeneous
        return np.asarray(np.linalg.inv(self.links[link.parent].place) @ at)

    @property
    def fixed(self) -> list[Transform]:
        """Transforms of links that do not move in their parents."""
        still = (link for link in self.links.values() if link.parent and not link.moves)
        return [(link.parent, link.name, *position_and_quaternion(self.placement(link))) for link in still]

    def moving(self, q: Array, wheels: Array) -> list[Transform]:
        """Transforms of links on joints, at q (n,) and the wheels' angles (D,)."""
        relative = self._placements.relative(q, wheels)
        placed = (
            (link, self.placement(link, relative[link.on - 1])) for link in self.links.values() if link.moves
        )
        return [(link.parent, link.name, *position_and_quaternion(at)) for link, at in placed]


def _free(name: str, taken: set[str]) -> str:
    """The name, or with a suffix where it is taken."""
    while name in taken:
        name += "_"
    return name
