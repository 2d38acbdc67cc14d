"""What a URDF has to say for an arm's joints and fixed frames to be elsewhere, and to be read otherwise."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.joint_table import twist
from nmm.model.robots.numbers import numbers_for
from nmm.model.robots.origins import arm_joints
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.text_edits import Node, XmlText

#: Numbers that are a joint's or a frame's place and reading: by a file 0, 1 and 0.
OF_ARM = ("offset", "ratio", "origin")
#: Numbers in a file are written to 1e-9 m and rad; those that differ by less stay.
WRITTEN = 5e-10
#: Places are the same that differ by no more, m and rad.
CLOSE = 1e-6
#: Ratios that a URDF can say: as it is, and the axis turned around.
SAID = (1.0, -1.0)
#: Below that roll and yaw cannot be told apart, in cosines of the pitch.
STEEP = 1e-12


def arm_numbers(robot: Robot, values: Collection[str]) -> dict[str, str]:
    """Those of the numbers that are of the arm or of frames: by name, the joint or frame."""
    known, joints = numbers_for(robot, values), {*arm_joints(robot)}
    return {
        name: known[name].of
        for name in values
        if known[name].kind == "origin" or (known[name].kind in OF_ARM and known[name].of in joints)
    }


def unsaid(robot: Robot, values: Mapping[str, float], of: Mapping[str, str], nodes: Nodes) -> dict[str, str]:
    """Those of the arm's numbers (`arm_numbers`) that the file cannot say, each with the reason."""
    left, joints = {}, arm_joints(robot)
    for name, whose in of.items():
        if name.startswith("ratio.") and values[name] not in SAID:
            left[name] = "URDF has no word for a joint's ratio but 1 and -1"
        elif nodes.placing(whose, whose in joints) is None:
            left[name] = f"no joint of its file places {whose}"
    return left


class Nodes:
    """The joints of a URDF's text, by the names that they and their links have in the robot."""

    def __init__(self, robot: Robot, text: XmlText) -> None:
        self._names = robot.renamed
        self.joints = {self.named(node.attributes.get("name", "")): node for node in text.root.every("joint")}
        self._by_child = {self.link(node, "child"): node for node in self.joints.values()}

    def named(self, name: str) -> str:
        return self._names.get(name, name)

    def link(self, joint: Node, tag: str) -> str:
        """The link that a joint connects, by "parent" or "child"."""
        node = joint.first(tag)
        return "" if node is None else self.named(node.attributes.get("link", ""))

    def placing(self, name: str, joint: bool) -> Node | None:
        """The joint that places a frame, a link before a joint of its name, or this joint itself."""
        node = self.joints.get(name)
        return node if joint else self._by_child.get(name, node)

    def followers(self, joint: str) -> Iterator[Node]:
        """The mimic elements of joints that follow a joint."""
        for node in self.joints.values():
            mimic = node.first("mimic")
            if mimic is not None and self.named(mimic.attributes.get("joint", "")) == joint:
                yield mimic


def write_arm(text: XmlText, nodes: Nodes, before: Robot, after: Robot) -> None:
    """Edits by which joints are where another robot of the file has them, and read what it reads: an offset
    turns (or shifts) the origin, a ratio of -1 the axis. Limits are of readings, and stay."""
    for name, node in nodes.joints.items():
        old, new = (_zero(robot, nodes, name) for robot in (before, after))
        if old is None or new is None:
            continue
        by = new[0] * old[0].inverse()
        if not by.isIdentity(WRITTEN):
            _write_origin(text, node, by)
        ratio, offset = after.corrections.get(name, (1.0, 0.0))
        if new[1] @ old[1] < 0.0:
            _turn_axis(text, node)
        if offset or ratio != 1.0:
            for mimic in nodes.followers(name):
                _write_mimic(text, mimic, ratio, offset)


def misplaced(nodes: Nodes, wanted: Robot, reached: Robot) -> str:
    """The first joint that a robot of a corrected file has elsewhere than another robot, where it reads 0, or
    that turns otherwise; "" where all are right."""
    for name in nodes.joints:
        one, other = (_zero(robot, nodes, name) for robot in (wanted, reached))
        if one is not None and other is not None:
            apart = np.abs(one[0].homogeneous - other[0].homogeneous).max()
            if max(apart, np.abs(one[1] - other[1]).max()) > CLOSE:
                return name
    return ""


