"""The shapes of a scenario's obstacles, by kind."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import Field

from nmm.collisions.shapes import Box, Capsule, Cylinder, Mesh, Plane, Shape, Sphere
from nmm.errors import InputError
from nmm.scenario.keys import Part, one_of
from nmm.scenario.numbers import Positive
from nmm.scenario.robot import Absolute, FileName, Three
from nmm.scenario.yaml_text import Place


class ShapePart(Part):
    """A shape, in the axes of its obstacle."""

    makes: ClassVar[type[Shape]]

    def build(self, absolute: Absolute, place: Place) -> Shape:
        """The shape; `place` is where this part stands in the scenario. Errors know their key."""
        given = self.explicit(absolute, place)
        kind = given.pop("kind")
        with self.own_keys(), without(f"{kind}: "):
            return self.makes(**given)

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        """Every key as plain data, files with absolute paths."""
        return self.model_dump()


@contextmanager
def without(head: str) -> Iterator[None]:
    """An error of the block whose text begins with what its place says already is told without."""
    try:
        yield
    except InputError as error:
        raise InputError(str(error).removeprefix(head)) from None


class BoxPart(ShapePart):
    """A box about its origin."""

    makes = Box
    kind: Literal["box"]
    size: Three = Field(description="along x, y, z, m")


class SpherePart(ShapePart):
    """A sphere about its origin."""

    makes = Sphere
    kind: Literal["sphere"]
    radius: Positive = Field(description="m")


class CylinderPart(ShapePart):
    """A cylinder along z, its middle in the origin."""

    makes = Cylinder
    kind: Literal["cylinder"]
    radius: Positive = Field(description="m")
    length: Positive = Field(description="m")


class CapsulePart(ShapePart):
    """All points within a radius of a segment along z, its middle in the origin."""

    makes = Capsule
    kind: Literal["capsule"]
    radius: Positive = Field(description="m")
    length: Positive = Field(description="of the segment, m")


class PlanePart(ShapePart):
    """A half-space: everything below the plane through its origin."""

    makes = Plane
    kind: Literal["plane"]
    normal: Three = Field(default_factory=lambda: [0.0, 0.0, 1.0], description="points out of it")


class MeshPart(ShapePart):
    """The convex hull of a mesh file."""

    makes = Mesh
    kind: Literal["mesh"]
    file: FileName = Field(description="STL, DAE, OBJ or PLY, relative to the scenario")
    scale: Three = Field(default_factory=lambda: [1.0, 1.0, 1.0], description="of its axes")

    def build(self, absolute: Absolute, place: Place) -> Shape:
        with self.own_keys():
            try:
                return super().build(absolute, place)
            except InputError as error:  # Mesh names the file, not the key
                raise InputError(f"file: {error}") from None

    def explicit(self, absolute: Absolute, place: Place) -> dict[str, Any]:
        return {**self.model_dump(), "file": str(absolute(self.file, (*place, "file")))}


SHAPE_PARTS: dict[str, type[ShapePart]] = {
    "box": BoxPart,
    "sphere": SpherePart,
    "cylinder": CylinderPart,
    "capsule": CapsulePart,
    "plane": PlanePart,
    "mesh": MeshPart,
}
if TYPE_CHECKING:
    AnyShape = ShapePart
else:
    AnyShape = one_of(SHAPE_PARTS)
