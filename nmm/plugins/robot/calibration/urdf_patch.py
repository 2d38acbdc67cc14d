"""What a URDF has to say for a robot to have other numbers: radii of wheels' shapes, places of joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.platforms import SkidSteer
from nmm.model.platforms.wheel_layout import MAIN_BODY
from nmm.model.robots.loading.measured_joints import ROUNDED
from nmm.model.robots.numbers import with_numbers
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.plugins.robot.calibration.arm_patch import Nodes, arm_numbers, number_text, unsaid, write_arm
from nmm.plugins.robot.calibration.text_edits import Node, XmlText

#: Lengths that differ by less are one, m: of a radius and the height of the wheel's centre, and of moves.
SAME = 1e-9
#: Shapes that have a radius.
ROUND = ("cylinder", "sphere", "capsule")


class UrdfPatch:
    """Edits of a URDF that give its robot other numbers.

    robot : as the file has it; values : all its numbers that the file is to have; content : the file's
    left : by number, why the file cannot have it
    written : the arm's numbers that joints' origins and axes have then
    changed : the robot that the file is to be of, but for what is left
    """

    def __init__(self, robot: Robot, values: Mapping[str, float], content: bytes) -> None:
        self.text = XmlText(content)
        self.nodes, of = Nodes(robot, self.text), arm_numbers(robot, values)
        self.left = unsaid(robot, values, of, self.nodes)
        values = {name: value for name, value in values.items() if name not in self.left}
        self.written = tuple(name for name in of if name in values)
        self.robot, self.changed = robot, with_numbers(robot, values)
        self._file_names = {new: old for old, new in robot.renamed.items()}
        self._joints = {node.attributes.get("name", ""): node for node in self.text.root.every("joint")}
        self._links = {node.attributes.get("name", ""): node for node in self.text.root.every("link")}
        self._moves: dict[str, Array] = {}
        self._data = robot.display_model.createData()
        pin.framesForwardKinematics(robot.display_model, self._data, pin.neutral(robot.display_model))
        self._resize()
        self._move_wheels()
        self._move_joints()
        for name, by in self._moves.items():
            self._write_move(self._joints[name], by)
        if self.written:
            write_arm(self.text, self.nodes, robot, self.changed)

    def _node(self, joint: str) -> Node | None:
        return self._joints.get(self._file_names.get(joint, joint))

    def _add(self, joint: str, carrier: int, by: Array) -> None:
        """A joint goes by (3,), m, along the axes of the joint that carries it: in its parent link's."""
        node = self._node(joint)
        if node is None or np.linalg.norm(by) <= SAME:  # one that the platform adds is none of the file's
            return
        parent = node.first("parent")
        name = "" if parent is None else parent.attributes.get("link", "")
        model, turned = self.robot.display_model, np.eye(3)
        link = self.robot.renamed.get(name, name)
        if model.existFrame(link, pin.FrameType.BODY):
            frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
            if frame.parentJoint == carrier:
                turned = np.array(frame.placement.rotation)
        key = node.attributes["name"]
        self._moves[key] = self._moves.get(key, np.zeros(3)) + turned.T @ by

    def _resize(self) -> None:
        """Wheels' shapes get their radii, and centres that stood as high as these the new heights."""
        model = self.robot.display_model
        for wheel, new in zip(self.robot.wheels, self.changed.wheels, strict=True):
            if abs(new.radius - wheel.radius) <= SAME:
                continue
            joint = model.getJointId(wheel.joint)
            root = self._data.oMi[model.getJointId(MAIN_BODY)]
            place = root.actInv(self._data.oMi[joint])
            as_high = abs(float(place.translation[2]) - wheel.radius) <= SAME
            found = list(self._round_shapes(wheel))
            for shape in found:
                self.text.write(shape, "radius", number_text(new.radius))
            if not found and not (as_high and self._shapeless(wheel)):
                why = "no cylinder, sphere or capsule of the wheel has this radius: a mesh has it"
                self.left[f"radius.{wheel.joint}"] = why
            elif as_high:
                carrier = int(model.parents[joint])
                up = root.rotation @ np.array([0.0, 0.0, new.radius - wheel.radius])
                self._add(wheel.joint, carrier, self._data.oMi[carrier].rotation.T @ up)

    def _round_shapes(self, wheel: Wheel) -> Iterator[Node]:
        """The shapes that have the wheel's radius, as files round it."""
        for link in self._fixed_links(wheel):
            for shape in link.below():
                text = shape.attributes.get("radius", "") if shape.tag in ROUND else ""
                if _is_number(text) and abs(float(text) - wheel.radius) <= ROUNDED * wheel.radius:
                    yield shape

    def _shapeless(self, wheel: Wheel) -> bool:
        return not any(shape.tag == "geometry" for link in self._fixed_links(wheel) for shape in link.below())

    def _fixed_links(self, wheel: Wheel) -> Iterator[Node]:
        """The wheel's link, and those that are fixed to it."""
        node = self._node(wheel.joint)
        names, met = [_end(node, "child")] if node is not None else [], set[str]()
        while names:
            name = names.pop()
            if name in met or name not in self._links:
                continue
            met.add(name)
            yield self._links[name]
            fixed = (one for one in self._joints.values() if one.attributes.get("type") == "fixed")
            names += [_end(one, "child") for one in fixed if _end(one, "parent") == name]

    def _move_wheels(self) -> None:
        """Wheels go where they touch the ground; where skid-steering's would, is no place of theirs."""
        model, skids = self.robot.display_model, isinstance(self.robot.platform, SkidSteer)
        for wheel, new in zip(self.robot.wheels, self.changed.wheels, strict=True):
            if not wheel.swivel and not (skids and wheel.carrier == MAIN_BODY):
                self._add(wheel.joint, model.getJointId(wheel.carrier), new.rolls_at - wheel.rolls_at)

    def _move_joints(self) -> None:
        """Joints that steer, hitch or swivel."""
        before, after = self.robot.display_model, self.changed.display_model
        arm = {*self.robot.q_names[self.robot.platform.n_p :]}
        for joint in range(1, before.njoints):
            if before.names[joint] in arm:
                continue
            by = after.jointPlacements[joint].translation - before.jointPlacements[joint].translation
            self._add(str(before.names[joint]), int(before.parents[joint]), np.array(by))

    def _write_move(self, joint: Node, by: Array) -> None:
        origin = joint.first("origin")
        moved = {i: float(by[i]) for i in range(3) if abs(by[i]) > SAME}
        if origin is None:
            xyz = " ".join(number_text(moved.get(i, 0.0)) for i in range(3))
            self.text.insert(joint, f'<origin xyz="{xyz}"/>')
            return
        before = [float(text) for text in origin.attributes.get("xyz", "0 0 0").split()]
        self.text.write_parts(origin, "xyz", {i: number_text(before[i] + way) for i, way in moved.items()})


def _end(joint: Node, tag: str) -> str:
    node = joint.first(tag)
    return "" if node is None else node.attributes.get("link", "")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