def rpy_near(rotation: Array, near: Array) -> Array:
    """Roll, pitch, yaw, rad (3,), of a rotation (3, 3), the way of writing it that is nearest to others; also
    at a pitch of a quarter turn, where roll and yaw are one."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    yaw = math.atan2(rotation[1, 0], rotation[0, 0]) if level > STEEP else float(near[2])
    ways = []
    for turn in (yaw, yaw + math.pi):
        # Of the yaw that is written follow the others, however uncertain it is.
        rest = pin.utils.rotate("z", -turn) @ rotation
        roll, pitch = math.atan2(-rest[1, 2], rest[1, 1]), math.atan2(-rest[2, 0], rest[0, 0])
        way = np.array([roll, pitch, turn])
        ways.append(way + 2.0 * math.pi * np.round((near - way) / (2.0 * math.pi)))
    return min(ways, key=lambda way: float(np.abs(way - near).sum()))


def number_text(value: float) -> str:
    """To a nanometre, without zeros at its end."""
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _zero(robot: Robot, nodes: Nodes, name: str) -> tuple[pin.SE3, Array] | None:
    """Where an arm's joint that reads 0, or the link behind a fixed one, is in the parent link, and how that
    joint moves for a unit of its reading but for the ratio's size (6,); None of other joints."""
    model, kind = robot.display_model, pin.FrameType.BODY
    links = [nodes.link(nodes.joints[name], end) for end in ("parent", "child")]
    if not all(model.existFrame(link, kind) for link in links):
        return None
    above, below = (model.frames[model.getFrameId(link, kind)] for link in links)
    if above.parentJoint == below.parentJoint:
        return above.placement.inverse() * below.placement, np.zeros(6)
    index = model.getJointId(name)
    if name not in robot.q_names[robot.platform.n_p :] or model.parents[index] != above.parentJoint:
        return None
    moves = pin.Motion(*twist(model.joints[index], pin.neutral(model)))
    ratio, offset = robot.corrections.get(name, (1.0, 0.0))
    at = above.placement.inverse() * model.jointPlacements[index]
    return at * pin.exp6(offset * moves) if offset else at, math.copysign(1.0, ratio) * moves.vector


def _write_origin(text: XmlText, joint: Node, by: pin.SE3) -> None:
    """The joint's origin becomes `by` times what it is."""
    origin = joint.first("origin")
    own = {key: np.zeros(3) for key in ("xyz", "rpy")}
    if origin is not None:
        for key in own:
            own[key] = np.array([float(part) for part in origin.attributes.get(key, "0 0 0").split()])
    new = by * pin.SE3(pin.rpy.rpyToMatrix(*own["rpy"]), own["xyz"])
    wanted = {"xyz": new.translation, "rpy": own["rpy"]}
    if np.abs(by.rotation - np.eye(3)).max() > WRITTEN:
        wanted["rpy"] = rpy_near(new.rotation, own["rpy"])
    parts = {key: _changed(own[key], wanted[key]) for key in own}
    if origin is None:
        texts = {key: " ".join(part.get(i, "0") for i in range(3)) for key, part in parts.items() if part}
        text.insert(joint, "<origin " + " ".join(f'{key}="{part}"' for key, part in texts.items()) + "/>")
        return
    for key, part in parts.items():
        if part:
            text.write_parts(origin, key, part)


def _changed(before: Array, after: Array) -> dict[int, str]:
    return {i: number_text(float(after[i])) for i in range(3) if abs(after[i] - before[i]) > WRITTEN}


def _turn_axis(text: XmlText, joint: Node) -> None:
    axis = joint.first("axis")
    if axis is None or "xyz" not in axis.attributes:
        if axis is None:
            text.insert(joint, '<axis xyz="-1 0 0"/>')
        else:
            text.write(axis, "xyz", "-1 0 0")
        return
    parts = axis.attributes["xyz"].split()
    turned = {i: _negated(part) for i, part in enumerate(parts) if float(part)}
    text.write_parts(axis, "xyz", turned)


def _negated(number: str) -> str:
    return number[1:] if number.startswith("-") else "-" + number.removeprefix("+")


def _write_mimic(text: XmlText, mimic: Node, ratio: float, offset: float) -> None:
    """What follows follows the joint's place, not what it reads."""
    factor = float(mimic.attributes.get("multiplier", "1"))
    ahead = float(mimic.attributes.get("offset", "0"))
    if ratio != 1.0 and factor:
        text.write(mimic, "multiplier", _negated(mimic.attributes.get("multiplier", "1")))
    if offset and factor:
        text.write(mimic, "offset", number_text(ahead + factor * offset))
