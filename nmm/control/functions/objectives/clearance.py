"""Clearance: an objective that grows where the robot comes near to something, so that it turns away early."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, Self, cast

import numpy as np

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import InputError
from nmm.base.kernels.record_layout import Memory, views
from nmm.control.functions.callbacks import stage
from nmm.control.functions.function import Evaluation, Stage
from nmm.control.functions.objectives.base import Objective
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.rows import DistanceRows, no_rows
from nmm.model.collisions.scene import Scene, set_up
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import RollingPreview

#: Usual way that is looked ahead with wheels that have to roll to turn, m. What turns on the spot drove
#: around random obstacles less often with it than without.
AHEAD = 1.0
#: Looks on that way: with one, what stands before it is not seen, and one turns back towards it.
LOOKS = 3


class Distances(Protocol):
    """What says between what distances count: the `Collisions` of a controller."""

    @property
    def distance(self) -> float: ...
    @property
    def obstacles(self) -> Sequence[Obstacle]: ...
    @property
    def ignore(self) -> Sequence[tuple[str, str]]: ...
    @property
    def srdf(self) -> str | Path | bool | None: ...
    @property
    def shapes(self) -> str: ...


class Clearance(Objective):
    """H = ½ Σ max(0, 1 - (d - distance) / reach)² over the distances d of pairs of shapes; minimise it.

    It is 0 beyond `reach`, ½ for each pair at the kept distance. With `ahead`, its mean at three places
    further on, reached with the steering as it is, is added: steering a car that stands changes no distance.

    Parameters
    ----------
    collisions : the `Collisions` of the controller, for their obstacles, shapes and distance; in a scenario,
        and with `among`, they are those of the run
    reach : how far beyond the distance to keep a pair counts, m
    own : whether the robot's distances to itself count, too
    ahead : how far ahead the robot is looked at, too, m, below 0 backwards; by default 1 for a car's wheels,
        else 0

    Raises
    ------
    InputError : a reach that is not above 0, numbers that are not finite; on a robot, no collisions, or
        neither obstacles nor `own`

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> post = nmm.Obstacle(nmm.Cylinder(0.2, 0.8), [1.0, 0.6, 0.4])
    >>> H = nmm.Clearance(nmm.Collisions(obstacles=[post]), reach=0.5)
    >>> near, far = ({"q1": 0.5, "q2": 1.2}, {"q1": -1.5, "q2": 1.2})
    >>> H.value(nmm.Configuration(robot, robot.q(near))) > H.value(nmm.Configuration(robot, robot.q(far)))
    True
    """

    def __init__(
        self,
        collisions: Distances | None = None,
        reach: float = 0.6,
        own: bool = False,
        ahead: float | None = None,
    ) -> None:
        for name in ("distance", "obstacles", "ignore", "srdf", "shapes"):
            if collisions is not None and not hasattr(collisions, name):
                raise InputError(where="clearance: collisions", expected="Collisions", got=collisions)
        self.collisions = collisions
        self.reach = positive(reach, "clearance: reach")
        self.own = bool(own)
        self.ahead = None if ahead is None else scalar(ahead, "clearance: ahead")
        self._setting: Scene | None = None

    def among(self, collisions: Distances) -> Self:
        """This objective with the distances of a controller."""
        copied = copy.copy(self)
        copied.collisions, copied._setting = collisions, None
        return copied

    def __getstate__(self) -> dict[str, Any]:
        """Shapes do not travel: copies make theirs anew."""
        return {**vars(self), "_setting": None}

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        if self.collisions is None:
            raise InputError(where="clearance", expected="collisions, whose obstacles it keeps off", got=None)
        if self._setting is None or self._setting.robot is not robot:
            collisions = self.collisions
            if not self.own and not collisions.obstacles:
                raise InputError(where="clearance", expected="obstacles (own: the robot itself)", got=None)
            self._setting = set_up(
                robot,
                collisions.obstacles,
                own=self.own,
                distance=collisions.distance,
                band=collisions.distance + self.reach,
                ignore=collisions.ignore,
                srdf=collisions.srdf,
                meshes=collisions.shapes,
            )
            self._setting.queries.scene.faces[()] = -np.inf  # one row a pair: H is of distances
        return (stage(1, robot.n, _Near(self._setting, self.reach, self.ahead)),)

    def dependence(self, configuration: Configuration) -> Array:
        """What moves one shape of a pair and not the other, and what steers where it looks ahead: near or
        not."""
        self.stages(configuration.robot)
        scene = cast(Scene, self._setting)
        rows = np.asarray(scene.queries.scene.apart.max(axis=0, initial=0.0))[np.newaxis]
        roll = RollingPreview(configuration.robot)
        if self.ahead or (self.ahead is None and roll.rolls):
            _, derivative = roll(configuration.q, self.ahead or AHEAD)
            rows[:, : len(derivative)] += rows[:, : len(derivative)] @ derivative
        return rows


class _Near:
    """H with its derivatives, measured; the callback of a stage."""

    def __init__(self, setting: Scene, reach: float, ahead: float | None) -> None:
        self._queries, self._keep, self._reach = setting.queries, setting.distance, reach
        memory = Memory()
        memory.add(no_rows(setting.robot.n, len(setting.names)))
        self._blocks = memory.blocks()
        self._rows = views(DistanceRows, *self._blocks, 0)
        self._roll = RollingPreview(setting.robot)
        self._ahead = (AHEAD if self._roll.rolls else 0.0) if ahead is None else ahead

    def __call__(self, t: float, configuration: Configuration) -> Evaluation:
        q = configuration.q
        H, H_t, H_q = self._at(t, q)
        for k in range(1, LOOKS + 1 if self._ahead else 1):
            q_ahead, derivative = self._roll(q, self._ahead * k / LOOKS)
            further, further_t, further_q = self._at(t, q_ahead)
            n_p = len(derivative)
            further_q[:n_p] = further_q[:n_p] @ derivative
            H, H_t, H_q = H + further / LOOKS, H_t + further_t / LOOKS, H_q + further_q / LOOKS
        return Evaluation(np.array([H]), np.array([H_t]), H_q[np.newaxis])

    def _at(self, t: float, q: Array) -> tuple[float, float, Array]:
        """H, ∂H/∂t and ∂H/∂q (n,) of the robot at q, without looking ahead."""
        rows = self._rows
        self._queries.update(t, q, *self._blocks, 0)
        used = int(rows.used)
        near = np.maximum(1.0 - (rows.d[:used] - self._keep) / self._reach, 0.0)
        slope = -near / self._reach
        return 0.5 * float(near @ near), float(slope @ rows.d_t[:used]), slope @ rows.d_q[:used]
