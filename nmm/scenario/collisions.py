"""The collisions of a scenario: which distances a run keeps, and the obstacles, which stand or move."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, create_model

from nmm.arrays import Array, scalar
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.shapes import Box, Capsule, ConvexMesh, Cylinder, HalfSpace, Shape, Sphere
from nmm.control.collisions import Collisions
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.program import Program
from nmm.functions.references.orientation import rotation_vector
from nmm.robots.loading.packages import package_file
from nmm.robots.robot import Robot
from nmm.scenario.constructors import FunctionPart
from nmm.scenario.functions import REFERENCE_PARTS
from nmm.scenario.keys import OneOf, Part, at
from nmm.scenario.numbers import Positive, Whole, number
from nmm.scenario.robot import PACKAGE, Absolute, FileName, Three
from nmm.scenario.yaml_text import Place


class ShapePart(Part):
    """A shape, in the axes of its obstacle."""

    makes: ClassVar[type[Shape]]

    def build(self, absolute: Absolute, place: Place) -> Shape:
        given = self.explicit(absolute, place)
        kind = given.pop("kind")
        with self.own_keys(), without(f"{kind}: "):
            return self.makes(**given)

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        return self.model_dump()


class MeshPart(ShapePart):
    """The convex hull of a mesh file."""

    makes = ConvexMesh
    kind: Literal["mesh"]
    file: FileName = Field(description="STL, DAE, OBJ or PLY, relative to the scenario")
    scale: Three = Field([1.0, 1.0, 1.0], description="of its axes")

    def build(self, absolute: Absolute, place: Place) -> Shape:
        with self.own_keys():
            try:
                return super().build(absolute, place)
            except InputError as error:  # Mesh names the file, not the key
                raise error.at("file") from None

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        return {**self.model_dump(), "file": str(absolute(self.file, (*place, "file")))}


def _shape(kind: str, makes: type[Shape], about: str, **keys: Any) -> type[ShapePart]:
    """The part of a shape: its docstring, and type and description (and default) of each key."""
    fields: dict[str, Any] = {"kind": (Literal[kind], ...)}
    for key, (spelled, text, *default) in keys.items():
        fields[key] = spelled, Field(*default, description=text)
    name = f"{makes.__name__}Part"
    part = create_model(name, __base__=ShapePart, __module__=__name__, __doc__=about, **fields)
    part.makes = makes
    return part


_ROUND = {"radius": (Positive, "m"), "length": (Positive, "m")}
SHAPE_PARTS: dict[str, type[ShapePart]] = {
    kind: _shape(kind, makes, about, **keys)
    for kind, makes, about, keys in (
        ("box", Box, "A box about its origin.", {"size": (Three, "along x, y, z, m")}),
        ("sphere", Sphere, "A sphere about its origin.", {"radius": (Positive, "m")}),
        ("cylinder", Cylinder, "A cylinder along z, its middle in the origin.", _ROUND),
        (
            "capsule",
            Capsule,
            "All points within a radius of a segment along z, its middle in the origin.",
            _ROUND | {"length": (Positive, "of the segment, m")},
        ),
        (
            "plane",
            HalfSpace,
            "A half-space: everything below the plane through its origin.",
            {"normal": (Three, "points out of it", [0.0, 0.0, 1.0])},
        ),
    )
} | {"mesh": MeshPart}


@contextmanager
def without(head: str) -> Iterator[None]:
    """Errors of the block without `head` at the front of their `where`, which their place says already."""
    try:
        yield
    except InputError as error:
        raise error.placed(f"{error.where}: ".removeprefix(head).removesuffix(": ")) from None


#: References that are points of time alone.
PATH_PARTS: dict[str, type[FunctionPart]] = {
    kind: REFERENCE_PARTS[kind] for kind in ("line", "circle", "polynomial", "spline")
}


class Along:
    """A reference of three rows in m, of time alone, as the motion of an obstacle turned by a rotation vector
    (3,), rad: its value at t, s, and its exact velocity. Any robot will do."""

    def __init__(self, reference: Function, robot: Robot, turned: Array) -> None:
        units = [row.unit for row in reference.rows(robot)]
        if units != ["m"] * 3:
            raise InputError(expected="3 rows in m (x, y, z)", got=units)
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
        return self._program.evaluate(t, self._q)[0].value_t


class ObstaclePart(Part):
    """A shape that the robot keeps away from; it stands at `xyz`, or moves along a path."""

    name: str = Field("", description="for messages; the shape's kind when not given")
    shape: Annotated[ShapePart, OneOf(SHAPE_PARTS)] = Field(
        description="kind box, sphere, cylinder, capsule, plane or mesh, with its keys"
    )
    xyz: Three | None = Field(None, description="its origin in the world, m; 0, 0, 0 when not given")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about fixed axes, rad")
    motion: Annotated[FunctionPart, OneOf(PATH_PARTS)] | None = Field(
        None,
        description="where its origin is at t, in place of xyz: a reference of kind line, circle, polynomial "
        "or spline, of three rows; m",
    )

    def build(self, robot: Robot, absolute: Absolute, place: Place) -> Obstacle:
        with at("shape"):
            shape = self.shape.build(absolute, (*place, "shape"))
        turned = rotation_vector(rpy=self.rpy)
        if self.motion is None:
            xyz = [0.0, 0.0, 0.0] if self.xyz is None else self.xyz
            return Obstacle(shape, [*xyz, *turned], name=self.name)
        with at("motion"):
            if self.xyz is not None:
                raise InputError("both are given", expected="xyz or motion")
            along = Along(self.motion.build(robot), robot, turned)
        return Obstacle(shape, motion=along, name=self.name, velocity=along.velocity)

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        return {**self.model_dump(), "shape": self.shape.explicit(absolute, (*place, "shape"))}


USUAL = Collisions()


class CollisionsPart(Part):
    """Distances that are never less than a number; `collisions: true` is this with its defaults."""

    renamed: ClassVar[dict[str, str]] = {"self": "self_collisions"}

    distance: Annotated[float, BeforeValidator(lambda given: scalar(number(given), "", least=0.0))] = Field(
        USUAL.distance, description="to keep, m, from 0"
    )
    self_collisions: bool = Field(
        USUAL.self_collisions, description="whether the robot keeps off itself, too"
    )
    obstacles: list[ObstaclePart] = Field(default_factory=list, description="what it keeps off")
    ignore: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list,
        description="pairs of names (links, shapes, obstacles) that are not kept apart, as [[hand, table]]",
    )
    srdf: bool | FileName | None = Field(
        None,
        description="a file of MoveIt's whose disabled pairs are left out, too; relative to the scenario, or "
        "package://PACKAGE/PATH; true for the robot's own",
    )
    shapes: Literal["hulls", "capsules"] = Field("hulls", description="what stands for the robot's meshes")
    band: Positive | None = Field(
        None, description="pairs nearer than this have rows, m; distance and 0.2 m more when not given"
    )
    gain: Positive = Field(
        USUAL.gain, description="a distance falls no faster than this times what is left of it, 1/s"
    )
    recovery: Positive = Field(
        USUAL.recovery, description="speed of the way back where a distance is too small, m/s"
    )
    braking: Positive | None = Field(
        None,
        description="deceleration of a distance to count on, m/s²; when not given, a quarter of what the "
        "inputs' accelerations give",
    )
    rows: Whole = Field(USUAL.rows, description="most distances that are kept at a time, the nearest ones")

    @contextmanager
    def own_keys(self) -> Iterator[None]:
        with super().own_keys(), without("collisions: "):
            yield

    def build_obstacles(self, robot: Robot, absolute: Absolute, place: Place) -> list[Obstacle]:
        obstacles = []
        for i, part in enumerate(self.obstacles):
            with at("obstacles", i):
                obstacles.append(part.build(robot, absolute, (*place, "obstacles", i)))
        return obstacles

    def build(self, robot: Robot, absolute: Absolute, place: Place) -> Collisions:
        obstacles = self.build_obstacles(robot, absolute, place)
        given = {key: getattr(self, key) for key in type(self).model_fields}
        with at("srdf"):
            given["srdf"] = self._srdf(absolute, place)
        given["ignore"] = [(first, second) for first, second in self.ignore]
        with self.own_keys():
            collisions = Collisions(**{**given, "obstacles": obstacles})
            collisions.on(robot)
        return collisions

    def _srdf(self, absolute: Absolute, place: Place) -> str | bool | None:
        if not isinstance(self.srdf, str):
            return self.srdf
        if self.srdf.startswith(PACKAGE):
            return str(package_file(self.srdf))
        return str(absolute(self.srdf, (*place, "srdf")))

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        obstacles = [
            part.explicit(absolute, (*place, "obstacles", i)) for i, part in enumerate(self.obstacles)
        ]
        return {**self.model_dump(), "obstacles": obstacles, "srdf": self._srdf(absolute, place)}
