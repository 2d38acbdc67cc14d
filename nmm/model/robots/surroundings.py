"""What is in the picture beside a robot and its task: what it carries, what stands there, how it is seen."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nmm.base.arrays import Array


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
class Carried:
    """A shape that a frame of the robot carries.

    Attributes
    ----------
    name : what it is called
    geometry : its shape, Coal's
    frame : the frame that carries it
    place (4, 4) : where it is in the frame's axes, m
    mass : kg, in its origin; 0 where it is only drawn

    Examples
    --------
    >>> tray = nmm.playback.Carried("tray", nmm.Box([0.3, 0.4, 0.02]).geometry(), "ee", mass=0.8)
    >>> nmm.playback.Surroundings(carried=(tray,)).payload
    {'ee': (0.8, [0.0, 0.0, 0.0])}
    """

    name: str
    geometry: Any
    frame: str
    place: Array = field(default_factory=lambda: np.eye(4))
    mass: float = 0.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is drawn beside robot and task, none of which the controller knows, and how a page opens.

    Attributes
    ----------
    carried : shapes that frames of the robot carry
    scenery : shapes that stand in the world, no obstacles
    camera : the side to look from ("iso", "top", "front", "wall"); or (6,), the eye and what it looks at, m,
        world axes
    opens : the time that is shown first, s; the first sample's when not given

    Examples
    --------
    >>> table = nmm.playback.Body("table", nmm.Box([1.0, 1.0, 0.7]).geometry(), np.eye(4)[None])
    >>> nmm.playback.Surroundings(scenery=(table,), camera="front", opens=2.0).payload
    {}
    """

    carried: tuple[Carried, ...] = ()
    scenery: tuple[Body, ...] = ()
    camera: str | tuple[float, ...] = "iso"
    opens: float | None = None

    @property
    def payload(self) -> dict[str, tuple[float, list[float]]]:
        """Masses by frame, kg, and where they are in its axes, m, as `nmm.Dynamics` takes them; what a frame
        carries is taken together in its centre of mass."""
        loads: dict[str, tuple[float, list[float]]] = {}
        for body in self.carried:
            if body.mass > 0.0:
                before, place = loads.get(body.frame, (0.0, [0.0, 0.0, 0.0]))
                mass = before + body.mass
                middle = (before * np.array(place) + body.mass * body.place[:3, 3]) / mass
                loads[body.frame] = mass, middle.tolist()
        return loads


#: Nothing beside the robot.
NO_SURROUNDINGS = Surroundings()
