"""The obstacles of a scenario: shapes that stand in the world or move along a path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from nmm.arrays import Array
from nmm.collisions.obstacle import Obstacle
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.program import Program
from nmm.functions.references.orientation import rotation_vector
from nmm.robots.robot import Robot
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import REFERENCE_PARTS
from nmm.scenario.keys import Part, at, one_of
from nmm.scenario.robot import Absolute, Three
from nmm.scenario.shapes import AnyShape
from nmm.scenario.yaml_text import Place

#: References that are points of time alone.
PATH_PARTS: dict[str, type[FunctionPart]] = {
    kind: REFERENCE_PARTS[kind] for kind in ("line", "circle", "polynomial", "spline")
}
if TYPE_CHECKING:
    Path = FunctionPart
else:
    Path = one_of(PATH_PARTS)


class Along:
    """A reference as an obstacle's motion: its value at t, s, and its exact velocity.

    Parameters
    ----------
    reference : three rows, m, functions of time alone
    robot : whatever it is, they do not depend on it
    turned (3,) : the obstacle's rotation vector, rad

    Raises
    ------
    InputError : other rows than three in metres
    """

    def __init__(self, reference: Function, robot: Robot, turned: Array) -> None:
        units = [row.unit for row in reference.rows(robot)]
        if units != ["m"] * 3:
            raise InputError(f"expected 3 rows in m (x, y, z), got {len(units)} in {', '.join({*units})}")
        self._given = reference, robot, turned
        self._program = Program(robot, (reference,))
        self._program.lay_out()
        self._q, self._turned = np.zeros(robot.n), turned

    def __reduce__(self) -> tuple[object, ...]:
        """Copies lay out programs of their own."""
        return type(self), self._given

    def __call__(self, t: float) -> Array:
        """Origin and rotation vector at t, s: (6,) m and rad."""
        return np.concatenate([self._program.evaluate(t, self._q)[0].value, self._turned])

    def velocity(self, t: float) -> Array:
        """Of the origin at t, s: (3,) m/s."""
        return self._program.evaluate(t, self._q)[0].value_t


class ObstaclePart(Part):
    """A shape that the robot keeps away from; it stands at `xyz`, or moves along a path."""

    name: str = Field("", description="for messages; the shape's kind when not given")
    shape: AnyShape = Field(description="kind box, sphere, cylinder, capsule, plane or mesh, with its keys")
    xyz: Three | None = Field(None, description="its origin in the world, m; 0, 0, 0 when not given")
    rpy: Three = Field(
        default_factory=lambda: [0.0, 0.0, 0.0], description="roll, pitch, yaw about fixed axes, rad"
    )
    motion: Path | None = Field(
        None,
        description="where its origin is at t, in place of xyz: a reference of kind line, circle, polynomial "
        "or spline, of three rows; m",
    )

    def build(self, robot: Robot, absolute: Absolute, place: Place) -> Obstacle:
        """The obstacle; `place` is where this part stands in the scenario. Errors know their key."""
        with at("shape"):
            shape = self.shape.build(absolute, (*place, "shape"))
        turned = rotation_vector(rpy=self.rpy)
        if self.motion is None:
            xyz = [0.0, 0.0, 0.0] if self.xyz is None else self.xyz
            return Obstacle(shape, [*xyz, *turned], name=self.name)
        with at("motion"):
            if self.xyz is not None:
                raise InputError("expected xyz or motion, got both")
            along = Along(self.motion.build(robot), robot, turned)
        return Obstacle(shape, motion=along, name=self.name, velocity=along.velocity)

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        """Every key as plain data, files with absolute paths."""
        return {**self.model_dump(), "shape": self.shape.explicit(absolute, (*place, "shape"))}
