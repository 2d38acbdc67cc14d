"""What a scenario draws beside robot and task."""

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_known
from nmm.control.functions.references.orientation import rotation_vector
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import Body, Carried, Surroundings
from nmm.scenario.collisions import SHAPE_PARTS, ShapePart
from nmm.scenario.keys import KeyedPart, OneOf, at
from nmm.scenario.numbers import Number, Positive, numbers
from nmm.scenario.robot import Three

SIDES = ("iso", "top", "front", "wall")


def _camera(value: object) -> object:
    """A side's name, or six numbers."""
    if isinstance(value, str):
        expect_known("side", value, SIDES)
        return value
    values = numbers(value)
    if len(values) != 6:
        raise InputError(expected=f"{', '.join(SIDES)}, or six numbers", got=value)
    return values


class DrawnPart(KeyedPart):
    """A shape that is drawn."""

    name: str = Field("", description="the shape's kind when not given")
    shape: Annotated[ShapePart, OneOf(SHAPE_PARTS)] = Field(
        description="kind box, sphere, cylinder, capsule, plane or mesh, with its keys"
    )
    xyz: Three = Field([0.0, 0.0, 0.0], description="its origin, m")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about fixed axes, rad")

    def drawn(self) -> tuple[str, Any, Array]:
        """Its name, its shape, Coal's, and where that is, (4, 4) m."""
        with at("shape"):
            shape = self.shape.build()
        obstacle = Obstacle(shape, [*self.xyz, *rotation_vector(rpy=self.rpy)], name=self.name)
        return obstacle.name, shape.geometry(), obstacle.placement(0.0)


class CarriedPart(DrawnPart):
    """A shape that a frame of the robot carries; xyz and rpy are in the frame's axes."""

    frame: str = Field(description="the frame that carries it")
    mass: Positive | None = Field(
        None, description="kg, in its origin: a load for torques; only drawn when not given"
    )


class SceneryPart(DrawnPart):
    """A shape that stands in the world and is no obstacle; xyz and rpy are in the world's axes."""


class ScenePart(KeyedPart):
    """What is drawn beside robot and task, and how the page opens. Controllers know nothing of it."""

    carried: list[CarriedPart] = Field(default_factory=list, description="shapes that frames carry")
    scenery: list[SceneryPart] = Field(default_factory=list, description="shapes in the world")
    camera: Annotated[str | list[Number], BeforeValidator(_camera)] = Field(
        "iso",
        description="where the page looks from: iso, top, front or wall, or six numbers, m, the eye "
        "and what it looks at (camera= in the page's address)",
    )
    opens: Annotated[Number, Field(ge=0.0)] | None = Field(
        None, description="the time that the page shows first, s"
    )

    def build(self, robot: Robot) -> Surroundings:
        carried, scenery = [], []
        for i, load in enumerate(self.carried):
            with at("carried", i):
                with at("frame"):
                    robot.frame_id(load.frame)
                name, geometry, placement = load.drawn()
                carried.append(Carried(name, geometry, load.frame, placement, load.mass or 0.0))
        for i, thing in enumerate(self.scenery):
            with at("scenery", i):
                name, geometry, placement = thing.drawn()
                scenery.append(Body(name, geometry, placement[np.newaxis]))
        camera = self.camera if isinstance(self.camera, str) else tuple(self.camera)
        return Surroundings(tuple(carried), tuple(scenery), camera, self.opens)
