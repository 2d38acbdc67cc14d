"""What is drawn beside a robot that moves: bodies that stand or move too, and what comes nearest to what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from nmm.arrays import Array, Integers


@dataclass(frozen=True, eq=False)
class Body:
    """A shape in the world.

    Attributes
    ----------
    name : what it is called
    geometry : its shape, Coal's
    places (N, 4, 4) : where it is at the motion's N samples, m, world axes; (1, 4, 4) where it stands

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> ball = nmm.playback.Body("ball", nmm.Sphere(0.2).geometry(), np.eye(4)[None])
    >>> motion = nmm.playback.Motion(robot, [0.0], robot.rest[None], np.zeros((1, robot.n_u)), bodies=(ball,))
    >>> motion.bodies[0].name
    'ball'
    """

    name: str
    geometry: Any
    places: Array


@dataclass(frozen=True, eq=False)
class Nearest:
    """The two points nearest to each other at each of a motion's N samples.

    Attributes
    ----------
    points (N, 6) : of the one shape, then of the other, m, world axes; not a number where nothing is near
    distance (N,) : m
    pairs (N,) : which of `names` they belong to, -1 for none
    names : "one and other" of each pair
    asked : the distance to keep, m

    Examples
    --------
    >>> points = np.array([[1.0, 0.0, 0.5, 1.0, 0.3, 0.5]])
    >>> near = nmm.playback.Nearest(points, np.array([0.3]), np.array([0]), ("link2 and ball",), asked=0.1)
    >>> near.names[near.pairs[0]], float(np.linalg.norm(points[0, :3] - points[0, 3:]))
    ('link2 and ball', 0.3)
    """

    points: Array
    distance: Array
    pairs: Integers
    names: tuple[str, ...]
    asked: float
