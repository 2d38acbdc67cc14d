"""Which links of a robot can touch each other, and how often they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.collisions.pairs import sampled
from nmm.collisions.robot_shapes import link_names, query_shapes
from nmm.robots.robot import Robot

#: How many configurations are drawn.
CONFIGURATIONS = 1000


@dataclass(frozen=True)
class Touching:
    """What touches in random configurations.

    Attributes
    ----------
    shapes : collision shapes of the robot
    configurations : how many were drawn
    shares : the share of them in which a pair of links touches, by the links' names, the greatest first
    """

    shapes: int
    configurations: int
    shares: dict[tuple[str, str], float]

    @property
    def never(self) -> list[tuple[str, str]]:
        """The pairs that touched in no configuration."""
        return [pair for pair, share in self.shares.items() if share == 0.0]

    @property
    def always(self) -> list[tuple[str, str]]:
        """The pairs that touched in every configuration: neighbours, by how they are drawn."""
        return [pair for pair, share in self.shares.items() if share == 1.0]

    @property
    def sometimes(self) -> dict[tuple[str, str], float]:
        """The other pairs, with their share."""
        return {pair: share for pair, share in self.shares.items() if 0.0 < share < 1.0}


def touching_links(robot: Robot, count: int = CONFIGURATIONS) -> Touching:
    """How often the links of the model's collision pairs touch, meshes as convex hulls.

    Parameters
    ----------
    count : how many random configurations within limits are looked at

    Raises
    ------
    RobotError : meshes that cannot be read
    """
    shapes = query_shapes(robot)
    links = link_names(robot, shapes)
    pairs = [(pair.first, pair.second) for pair in robot.collision_model.collisionPairs]
    if not pairs:
        return Touching(len(links), count, {})
    for pair in pairs:
        shapes.addCollisionPair(pin.CollisionPair(*pair))
    found, data = pin.GeometryData(shapes), robot.model.createData()
    named = [(links[i], links[j]) for i, j in pairs]
    distinct = list(dict.fromkeys(named))
    column = np.array([distinct.index(pair) for pair in named])
    touched = np.zeros(len(distinct))
    for q in sampled(robot, count):
        pin.computeCollisions(robot.model, data, shapes, found, q, False)
        hit = [result.isCollision() for result in found.collisionResults]
        touched[np.unique(column[hit])] += 1.0
    order = np.argsort(-touched, kind="stable")
    return Touching(len(links), count, {distinct[k]: float(touched[k]) / count for k in order})
