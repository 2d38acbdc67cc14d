"""How a plan is found: goal configurations, a path of legs between them, shortened and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, counted, positive, scalar
from nmm.collisions.legs_check import MARGIN
from nmm.collisions.motion_check import MotionCheck
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.scene import Scene
from nmm.control.collisions import Collisions
from nmm.control.goal import Goal
from nmm.control.limits import Limits
from nmm.errors import InputError, NmmError, RunError, expect_kind, few
from nmm.functions.objectives.base import Objective
from nmm.functions.tasks.task import Task
from nmm.kernels.compiled import checked_by_caller
from nmm.kernels.record_layout import views
from nmm.plans import tree
from nmm.plans.effort import efforts_of
from nmm.plans.goals import GoalPostures, Wanted, alternatives, nothing_found
from nmm.plans.held_motion import HeldTiming
from nmm.plans.held_search import HeldWays, refuse_beside_hold
from nmm.plans.holding import Held
from nmm.plans.objective import SampleCosts
from nmm.plans.path import Guide, shortened
from nmm.plans.plan import Asked, Found, Motion, Plan
from nmm.plans.samples import SampledMotion, joined
from nmm.plans.search_space import USUAL, drawn_within, leg_speeds, pause_between, usual_speeds
from nmm.plans.smoothing import Smoothing
from nmm.plans.timing import TimedLegs, timed
from nmm.plans.towing import Towing
from nmm.plans.tree import PLACE, Trees
from nmm.plans.waiting import LONG, waited
from nmm.plans.ways import LEGS, ways_of
from nmm.platforms.tractor import Tractor
from nmm.robots.robot import Robot

#: Room for configurations in each tree, and rounds of a search between two looks at the clock.
ROOM, ROUNDS = 20_000, 200
#: The longest motion by which a tree grows, s.
STEP = 2.0
#: Ways that are tried among obstacles that move, and how often each but the first is shortened.
WAYS, SHORTEN = 8, 50

T = TypeVar("T")


def plan(
    robot: Robot,
    start: ArrayLike | Mapping[str, float],
    goal: Wanted,
    obstacles: Sequence[Obstacle] = (),
    collisions: Collisions | None = None,
    limits: Limits | None = None,
    seconds: float = 10.0,
    seed: int = 0,
    *,
    tolerance: Goal | None = None,
    through: Sequence[Wanted] = (),
    shorten: int = 200,
    smooth: bool = False,
    objective: Objective | None = None,
    effort: bool | Mapping[str, Any] = False,
    margin: float = 0.0,
    hold: Task | str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """A motion from start to goal that keeps every distance and limit.

    Parameters
    ----------
    start : (n,) or by name, m and rad
    goal : a configuration (n,); coordinates by name, of which the others are free; a `Task` whose target
        stands; or a list of these, of which one is to be reached
    obstacles : those with a `motion` are waited for: the way is looked for among the others, which stand
        where they are at t = 0; where no timing of it works, other ways are tried
    collisions : distances to keep, with obstacles of its own; `Collisions()` with the obstacles when not
        given
    limits : of velocity, acceleration and position; the robot's own when not given
    seconds : after which the search gives up
    seed : of the random numbers; the same plan comes of the same seed
    tolerance : of a task's goal; `Goal()` when not given
    through : goals that are reached on the way, in order
    shorten : how often a shorter way between two points of the motion is tried
    smooth : whether to look for one motion without rests, which takes about half the time and 0.1 to 0.5 s
        more to plan; where none is found that keeps everything, the one with rests stands (`Plan.smooth`). A
        tractor's with trailers always is
    objective : H(q) to minimise along a smooth motion, in the time that it takes without: each of its samples
        costs 0.3 for an input at its limit, 1 for a rate of it at its limit, by their squares, and H
    effort : whether motors keep the torque limits of the robot's file, or masses that the robot carries then,
        kg by frame (as `payload` of `nmm.Dynamics`); what needs more is driven slower
    margin : so much farther than the distance, m, it keeps off what start and goals leave so much room to,
        where such a motion is found in half of the time; for a controller that follows it (`Plan.reference`)
    hold : a frame whose pose stays what it is at the start while the platform moves, or a `Task` whose target
        the start has (`Task(Position("tool"), p)`); goals are then poses of the platform, x, y and theta, and
        the arm's posture there comes of the way. It rests between the platform's arcs and lines
    progress : called with the share of `seconds` that is gone

    Returns
    -------
    Plan; it stands between two of its legs unless it is smooth, and ends at rest.

    Raises
    ------
    InputError : a start that touches something or is outside limits, a goal of another kind, limits of
        functions, a platform whose ways are not known, an objective that changes with time or without smooth,
        what the arm alone cannot hold
    RunError : no goal configuration was found, or no way there, or of a tractor with trailers no exact motion
        along it; the text says what was tried

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
    >>> plan = nmm.plan(robot, {"q1": 0.5}, {"x": 6.0, "y": 0.0, "theta": 0.0}, [wall])
    >>> np.allclose(plan.end[:3], [6.0, 0.0, 0.0], atol=1e-9)
    True
    """
    q = robot.following.placed(robot.q(start))
    robot.check_limits(q)
    limits = Limits() if limits is None else limits
    expect_kind(limits, Limits, "plan: limits", "Limits")
    if limits.bounds:
        raise InputError("limits of functions are not planned for", where="plan: limits")
    n_p, ends = robot.platform.n_p, np.asarray(robot.limited.all(axis=1))
    endless = [robot.q_names[i] for i in range(n_p, robot.n) if robot.q_units[i] == "m" and not ends[i]]
    if endless:  # nothing bounds how far what it carries is from the joints before it
        raise InputError(
            f"{few(endless)}: slides without limits", where="plan: robot", expected="limits of it"
        )
    smooth = smooth or isinstance(robot.platform, Tractor)
    if objective is not None and not smooth:
        raise InputError("smooth motions alone have one", where="plan: objective", expected="smooth=True")
    kept = collisions or Collisions()
    asked = Asked(
        collisions=replace(kept, obstacles=(*kept.obstacles, *obstacles)),
        limits=limits,
        tolerance=tolerance or Goal(),
        smooth=smooth,
        objective=objective,
        effort=effort,
        margin=scalar(margin, "plan: margin", least=0.0),
        hold=hold,
    )
    search = Search(robot, q, [*through, goal], asked, seed)
    return search.plan(positive(seconds, "seconds"), counted(shorten, "shorten", 0), progress)


class Search:
    """What one plan needs: the trees, the check of distances, and the goals."""

    _ends: float
    asked_kept: Array
    tree: Array

    def __init__(
        self,
        robot: Robot,
        start: Array,
        goals: Sequence[Wanted],
        asked: Asked,
        seed: int = 0,
    ) -> None:
        self.robot, self.start, self.goals, self.asked = robot, start, goals, asked
        self.seed = seed = counted(seed, "seed", 0)
        self.tree = np.zeros((0, 2, robot.n))
        self.rng = np.random.default_rng(seed)
        self.costs = None
        if asked.smooth and asked.objective is not None:
            self.costs = SampleCosts(robot, asked.objective)
        self.efforts, given = efforts_of(robot, asked.effort), asked.collisions
        self.obstacles = tuple(given.obstacles)
        known = bool(self.obstacles) or len(robot.collision_model.collisionPairs) > 0
        self.scene = given.on(robot) if known else None
        movers, scene = [one for one in self.obstacles if one.moves], self.scene
        self.movers = None
        if movers:  # the way is looked for among what stands, and its timing among what moves
            self.movers = replace(given, obstacles=movers, self_collisions=False).on(robot)
            stands = [one for one in self.obstacles if not one.moves]
            own = given.self_collisions and len(robot.collision_model.collisionPairs) > 0
            scene = replace(given, obstacles=stands).on(robot) if stands or own else None
        self.limits = asked.limits.on(robot)
        self.usual = usual_speeds(robot, self.limits)
        speeds, reverses = leg_speeds(robot, self.limits, self.usual), self.limits.inputs[:1, 0] < 0.0
        ways = ways_of(robot, speeds, pause_between(self.limits), reverses=bool(np.all(reverses)))
        self.low, self.high = drawn_within(robot, start, goals, self.obstacles)
        trees = Trees(
            ways=ways,
            low=self.low,
            high=self.high,
            step=np.array(STEP),
            nodes=np.zeros((2, ROOM, robot.n)),
            parents=np.zeros((2, ROOM), dtype=np.int64),
            counts=np.zeros(2, dtype=np.int64),
            roots=np.zeros(2, dtype=np.int64),
            random=np.array([1 + seed % (tree.MODULUS - 1)], dtype=np.int64),
            met=np.zeros(2, dtype=np.int64),
            looked=np.zeros(2, dtype=np.int64),
        )
        self.check = MotionCheck(robot, scene, trees)
        self.trees = views(Trees, *self.check.blocks, PLACE)
        self.guide = Guide(self.check.blocks, robot.platform.n_p >= 3, robot.following.table.ravel())
        self._search = checked_by_caller(tree.search, tree.SEARCH)
        self.ways = None if asked.hold is None else self._held_ways(asked.hold)

    def plan(self, seconds: float, shorten: int, progress: Callable[[float], None] | None) -> Plan:
        """From the start through all goals; each part ends where the next begins."""
        if isinstance(self.robot.platform, Tractor):
            return self._towed(self.robot.platform, seconds, progress)
        self.begin(seconds, progress)
        if self.ways is not None:
            return self._holding(self.ways, shorten)
        here, parts, least = self.start, [], self.asked_kept + self.asked.margin
        for wanted in self.goals:
            self.check.kept[:] = self.asked_kept
            legs = self.shortened(here, self.farther(here, self.ends(wanted, here)), shorten)
            parts.append(legs)
            here, least = self.guide.corners(here, legs)[-1], np.minimum(least, self.check.kept)
        self.check.kept[:] = least
        return self.finished(*parts)

    def _towed(self, tractor: Tractor, seconds: float, progress: Callable[[float], None] | None) -> Plan:
        """The plan of a tractor with trailers, which is smooth."""
        if self.movers is not None:
            raise InputError("a tractor with trailers waits for none that move", where="plan: obstacles")
        given = self.robot, self.limits, USUAL, self.check, self.low, self.high, self.seed, self.left
        towing = Towing(*given, self.costs)
        self.begin(seconds, progress)
        hitches, here, found = {one.joint for one in tractor.trailers}, self.start, []
        for wanted in self.goals:
            self.check.kept[:] = self.asked_kept
            ends, named = self.ends(wanted, here), self._named(wanted)
            if any(np.array_equal(here, end) for end in ends):
                continue
            find = partial(towing, here, ends, loose=named is not None and not hitches & named)
            motion = self._farther(find, here, ends)
            found.append(motion if self.efforts is None else self.efforts.samples(motion))
            here = motion.corners[-1]
        still = self._timed(here, np.zeros((0, 3 + self.robot.n)))
        return self._plan(joined(found) if found else still, towing.motions, towing.configurations)

    def _named(self, wanted: object) -> set[str] | None:
        """The coordinates that goals name, and their postures; None where one of them is no goal by name."""
        named: set[str] = set()
        for one in alternatives(wanted):
            if not isinstance(one, Mapping):
                return None
            named |= {*one, *self.robot.postures.get(str(one.get("posture")), {})}
        return named

    def _held_ways(self, hold: Task | str) -> HeldWays:
        refuse_beside_hold(self.robot, self.asked)
        held = Held(self.robot, hold, self.start, self.asked.tolerance, self.check)
        timing = HeldTiming(held, self.guide, self.limits, self.usual)
        return HeldWays(self.asked, timing, self.trees, self.rng, self.left)

    def _holding(self, ways: HeldWays, shorten: int) -> Plan:
        """The plan along which the arm holds something."""
        here, motions = self.start, list[SampledMotion]()
        for wanted in self.goals:
            self.check.kept[:] = self.asked_kept
            motions += ways.motions(here, wanted, shorten)
            here = motions[-1].corners[-1] if motions else here
        if self.efforts is not None:
            motions = [self.efforts.samples(one) for one in motions]
        motion = joined(motions) if motions else self._timed(here, np.zeros((0, 3 + self.robot.n)))
        return self._found(motion)

    def farther(
        self, here: Array, ends: Sequence[Array], ahead: Sequence[Array] = (), behind: Sequence[Array] = ()
    ) -> Array:
        """A `way` that keeps the margin, too, where one is found in half of the time."""
        return self._farther(partial(self.way, here, ends, ahead, behind), here, ends)

    def _farther(self, find: Callable[[], T], here: Array, ends: Sequence[Array]) -> T:
        """What is found with the margin kept between these (n,) in half of the time, or else without."""
        if self.asked.margin > 0.0:
            last, self._ends = self._ends, 0.5 * (time.monotonic() + self._ends)
            self.widen(here, *ends)
            with suppress(RunError):
                return find()
            self._ends, self.check.kept[:] = last, self.asked_kept
        return find()

    def left(self) -> float:
        """How much time is left, s; told to `progress`, too."""
        left = self._ends - time.monotonic()
        if self._progress is not None:
            self._progress(min(1.0, 1.0 - left / self._seconds))
        return left

    def widen(self, *configurations: Array) -> None:
        """Keep the margin as far as these (n,) do."""
        self.check.kept[:] = self.asked_kept
        self.check.widen(np.array(configurations), self.asked.margin)

    def begin(self, seconds: float, progress: Callable[[float], None] | None) -> None:
        """Start the clock; `InputError` for a start that touches something."""
        self._ends, self._seconds, self._progress = time.monotonic() + seconds, seconds, progress
        self.check.keep(self.start[np.newaxis])
        self.asked_kept = self.check.kept.copy()
        scene = self.check.scene
        if scene is not None and self.check.too_near(self.start) >= 0:
            distances = scene.queries.distances(0.0, self.start, range(len(scene.names)))
            touch = [scene.words(int(k)) for k in np.flatnonzero(distances < 4.0 * MARGIN)]
            cure = "another start, or Collisions(ignore=[(one, other)]) for links that may touch"
            raise InputError(f"{few(touch)} touch", where="plan: start", expected=cure)

    def finished(self, *parts: Array) -> Plan:
        """The plan of legs from the start; a smooth one rests between the parts."""
        path = self._timed(self.start, np.vstack(parts))
        motion: Motion = path
        if self.movers is not None:
            motion = self._waited(path, self.movers)
        elif self.asked.smooth:
            motion = self._smoothed(parts) or path
        return self._found(motion)

    def _found(self, motion: Motion) -> Plan:
        motions, postures = (int(count) for count in self.trees.looked)
        return self._plan(motion, motions, postures)

    def _plan(self, motion: Motion, motions: int, postures: int) -> Plan:
        found = Found(motion, self.limits, self.scene, self.goals[-1], self.asked, self.tree)
        return Plan(self.robot, motions, postures, found)

    def _waited(self, path: TimedLegs, movers: Scene) -> TimedLegs:
        """The path, or another way, with a timing among what moves; `RunError` where none of them has one."""
        timed, looked = waited(path, self.robot, movers)
        ways = 1
        for k in range(1, WAYS):
            left = self._ends - time.monotonic()
            if timed is not None or left <= 0.0:
                break
            at = None if k % 2 == 0 else LONG if k == 1 else float(self.rng.uniform(0.0, path.duration))
            with suppress(NmmError):  # what stands there may touch the start, the goal, or leave no way
                other = self._another_way(at, k, left / (WAYS - k))
                timed, more = waited(cast(TimedLegs, other.motion), self.robot, movers)
                self.tree = other.tree if timed is not None else self.tree
                ways, looked = ways + 1, looked + more
        if timed is None:
            names = few(sorted({one.name for one in movers.obstacles}))
            tried = f"{ways} way{'s'[: ways > 1]} and {looked} timings of their parts looked at"
            raise RunError(f"{tried}: none keeps its distance of {names}", where="plan")
        return timed

    def _another_way(self, at: float | None, k: int, seconds: float) -> Found:
        """The way of another seed, with what moves standing where it is at a time, s; without it at None."""
        given = self.asked.collisions
        kept = [one for one in self.obstacles if not one.moves]
        if at is not None:
            moves = [one for one in self.obstacles if one.moves]
            kept += [Obstacle(one.shape, one.placement(at), name=one.name) for one in moves]
        asked = replace(self.asked, collisions=replace(given, obstacles=tuple(kept)), smooth=False)
        other = Search(self.robot, self.start, self.goals, asked, self.seed + k)
        return other.plan(seconds, SHORTEN, None).found

    def _timed(self, start: Array, legs: Array) -> TimedLegs:
        motion = timed(self.guide, self.robot, start, self.guide.merged(legs), self.limits, self.usual)
        return motion if self.efforts is None else self.efforts.legs(motion)

    def _smoothed(self, parts: Sequence[Array]) -> SampledMotion | None:
        """The parts as smooth motions with rests between them; None where one of them is not found."""
        smoothing = Smoothing(self.robot, self.limits, USUAL, self.check, self.costs)
        found, here = [], self.start
        for legs in parts:
            path = self._timed(here, legs)
            here = path.corners[-1]
            if path.duration > 0.0:
                motion = smoothing(path)
                if motion is None:
                    return None
                found.append(motion if self.efforts is None else self.efforts.samples(motion))
        return joined(found) if found else None

    def shortened(self, start: Array, legs: Array, rounds: int) -> Array:
        """Shorter legs from a configuration."""
        first = 3 + (0 if self.robot.platform.n_p < 3 else self.robot.platform.n_p)

        def blocked(here: Array, new: Array, whole: Array) -> int:
            return self.blocked(here, new)

        return shortened(self.guide, blocked, start, legs, rounds, self.rng, first)

    def blocked(self, start: Array, legs: Array) -> int:
        """The number of a pair that comes too near on legs from a free configuration, or -1; counted."""
        self.trees.looked[0] += 1
        return self.check.blocked(start, legs)

    def ends(self, wanted: object, here: Array) -> list[Array]:
        """Free configurations (n,) that reach a goal."""
        postures = GoalPostures(self.robot, self.low, self.high, self.check, self.asked.tolerance)
        found = [q for one in alternatives(wanted) for q in postures.find(one, here, self.rng)]
        if not found:
            raise nothing_found(postures)
        return found

    def way(
        self, start: Array, goals: Sequence[Array], ahead: Sequence[Array] = (), behind: Sequence[Array] = ()
    ) -> Array:
        """Legs from a configuration to one of these, found at once or by search. Free ways are known from it
        through those `ahead`, one after the other, and from those `behind` to the first goal."""
        for goal in goals:
            legs = self.guide.way(start, goal)
            if self.blocked(start, legs) < 0:
                return legs.copy()
        trees = self.trees
        grown: tuple[tuple[Sequence[Array], Sequence[Array]], ...] = (([start], ahead), (goals, behind[::-1]))
        for k, (roots, chain) in enumerate(grown):
            count = len(roots) + len(chain)
            trees.roots[k], trees.counts[k] = len(roots), count
            trees.nodes[k, :count] = [*roots, *chain]
            trees.parents[k, : len(roots)] = -1
            trees.parents[k, len(roots) : count] = [0, *range(len(roots), count - 1)][: len(chain)]
        scratch = np.zeros((LEGS, 3 + self.robot.n))
        while True:
            found = self._search(*self.check.blocks, ROUNDS, scratch)
            left = self.left()
            if found > 0:
                break
            if found < 0 or left < 0.0:
                what = "no room for more configurations" if found < 0 else f"{self._seconds:g} s"
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
