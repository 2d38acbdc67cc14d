"""What a robot was made from and what was done to it: what `nmm info` tells, and where `mount` starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pinocchio as pin

from nmm.errors import RobotError
from nmm.robots.robot import Robot
from nmm.robots.slip import slip_warnings

#: Where the kind of platform comes from (`Provenance.platform`), in words; otherwise it was given.
CHOSEN = {
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
    contradictions : where the platform is not what the files' wheels and joints are, a sentence each
    """

    packages: Mapping[str, Path | None] = field(default_factory=dict)
    searched: tuple[Path, ...] = ()
    meshes: Mapping[str, Path | None] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    mimicked: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    reduced: tuple[str, ...] = ()
    prefixed: Mapping[str, str] = field(default_factory=dict)
    platform: str = "given"
    contradictions: tuple[str, ...] = ()

    @property
    def held(self) -> Mapping[str, float]:
        """All joints that were fixed, and their values, rad or m."""
        return {**self.locked, **{joint: value for joint, (_, value) in self.mimicked.items()}}

    def with_arm(self, arm: Provenance, key: str, prefix: str) -> Provenance:
        """This platform's, with that of an arm mounted under the name `key`."""
        return replace(
            self,
            packages={**arm.packages, **self.packages},
            searched=tuple(dict.fromkeys((*self.searched, *arm.searched))),
            meshes={**self.meshes, **arm.meshes},
            locked={**self.locked, **{prefix + name: value for name, value in arm.locked.items()}},
            mimicked={
                **self.mimicked,
                **{prefix + name: (prefix + of, value) for name, (of, value) in arm.mimicked.items()},
            },
            prefixed={**self.prefixed, **({key: prefix} if prefix else {})},
        )


@dataclass(frozen=True, eq=False)
class Parts:
    """What a `Robot` remembers of its making (`Robot.parts`).

    Attributes
    ----------
    collision_model : collision shapes on `display_model`, where the wheels still turn; as in `Robot.shapes`
    notes : what was done to the files before wheels were taken out of q
    provenance : what was found
    """

    collision_model: pin.GeometryModel
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)


def provenance_of(robot: Robot) -> Provenance:
    """What is known of the robot's making; nothing when `load` did not make it."""
    return robot.parts.provenance if isinstance(robot.parts, Parts) else Provenance()


def platform_warnings(robot: Robot) -> list[str]:
    """Where a robot's platform is not what its file holds, and wheels that slide, a sentence each."""
    return [*provenance_of(robot).contradictions, *slip_warnings(robot)]


def parts_of(robot: Robot) -> Parts:
    """The parts of a robot that was loaded.

    Raises
    ------
    RobotError : it was made in another way, and has wheels, so that its shapes cannot be told apart
    """
    parts: Any = robot.parts
    if isinstance(parts, Parts):
        return parts
    if robot.model.nq == robot.display_model.nq:
        return Parts(robot.shapes.collision_model, robot.notes)
    raise RobotError(f"{robot.name}: was not made by nmm.load, so that its wheels' shapes are not known")
