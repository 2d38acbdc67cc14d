"""The collisions of a scenario: which distances a run keeps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from nmm.collisions.obstacle import Obstacle
from nmm.control.collisions import Collisions
from nmm.robots.loading.packages import package_file
from nmm.robots.robot import Robot
from nmm.scenario.keys import Part, at
from nmm.scenario.numbers import Positive, Whole, number
from nmm.scenario.obstacles import ObstaclePart
from nmm.scenario.robot import PACKAGE, Absolute, FileName
from nmm.scenario.shapes import without
from nmm.scenario.yaml_text import Place

USUAL = Collisions()


def _from_zero(value: object) -> float:
    distance = number(value)
    if distance < 0.0:
        raise ValueError(f"expected a number from 0, got {distance:g}")
    return distance


class CollisionsPart(Part):
    """Distances that are never less than a number; `collisions: true` is this with its defaults."""

    distance: Annotated[float, BeforeValidator(_from_zero)] = Field(
        USUAL.distance, description="to keep, m, from 0"
    )
    self: bool = Field(USUAL.self, description="whether the robot keeps off itself, too")
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
    def own_keys(this) -> Iterator[None]:  # self is a key
        with super().own_keys(), without("collisions: "):
            yield

    def build_obstacles(this, robot: Robot, absolute: Absolute, place: Place) -> list[Obstacle]:
        """The obstacles; errors know their key."""
        obstacles = []
        for i, part in enumerate(this.obstacles):
            with at("obstacles", i):
                obstacles.append(part.build(robot, absolute, (*place, "obstacles", i)))
        return obstacles

    def build(this, robot: Robot, absolute: Absolute, place: Place) -> Collisions:
        """The distances, with the robot's word on them: errors know their key.

        `place` is where this part stands in the scenario.
        """
        obstacles = this.build_obstacles(robot, absolute, place)
        given = {key: getattr(this, key) for key in type(this).model_fields}
        with at("srdf"):
            given["srdf"] = this._srdf(absolute, place)
        given["ignore"] = [(first, second) for first, second in this.ignore]
        with this.own_keys():
            collisions = Collisions(**{**given, "obstacles": obstacles})
            collisions.on(robot)
        return collisions

    def _srdf(this, absolute: Absolute, place: Place) -> str | bool | None:
        if not isinstance(this.srdf, str):
            return this.srdf
        if this.srdf.startswith(PACKAGE):
            return str(package_file(this.srdf))
        return str(absolute(this.srdf, (*place, "srdf")))

    def explicit(this, absolute: Absolute, place: Place) -> dict[str, Any]:
        """Every key as plain data, files with absolute paths."""
        obstacles = [
            part.explicit(absolute, (*place, "obstacles", i)) for i, part in enumerate(this.obstacles)
        ]
        return {**this.model_dump(), "obstacles": obstacles, "srdf": this._srdf(absolute, place)}
