"""The collisions of a scenario: which distances a run keeps, and the obstacles, which stand or move."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, create_model

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.control.functions.function import Function
from nmm.control.functions.program import Program
from nmm.control.functions.references.orientation import rotation_vector
from nmm.control.limits.collisions import Collisions
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.sensed import ElevationMap, OccupancyMap, PointCloud, VoxelMap
from nmm.model.collisions.shapes import Box, Capsule, ConvexMesh, Cylinder, HalfSpace, Shape, Sphere
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.robot import Robot
from nmm.scenario.constructors import FunctionPart, MadePart, keys_of
from nmm.scenario.files import PACKAGE, FileName
from nmm.scenario.functions import REFERENCE_PARTS
from nmm.scenario.keys import KeyedPart, OneOf, at, each
from nmm.scenario.numbers import Number, Positive
from nmm.scenario.robot import Three


class ShapePart(KeyedPart):
    """A shape, in the axes of its obstacle."""

    makes: ClassVar[type[Shape]]

    def build(self) -> Shape:
        with self.own_keys():
            return self.makes(**self.model_dump(exclude={"kind"}))


class MeshPart(ShapePart):
    """The convex hull of a mesh file."""

    makes = ConvexMesh
    kind: Literal["mesh"]
    file: FileName = Field(description="STL, DAE, OBJ or PLY, relative to the scenario")
    scale: Three = Field([1.0, 1.0, 1.0], description="of its axes")

    def build(self) -> Shape:
        with self.own_keys():
            try:
                return super().build()
            except InputError as error:  # Mesh names the file, not the key
                raise error.placed(error.where.replace("mesh", "file", 1)) from None


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


class SensedPart(ShapePart):
    """What was sensed, with what a file says of where it is."""

    loads: ClassVar[Any]

    def obstacle(self, name: str) -> Obstacle:
        """The obstacle where its file has it."""
        with self.own_keys():
            keys = self.model_dump(exclude={"kind", "file"})
            file: str = self.model_dump()["file"]
            try:
                made: Obstacle = self.loads(file, name=name, **keys)
            except InputError as error:  # it names the file, not the key
                raise error.placed(f"file: {error.where}") from None
            return made


class PointCloudPart(SensedPart):
    """The points of a file, and all within a radius of them."""

    loads = PointCloud.load
    kind: Literal["point_cloud"]
    file: FileName = Field(description="PLY, PCD or NPZ, relative to the scenario")
    radius: Annotated[Number, Field(ge=0.0)] = Field(0.01, description="of the balls about the points, m")


def _load_map(file: str, name: str, height: float, unknown_cells: str) -> OccupancyMap:
    return OccupancyMap.load(file, height, unknown_cells, name=name)


class OccupancyMapPart(SensedPart):
    """Walls where a map of Nav2's is occupied or unknown."""

    loads = staticmethod(_load_map)
    kind: Literal["occupancy_map"]
    file: FileName = Field(description="the map's YAML file, relative to the scenario")
    height: Positive = Field(2.0, description="of the walls, m")
    unknown_cells: Literal["occupied", "free"] = Field("occupied", description="what they are")


class VoxelMapPart(SensedPart):
    """The occupied cells of an octree of OctoMap's."""

    loads = VoxelMap.load
    kind: Literal["voxel_map"]
    file: FileName = Field(description="a .bt file, relative to the scenario")


class ElevationMapPart(SensedPart):
    """The ground below the heights of a file."""

    loads = ElevationMap.load
    kind: Literal["elevation_map"]
    file: FileName = Field(description="NPZ of heights, resolution and origin, relative to the scenario")


#: What obstacles may be, beside shapes that are drawn.
OBSTACLE_PARTS: dict[str, type[ShapePart]] = SHAPE_PARTS | {
    "point_cloud": PointCloudPart,
    "occupancy_map": OccupancyMapPart,
    "voxel_map": VoxelMapPart,
    "elevation_map": ElevationMapPart,
}


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


class ObstaclePart(KeyedPart):
    """A shape that the robot keeps away from; it stands at `xyz`, or moves along a path."""

    name: str = Field("", description="for messages; the shape's kind when not given")
    shape: Annotated[ShapePart, OneOf(OBSTACLE_PARTS)] = Field(
        description="kind box, sphere, cylinder, capsule, plane, mesh, point_cloud, occupancy_map, "
        "voxel_map or elevation_map, with its keys"
    )
    xyz: Three | None = Field(None, description="its origin in the world, m; 0, 0, 0 when not given")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about fixed axes, rad")
    motion: Annotated[FunctionPart, OneOf(PATH_PARTS)] | None = Field(
        None,
        description="in place of xyz, its origin over time, m: a reference of three rows (line, "
        "circle, polynomial, spline)",
    )

    def build(self, robot: Robot) -> Obstacle:
        turned = rotation_vector(rpy=self.rpy)
        if isinstance(self.shape, SensedPart):
            if self.motion is not None:
                raise InputError("what was sensed stands", where="motion", expected="xyz")
            with at("shape"):
                seen = self.shape.obstacle(self.name)
            pose = Obstacle(seen.shape, [*(self.xyz or (0.0, 0.0, 0.0)), *turned]).placement(0.0)
            seen.move_to(pose @ seen.placement(0.0))
            return seen
        with at("shape"):
            shape = self.shape.build()
        if self.motion is None:
            xyz = [0.0, 0.0, 0.0] if self.xyz is None else self.xyz
            return Obstacle(shape, [*xyz, *turned], name=self.name)
        with at("motion"):
            if self.xyz is not None:
                raise InputError("both are given", expected="xyz or motion")
            along = Along(self.motion.build(robot), robot, turned)
        return Obstacle(shape, motion=along, name=self.name, velocity=along.velocity)


def _whole_file(value: bool | str | None) -> bool | str | None:
    return str(package_file(value)) if isinstance(value, str) and value.startswith(PACKAGE) else value


_SRDF = (
    Annotated[bool | FileName | None, AfterValidator(_whole_file)],
    "MoveIt's file of disabled pairs, relative to the scenario, or package://PACKAGE/PATH; true for the "
    "robot's own",
)
_PAIRS = list[Annotated[list[str], Field(min_length=2, max_length=2)]]


class CollisionsPart(
    keys_of(Collisions, MadePart, "obstacles", ignore=_PAIRS, srdf=_SRDF, shapes=Literal["hulls", "capsules"])  # type: ignore[misc]  # made
):
    """Distances that are never less than a number; `collisions: true` is this with its defaults."""

    makes = Collisions
    beside = ("obstacles", "ignore")

    obstacles: list[ObstaclePart] = Field(default_factory=list, description="shapes to avoid")

    def build_obstacles(self, robot: Robot) -> list[Obstacle]:
        return each(self.obstacles, lambda part: part.build(robot), "obstacles")

    def build(self, robot: Robot) -> Collisions:
        ignore = [(first, second) for first, second in self.ignore]
        collisions: Collisions = self.made_with(obstacles=self.build_obstacles(robot), ignore=ignore)
        with self.own_keys():
            collisions.on(robot)
        return collisions
