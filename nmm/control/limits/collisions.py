"""Which distances a controller keeps: between the robot's own shapes, and to obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import counted, positive, scalar
from nmm.base.errors import InputError, expect_kind, expect_known
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.pairs import CAPSULES, HULLS
from nmm.model.collisions.scene import Scene, set_up
from nmm.model.robots.robot import Robot

#: Pairs within the distance to keep plus this are considered, m.
BAND = 0.2


def _refuses_self(cls: type[Collisions]) -> type[Collisions]:
    """Make the constructor refuse the former name of `self_collisions`."""
    init = cls.__init__

    @wraps(init)
    def checked(collisions: Collisions, /, *arguments: Any, **named: Any) -> None:
        if "self" in named:
            raise InputError("it is called self_collisions now", where="collisions: self")
        init(collisions, *arguments, **named)

    cls.__init__ = checked  # type: ignore[method-assign, assignment]  # same signature
    return cls


@_refuses_self
@dataclass(frozen=True)
class Collisions:
    """Distances that a controller keeps from falling below a number.

    Parameters
    ----------
    distance : to keep, m, at least 0
    self_collisions : whether the robot also avoids itself
    obstacles : what it avoids, `Obstacle`s
    ignore : pairs of names (links, shapes, obstacles; * for any letters, ? for one) that are ignored
    srdf : a MoveIt file whose disabled pairs are ignored, too, or True for the robot's own (see `nmm.load`);
        disabled pairs that do touch are reported
    shapes : the shapes in place of the robot's meshes, "hulls" or "capsules"
    band : pairs nearer than this have rows, m; `distance` plus 0.2 m when not given
    gain : 1/s, a distance falls at most at this times what is left of it
    recovery : speed at which a distance below the minimum is restored, m/s
    braking : deceleration of a distance to count on, m/s²; None for a quarter of what the inputs'
        accelerations give
    rows : the largest number of distances kept at a time, the smallest ones
    horizon : s ahead, for which obstacles with a motion are looked at: the robot waits or gives way; 0 for
        the time to stop

    Raises
    ------
    InputError : a negative distance, an obstacle of another kind, two of one name, a band not beyond the
        distance, obstacles in the place of `self_collisions`

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.2], speed=0.5)
    >>> keeps_off = nmm.Collisions(0.03, obstacles=[pillar])
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), collisions=keeps_off, dt=0.02)
    >>> run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 4, 0.02, "zoh")
    >>> bool(run.clearance_between.min() >= 0.03)
    True
    """

    distance: float = 0.03
    self_collisions: bool = True
    obstacles: Sequence[Obstacle] = ()
    ignore: Sequence[tuple[str, str]] = ()
    srdf: str | Path | bool | None = None
    shapes: str = HULLS
    band: float | None = None
    gain: float = 4.0
    recovery: float = 0.1
    braking: float | None = None
    rows: int = 40
    horizon: float = 4.0

    def __post_init__(self) -> None:
        if not isinstance(self.self_collisions, bool):  # obstacles given as a positional argument
            raise InputError(
                "obstacles go by their name, Collisions(0.03, obstacles=[...])",
                where="collisions: self_collisions",
                expected="True or False",
                got=self.self_collisions,
            )
        obstacles = (self.obstacles,) if isinstance(self.obstacles, Obstacle) else tuple(self.obstacles)
        for obstacle in obstacles:
            expect_kind(obstacle, Obstacle, "collisions: obstacles", "an Obstacle")
        names = [obstacle.name for obstacle in obstacles]
        for name in names:
            if names.count(name) > 1:
                raise InputError(where="collisions: obstacles", expected="a name each", got=name)
        distance = scalar(self.distance, "collisions: distance", least=0.0)
        band = distance + BAND if self.band is None else positive(self.band, "collisions: band")
        if band <= distance:
            raise InputError(where="collisions: band", expected=f"above distance, {distance:g}", got=band)
        expect_known("shapes", self.shapes, (HULLS, CAPSULES), "collisions")
        checked = {
            "obstacles": obstacles,
            "distance": distance,
            "band": band,
            "ignore": tuple(self.ignore),
            "gain": positive(self.gain, "collisions: gain"),
            "recovery": positive(self.recovery, "collisions: recovery"),
            "braking": None if self.braking is None else positive(self.braking, "collisions: braking"),
            "rows": counted(self.rows, "collisions: rows"),
            "horizon": scalar(self.horizon, "collisions: horizon", least=0.0),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def on(self, robot: Robot) -> Scene:
        """These distances on one robot; `InputError` for names that it lacks."""
        return set_up(
            robot,
            self.obstacles,
            own=self.self_collisions,
            distance=self.distance,
            band=float(self.band or np.inf),
            ignore=self.ignore,
            srdf=self.srdf,
            meshes=self.shapes,
        )
