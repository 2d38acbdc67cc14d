"""What a robot was made from and what was done to it: for `nmm info` and `mount`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from nmm.base.errors import RobotError
from nmm.base.findings import Finding
from nmm.model.robots.loading.locking import at_zero
from nmm.model.robots.robot import Robot

#: Where the kind of platform comes from (`Provenance.platform`), in words; otherwise it was given.
PLATFORM_SOURCES = {
    "file": "declared in the file",
    "wheels": "by its wheels",
    "base": "by its base of joints",
    "default": "by default",
}


@dataclass(frozen=True)
class Provenance:
    """What loading found and did. Joints are named as in the robot, with their prefix.

    Attributes
    ----------
    packages : the folder of each package that the files name, or None where it was not found
    searched : the folders in which packages were looked for
    meshes : the file of each mesh, or None where it was not found and its shape left out
    locked : joints that were fixed, and their values, rad or m
    mimicked : followers that were fixed with the joint that they follow: its name, and their value
    reduced : wheels and swivels that are no coordinates
    prefixed : the prefix of each mounted arm that has one, by the arm's name
    platform : where the kind of platform comes from: "given", "file", "wheels", "base" (of
        joints) or "default"
    contradictions : where the platform is not what the files' wheels and joints are
    base : joints that the platform's x, y, theta stand for
    accelerations : how fast joints' speeds may change by their file, m/s^2, rad/s^2
    renamed : what joints and links are called here, by their names in the file, where these differ
    """

    packages: Mapping[str, Path | None] = field(default_factory=dict)
    searched: tuple[Path, ...] = ()
    meshes: Mapping[str, Path | None] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    mimicked: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    reduced: tuple[str, ...] = ()
    prefixed: Mapping[str, str] = field(default_factory=dict)
    platform: str = "given"
    contradictions: tuple[Finding, ...] = ()
    base: tuple[str, ...] = ()
    accelerations: Mapping[str, float] = field(default_factory=dict)
    renamed: Mapping[str, str] = field(default_factory=dict)

    @property
    def held(self) -> Mapping[str, float]:
        """All joints that were fixed, and their values, rad or m."""
        return {**self.locked, **{joint: value for joint, (_, value) in self.mimicked.items()}}

    def with_arm(self, arm: Provenance, key: str, prefix: str) -> Provenance:
        """This platform's, with that of an arm mounted under the name `key`."""
        locked = {prefix + name: value for name, value in arm.locked.items()}
        accelerations = {prefix + name: value for name, value in arm.accelerations.items()}
        mimicked = {prefix + name: (prefix + of, value) for name, (of, value) in arm.mimicked.items()}
        return replace(
            self,
            packages={**arm.packages, **self.packages},
            searched=tuple(dict.fromkeys((*self.searched, *arm.searched))),
            meshes={**self.meshes, **arm.meshes},
            locked={**self.locked, **locked},
            mimicked={**self.mimicked, **mimicked},
            accelerations={**self.accelerations, **accelerations},
            prefixed={**self.prefixed, **({key: prefix} if prefix else {})},
        )


@dataclass(frozen=True, eq=False)
class Parts:
    """What a `Robot` remembers of its making. `collision_model` is on `display_model`, where wheels still
    turn; `notes` say what was done to the files before wheels were taken out of q."""

    collision_model: pin.GeometryModel
    notes: tuple[Finding, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)


def provenance_of(robot: Robot) -> Provenance:
    """What is known of the robot's making; nothing when `load` did not make it."""
    return robot.parts.provenance if isinstance(robot.parts, Parts) else Provenance()


def reference_in_root(robot: Robot) -> pin.SE3:
    """Pose of the platform's reference point in the root link (`load`'s `axle`)."""
    for note in robot.notes:
        if note.code == "reference_moved":
            return pin.SE3(pin.utils.rotate("z", note.values["yaw"]), np.array(note.values["at"]))
    return pin.SE3.Identity()


def accelerations_of(robot: Robot) -> dict[str, float]:
    """By input, how fast it may change by the robot's files, m/s^2 or rad/s^2, what follows it included."""
    inputs = {
        robot.q_names[i]: name
        for name, i in zip(robot.u_names, robot.rate_coordinates, strict=True)
        if i >= 0
    }
    leaders = {mimic.joint: (mimic.leader, abs(mimic.multiplier)) for mimic in robot.mimic_joints}
    limits: dict[str, float] = {}
    for joint, limit in provenance_of(robot).accelerations.items():
        leader, factor = leaders.get(joint, (joint, 1.0))
        if leader in inputs and factor > 0.0:
            name = inputs[leader]
            limits[name] = min(limits.get(name, np.inf), limit / factor)
    return limits


def acceleration_notes(robot: Robot) -> list[Finding]:
    """What the files say of accelerations, which limits heed where they are asked to."""
    limits = accelerations_of(robot)
    return [Finding("accelerations_of_file", {"limits": limits})] if limits else []


def loaded_parts(robot: Robot) -> Parts:
    """The parts of a loaded robot; `RobotError` for one made otherwise, with wheels: shapes unknown."""
    if isinstance(robot.parts, Parts):
        return robot.parts
    if robot.model.nq == robot.display_model.nq:
        return Parts(robot.shapes.collision_model, robot.notes)
    what = "was not made by nmm.load, so that its wheels' shapes are not known"
    raise RobotError(what, where=robot.name)


def with_wheels_fixed(robot: Robot) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """`display_model` and the shapes on it, visual and collision, with wheels and swivels fixed at zero."""
    rolling = dict.fromkeys(name for wheel in robot.wheels for name in wheel.joints)
    shapes = robot.shapes.visual_model, loaded_parts(robot).collision_model
    return at_zero(robot.display_model, shapes, rolling)
