"""What plans are found by: goal configurations, and a path of legs between them, shortened."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np

from nmm.base.arrays import Array, counted
from nmm.base.errors import InputError, RunError, few
from nmm.base.kernels.compiled import checked_by_caller
from nmm.plugins.planning import tree
from nmm.plugins.planning.collisions.legs_check import MARGIN
from nmm.plugins.planning.goals import GoalPostures, Wanted, alternatives, nothing_found
from nmm.plugins.planning.path import Guide
from nmm.plugins.planning.prepared import Prepared
from nmm.plugins.planning.search_space import drawn_within
from nmm.plugins.planning.shortening import shortened
from nmm.plugins.planning.tree import SPARE, Trees
from nmm.plugins.planning.ways import LEGS

#: Rounds of a search between two looks at the clock.
ROUNDS = 200
#: After so many motions a search that began with known ways begins anew without them: all that grows may be
#: nearest to a dead end.
ALONE = 1000

T = TypeVar("T")


class PlanSearch:
    """What one plan needs: where it begins, its goals, and what is `prepared` for it.

    where : the start is named so in errors
    nearer : pairs by name that may come so near, m, as in a plan that this one goes on with
    """

    _ends: float
    asked_kept: Array
    tree: Array

    def __init__(
        self,
        prepared: Prepared,
        start: Array,
        goals: Sequence[Wanted],
        seed: int = 0,
        where: str = "plan: start",
        nearer: Mapping[tuple[str, str], float] | None = None,
    ) -> None:
        self.prepared, self.start, self.goals, self._where = prepared, start, goals, where
        self._nearer = nearer
        self.robot, self.asked, self.scene, self.movers, self.efforts, self.costs = (
            *(prepared.robot, prepared.asked, prepared.scene, prepared.movers),
            *(prepared.efforts, prepared.costs),
        )
        self.limits, self.usual, self.check = prepared.limits, prepared.usual, prepared.check
        self.seed = seed = counted(seed, "seed", 0)
        self.tree = np.zeros((0, 2, self.robot.n))
        self.rng = np.random.default_rng(seed)
        self.within = prepared.within
        outside = self.robot.outside(start, self.within)
        if outside:
            raise InputError(f"outside its limits: {few([*outside.values()])}", where=where)
        self.low, self.high = drawn_within(
            self.robot, start, goals, self.asked.collisions.obstacles, self.within
        )
        trees = self.trees
        trees.low[:], trees.high[:] = self.low, self.high
        trees.random[:] = 1 + seed % (tree.MODULUS - 1)
        trees.counts[:] = trees.roots[:] = trees.looked[:] = 0
        self.check.forget()
        self._search = checked_by_caller(tree.search, tree.SEARCH)

    @property
    def trees(self) -> Trees:
        return self.prepared.trees

    @property
    def guide(self) -> Guide:
        return self.prepared.guide

    def farther(
        self, start: Array, ends: Sequence[Array], ahead: Sequence[Array] = (), behind: Sequence[Array] = ()
    ) -> Array:
        """A `way` that keeps the margin, too, where one is found in half of the time."""
        return self.with_margin(partial(self.way, start, ends, ahead, behind), start, ends)

    def with_margin(self, find: Callable[[], T], start: Array, ends: Sequence[Array]) -> T:
        """What `find` returns, with the margin between these (n,) in half of the time, or else without."""
        if self.asked.margin > 0.0:
            last, self._ends = self._ends, 0.5 * (time.monotonic() + self._ends)
            self.widen(start, *ends)
            with suppress(RunError):
                return find()
            self._ends = last
            self.keep_asked()
        return find()

    def keep_asked(self) -> None:
        """Keep the distances asked for, and no margin."""
        self.check.kept[:] = self.asked_kept

    def left(self) -> float:
        """How much time is left, s; told to `progress`, too."""
        left = self._ends - time.monotonic()
        if self._progress is not None:
            self._progress(min(1.0, 1.0 - left / self._seconds))
        return left

    def widen(self, *configurations: Array) -> None:
        """Keep the margin as far as these (n,) do."""
        self.keep_asked()
        self.check.widen(np.array(configurations), self.asked.margin)

    def begin(self, seconds: float, progress: Callable[[float], None] | None) -> None:
        """Start the clock; `InputError` for a start that touches something."""
        self._ends, self._seconds, self._progress = time.monotonic() + seconds, seconds, progress
        self.check.keep(self.start[np.newaxis], self._nearer)
        self.asked_kept = self.check.kept.copy()
        scene = self.check.scene
        if scene is not None and self.check.too_near(self.start) >= 0:
            distances = scene.queries.distances(0.0, self.start, range(len(scene.names)))
            touch = [scene.words(int(k)) for k in np.flatnonzero(distances < 4.0 * MARGIN)]
            cure = "another start, or for links that may touch collisions.ignore (ignore=[(one, other)])"
            raise InputError(f"{few(touch)} touch", where=self._where, expected=cure)

    def shortened(self, start: Array, legs: Array, rounds: int) -> Array:
        """Shorter legs from a configuration."""
        arm = 3 + (0 if self.robot.platform.n_p < 3 else self.robot.platform.n_p)
        return shortened(self.guide, start, legs, rounds, arm)

    def blocked(self, start: Array, legs: Array) -> int:
        """The number of a pair that comes too near on legs from a free configuration, their number where the
        platform leaves where it stays, or -1; counted."""
        self.trees.looked[0] += 1
        return self.check.blocked(start, legs)

    def ends(self, wanted: object, start: Array) -> list[Array]:
        """Free configurations (n,) that reach a goal."""
        postures = GoalPostures(
            self.robot, self.low, self.high, self.check, self.asked.tolerance, self.within
        )
        configurations = [q for goal in alternatives(wanted) for q in postures.find(goal, start, self.rng)]
        if not configurations:
            raise nothing_found(postures)
        return [self.near(q, start) for q in configurations]

    def near(self, q: Array, start: Array) -> Array:
        """The same posture with its joints the short way round from a configuration (n,)."""
        turns, robot = self.robot.turns(self.limits.coordinates), self.robot
        turns[: robot.platform.n_p] = 0.0
        full = 2.0 * np.pi
        return np.asarray(q - full * turns * np.round((q - start)[robot.own_or_leader] / full))

    def way(
        self, start: Array, goals: Sequence[Array], ahead: Sequence[Array] = (), behind: Sequence[Array] = ()
    ) -> Array:
        """Legs from start (n,) to one of the goals (n,), directly or by search. Free ways are known from the
        start through those `ahead`, one after the other, and from those `behind` to the first goal."""
        for goal in goals:
            legs = self.guide.way(start, goal)
            if self.blocked(start, legs) < 0:
                return legs.copy()
        most = max(1 + len(ahead), len(goals) + len(behind)) + SPARE
        while self.trees.parents.shape[1] < most and self.prepared.enlarge():
            pass
        trees = self.trees
        grown: tuple[tuple[Sequence[Array], Sequence[Array]], ...] = (([start], ahead), (goals, behind[::-1]))
        for k, (roots, chain) in enumerate(grown):
            count = len(roots) + len(chain)
            trees.roots[k], trees.counts[k] = len(roots), count
            trees.nodes[k, :count] = [*roots, *chain]
            trees.parents[k, : len(roots)] = -1
            trees.parents[k, len(roots) : count] = [0, *range(len(roots), count - 1)][: len(chain)]
        trees.rounds[:] = 0
        scratch, looked = np.zeros((LEGS, 3 + self.robot.n)), int(trees.looked[0])
        while True:
            outcome = self._search(*self.check.blocks, ROUNDS, scratch)
            left, trees = self.left(), self.trees
            if outcome > 0:
                break
            if outcome < 0 and self.prepared.enlarge():
                continue
            if (ahead or behind) and trees.looked[0] - looked > ALONE:
                trees.counts[:], ahead, behind = trees.roots, (), ()
                continue
            if outcome < 0 or left < 0.0:
                what = "no room for more configurations" if outcome < 0 else f"{self._seconds:g} s"
                raise RunError(
                    f"no way found in {what}: {trees.looked[1]} configurations and {trees.looked[0]} motions "
                    "looked at",
                    where="plan",
                )
        self._remember_tree()
        nodes = [trees.nodes[k, i] for k in (0, 1) for i in self._chain(k)]
        return np.vstack([self.guide.way(a, b) for a, b in pairwise(nodes)])

    def _remember_tree(self) -> None:
        grown = [self.tree]
        for k in (0, 1):
            nodes, before = self.trees.nodes[k], self.trees.parents[k, : self.trees.counts[k]]
            new = np.flatnonzero(before >= 0)
            grown.append(nodes[np.column_stack([before[new], new])])
        self.tree = np.concatenate(grown)

    def _chain(self, k: int) -> list[int]:
        """The nodes of a tree from its root to where both met, in the motion's order."""
        chain = [int(self.trees.met[k])]
        while (parent := int(self.trees.parents[k, chain[-1]])) >= 0:
            chain.append(parent)
        return chain[::-1] if k == 0 else chain
