"""Which distances a controller keeps: between the robot's own shapes, and from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nmm.arrays import counted, positive
from nmm.collisions.obstacle import Obstacle, checked_distance
from nmm.collisions.robot_shapes import CAPSULES, HULLS
from nmm.collisions.setting import Setting, set_up
from nmm.errors import InputError, expect_known
from nmm.robots.robot import Robot

#: Pairs are looked at from this far beyond the distance to keep, m.
BAND = 0.2


@dataclass(frozen=True)
class Collisions:
    """Distances that a controller never lets fall below a number.

    Parameters
    ----------
    distance : to keep, m, from 0
    self : whether the robot keeps off itself, too
    obstacles : what it keeps off, `Obstacle`s
    ignore : pairs of names (links, shapes, obstacles) that are not kept apart
    srdf : a file of MoveIt's whose disabled pairs are left out, too, or True for the robot's own (see
        `nmm.load`); those that do touch are told
    shapes : what stands for the robot's meshes, "hulls" or "capsules"
    band : pairs nearer than this have rows, m; `distance` and 0.2 m more when not given
    gain : 1/s, a distance falls no faster than this times what is left of it
    recovery : speed of the way back where a distance is below, m/s
    braking : deceleration of a distance to count on, m/s²; None for a quarter of what the inputs'
        accelerations give
    rows : the most distances that are kept at a time, the nearest ones

    Raises
    ------
    InputError : a negative distance, no obstacles, two of one name, a band that is not beyond the distance,
        obstacles in the place of `self`

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
    self: bool = True
    obstacles: Sequence[Obstacle] = ()
    ignore: Sequence[tuple[str, str]] = ()
    srdf: str | Path | bool | None = None
    shapes: str = HULLS
    band: float | None = None
    gain: float = 4.0
    recovery: float = 0.1
    braking: float | None = None
    rows: int = 40

    def __post_init__(this) -> None:  # self is a field
        if not isinstance(
            this.self, bool
        ):  # or obstacles, given by position, would be what nothing keeps off
            raise InputError(
                f"collisions: self: expected True or False, got {this.self!r}; obstacles go by their name, "
                "Collisions(0.03, obstacles=[...])"
            )
        given = (this.obstacles,) if isinstance(this.obstacles, Obstacle) else tuple(this.obstacles)
        for one in given:
            if not isinstance(one, Obstacle):
                raise InputError(f"collisions: obstacles: expected an Obstacle, got {one!r}")
        names = [one.name for one in given]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"collisions: obstacles: expected a name each, got {name!r} twice")
        distance = checked_distance(this.distance, "collisions: distance")
        band = distance + BAND if this.band is None else positive(this.band, "collisions: band")
        if band <= distance:
            raise InputError(f"collisions: band: expected more than the distance, {distance:g}, got {band:g}")
        expect_known("shapes", this.shapes, (HULLS, CAPSULES), "collisions")
        checked = {
            "obstacles": given,
            "distance": distance,
            "band": band,
            "ignore": tuple(this.ignore),
            "gain": positive(this.gain, "collisions: gain"),
            "recovery": positive(this.recovery, "collisions: recovery"),
            "braking": None if this.braking is None else positive(this.braking, "collisions: braking"),
            "rows": counted(this.rows, "collisions: rows"),
        }
        for name, value in checked.items():
            object.__setattr__(this, name, value)

    def on(this, robot: Robot) -> Setting:
        """These distances on one robot; `InputError` names what it does not have."""
        return set_up(
            robot,
            this.obstacles,
            own=this.self,
            distance=this.distance,
            band=float(this.band or np.inf),
            ignore=this.ignore,
            srdf=this.srdf,
            meshes=this.shapes,
        )
