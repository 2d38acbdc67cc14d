"""What plans of one robot among the same obstacles share: nothing in it depends on a start or a goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from threading import RLock
from typing import Any

import numpy as np

from nmm.base.errors import InputError, expect_kind, few
from nmm.base.kernels.record_layout import views
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.scene import Scene
from nmm.model.collisions.shapes import Shape
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.effort import efforts_of
from nmm.plugins.planning.objective import SampleCosts
from nmm.plugins.planning.path import Guide
from nmm.plugins.planning.search_space import allowed, leg_speeds, pause_between, usual_speeds
from nmm.plugins.planning.tree import PLACE, Trees
from nmm.plugins.planning.ways import ways_of

#: Room for configurations in each tree, at first and at most.
ROOM, MOST = 1_000, 20_000
#: The longest motion by which a tree grows, s.
STEP = 2.0


@dataclass(frozen=True)
class Asked:
    """What a plan is to keep, and how it is made: see `nmm.plan`."""

    collisions: Collisions
    limits: Limits
    tolerance: Goal
    smooth: bool = False
    objective: Objective | None = None
    effort: bool | Mapping[str, Any] = False
    margin: float = 0.0
    hold: Task | str | None = None


class Prepared:
    """A robot among obstacles, and what is asked of its plans; one search at a time uses it (`lock`)."""

    check: MotionCheck
    guide: Guide
    trees: Trees

    def __init__(self, robot: Robot, asked: Asked) -> None:
        limits = asked.limits
        expect_kind(limits, Limits, "plan: limits", "Limits")
        if limits.bounds:
            raise InputError("limits of functions are not planned for", where="plan: limits")
        n_p, ends = robot.platform.n_p, np.asarray(robot.limited.all(axis=1))
        endless = [robot.q_names[i] for i in range(n_p, robot.n) if robot.q_units[i] == "m" and not ends[i]]
        if endless:  # nothing bounds how far what it carries is from the joints before it
            raise InputError(
                f"{few(endless)}: slides without limits", where="plan: robot", expected="limits of it"
            )
        self.robot = robot
        self.costs = None
        if asked.smooth and asked.objective is not None:
            self.costs = SampleCosts(robot, asked.objective)
        self.efforts = efforts_of(robot, asked.effort)
        self.limits = limits.on(robot)
        self.usual = usual_speeds(robot, self.limits)
        speeds, reverses = leg_speeds(robot, self.limits, self.usual), self.limits.inputs[:1, 0] < 0.0
        pause = pause_between(self.limits)
        self.within = allowed(robot, self.limits)
        arguments = robot, speeds, pause, bool(np.all(reverses)), self.limits.coordinates
        self._ways = ways_of(*arguments, self.within)
        self.lock = RLock()  # one for all that are made of this: costs and efforts are theirs together
        self._place(asked)

    def among(self, obstacles: Sequence[Obstacle]) -> Prepared:
        """The same among others; this where they stand as they did."""
        collisions = replace(self.asked.collisions, obstacles=tuple(obstacles))
        known = self.asked.collisions.obstacles
        stand = [a is b for a, b in zip(obstacles, known, strict=False)]
        stand += [a.at(0.0) is b for a, b in zip(obstacles, self._places, strict=False)]
        stand += [a.shape is b for a, b in zip(obstacles, self._forms, strict=False)]
        if len(known) == len(obstacles) and all(stand):
            return self
        other = object.__new__(Prepared)
        vars(other).update(vars(self))
        asked, forms = replace(self.asked, collisions=collisions), [obstacle.shape for obstacle in obstacles]
        scene = None if self.scene is None or self.movers is not None else self.scene.moved(obstacles)
        if scene is None:
            other._place(asked)
        else:  # no lock: a search writes nothing that the next one does not write first
            other._know(asked, forms, scene)
            other._lay_out(self.check.among(scene))
        return other

    def _know(self, asked: Asked, forms: list[Shape], scene: Scene | None) -> None:
        """forms : the obstacles' shapes, read before the scene was made: some may be updated meanwhile."""
        self.asked, self._forms, self.scene = asked, forms, scene
        self._places = [obstacle.at(0.0) for obstacle in asked.collisions.obstacles]

    def _place(self, asked: Asked) -> None:
        robot, collisions = self.robot, asked.collisions
        forms = [obstacle.shape for obstacle in collisions.obstacles]
        own = len(robot.collision_model.collisionPairs) > 0
        self._know(asked, forms, collisions.on(robot) if collisions.obstacles or own else None)
        movers, scene = [obstacle for obstacle in collisions.obstacles if obstacle.moves], self.scene
        self.movers = None
        if movers:  # the way is looked for among what stands, and its timing among what moves
            self.movers = replace(collisions, obstacles=movers, self_collisions=False).on(robot)
            stands = [obstacle for obstacle in collisions.obstacles if not obstacle.moves]
            own = own and collisions.self_collisions
            scene = replace(collisions, obstacles=stands).on(robot) if stands or own else None
        check = MotionCheck(robot, scene, self._trees(ROOM))
        if robot.platform.n_p >= 3:
            check.stay(self.within[:3])
        self._lay_out(check)

    def _trees(self, room: int) -> Trees:
        n = self.robot.n
        return Trees(
            ways=self._ways,
            low=np.zeros(n),
            high=np.zeros(n),
            step=np.array(STEP),
            nodes=np.zeros((2, room, n)),
            parents=np.zeros((2, room), dtype=np.int64),
            counts=np.zeros(2, dtype=np.int64),
            roots=np.zeros(2, dtype=np.int64),
            random=np.ones(1, dtype=np.int64),
            met=np.zeros(2, dtype=np.int64),
            looked=np.zeros(2, dtype=np.int64),
            rounds=np.zeros(1, dtype=np.int64),
        )

    def _lay_out(self, check: MotionCheck) -> None:
        self.check, self.trees = check, views(Trees, *check.blocks, PLACE)
        self.guide = Guide(check.blocks, self.robot.platform.n_p >= 3, self.robot.following.table.ravel())

    def enlarge(self) -> bool:
        """Give the trees more room; False where they have all that there is."""
        room = self.trees.parents.shape[1]
        if room >= MOST:
            return False
        larger = self._trees(min(4 * room, MOST))
        for name, numbers in self.trees._asdict().items():
            if name == "nodes":
                larger.nodes[:, :room] = numbers
            elif name == "parents":
                larger.parents[:, :room] = numbers
            else:
                larger = larger._replace(**{name: numbers})
        self.check.lay_out(larger)
        self._lay_out(self.check)
        return True
