"""nmm's plans beside OMPL's and beside control that reacts, on the scenes of `planning.py`:

    python benchmarks/planning_peers.py [INSTANCES] [SEED] [KIND …] [--reacting N]

OMPL (not one of nmm's dependencies: pip install ompl) plans by RRT-Connect and `simplifySolution` among
words of Reeds and Shepp and lines of the arm, to the same goal postures, with the same least radius, weights
and bounds. A configuration is valid where nmm's compiled check says so (`too_near`), every hundredth of the
space's extent, as OMPL has it. Its path is timed along the limits like nmm's. `free` counts what Coal finds
free at 2,000 times along the motion (`planning.checked`), `touch` what comes nearer than 0; `prepared` is the
second plan of an `nmm.Planner`. Control reacts with limits, distances, clearance and retreats; where the goal
is a pose of the platform, which no feedback reaches, it is asked for the end-effector's position there.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from planning import DISTANCE, KINDS, LIMITS, SIX, Scene, checked

import nmm
from nmm.plugins.planning.planned import finished
from nmm.plugins.planning.prepared import Asked, Prepared
from nmm.plugins.planning.search import PlanSearch

#: What OMPL may take, s.
SECONDS = 10.0


class Measured(NamedTuple):
    """Of a motion: processor time, its own time, s; the platform's way, m, the arm's, rad; to spare, m."""

    seconds: float
    duration: float
    way: float
    turned: float
    spare: float


def measured(scene: Scene, plan: nmm.Plan, seconds: float) -> Measured:
    q, _ = plan(np.linspace(0.0, plan.duration, 2000))
    moved = np.abs(np.diff(q, axis=0))
    n_p = scene.robot.platform.n_p
    way, turned = float(np.hypot(moved[:, 0], moved[:, 1]).sum()), float(moved[:, n_p:].sum())
    return Measured(seconds, plan.duration, way, turned, checked(scene, plan).free)


def of_nmm(scene: Scene, seed: int) -> nmm.Plan:
    return nmm.plan(scene.robot, scene.start, scene.goal, *around(scene), seed=seed)


def around(scene: Scene) -> tuple[list[nmm.Obstacle], nmm.Collisions, nmm.Limits]:
    return scene.obstacles, nmm.Collisions(DISTANCE), LIMITS


def of_planner(scene: Scene, seed: int) -> Callable[[], nmm.Plan]:
    """The second plan of an `nmm.Planner`."""
    planner = nmm.Planner(scene.robot, *around(scene))
    planner.plan(scene.start, scene.goal, seed=seed + 1)
    return partial(planner.plan, scene.start, scene.goal, seed=seed)


def of_ompl(scene: Scene, seed: int) -> nmm.Plan:
    """OMPL's motion as a plan of nmm's, which times it. `RunError` where none is found."""
    from ompl import base, geometric

    robot, start = scene.robot, scene.robot.q(scene.start)
    asked = Asked(nmm.Collisions(DISTANCE, obstacles=scene.obstacles), LIMITS, nmm.Goal())
    search = PlanSearch(Prepared(robot, asked), start, [scene.goal], seed)
    search.begin(SECONDS, None)
    goals, n_p, ways = search.ends(scene.goal, start), robot.platform.n_p, search.trees.ways

    platform = base.ReedsSheppStateSpace(float(ways.radius[()]))
    around = base.RealVectorBounds(2)
    arm, within = base.RealVectorStateSpace(robot.n - n_p), base.RealVectorBounds(robot.n - n_p)
    for bounds, low, high in (
        (around, search.low[:2], search.high[:2]),
        (within, search.low[n_p:] - 1e-9, search.high[n_p:] + 1e-9),
    ):
        for i in range(len(low)):
            bounds.setLow(i, low[i])
            bounds.setHigh(i, high[i])
    platform.setBounds(around)
    arm.setBounds(within)
    space = base.CompoundStateSpace()
    speeds = ways.speeds
    space.addSubspace(platform, 1.0 / speeds[0])
    space.addSubspace(arm, 1.0 / float(speeds[3 + n_p :].min()))
    setup = geometric.SimpleSetup(space)
    here = start.copy()

    def written(q: np.ndarray, state: object) -> object:
        state[0].setX(q[0]), state[0].setY(q[1]), state[0].setYaw(float(np.angle(np.exp(1j * q[2]))))
        for k, value in enumerate(q[n_p:]):
            state[1][k] = value
        return state

    def read(state: object) -> np.ndarray:
        here[:3] = state[0].getX(), state[0].getY(), state[0].getYaw()
        for k in range(robot.n - n_p):
            here[n_p + k] = state[1][k]
        return here

    setup.setStateValidityChecker(lambda state: search.check.too_near(read(state)) < 0)
    ends = base.GoalStates(setup.getSpaceInformation())
    for goal in goals:
        ends.addState(written(goal, space.allocState()))
    setup.setStartState(written(start, space.allocState()))
    setup.setGoal(ends)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    setup.solve(SECONDS)
    if not setup.haveExactSolutionPath():
        raise nmm.RunError("OMPL found no path", where="plan")
    setup.simplifySolution()
    corners = [start, *(read(one).copy() for one in setup.getSolutionPath().getStates()[1:])]
    return finished(search, np.vstack([*legs(search, corners)]))


def legs(search: PlanSearch, corners: list[np.ndarray]) -> Iterator[np.ndarray]:
    """The legs through OMPL's states, the arm in proportion to the platform's way, as OMPL has it."""
    n_p = search.robot.platform.n_p
    for a, b in pairwise(corners):
        stays = b.copy()
        stays[n_p:] = a[n_p:]
        found = search.guide.way(a, stays)
        way = np.hypot(found[:, 0], found[:, 1])
        if way.sum() < 1e-9:
            yield search.guide.way(a, b)
            continue
        found = found.copy()
        found[:, 3 + n_p :] = np.outer(way / way.sum(), b[n_p:] - a[n_p:])
        yield found


def reacts(scene: Scene, seed: int) -> tuple[bool, float, float]:
    """Whether control that reacts gets there within 40 s, when, and the least distance on its way, m."""
    robot, frame = scene.robot, "arm_tool_link" if "arm_tool_link" in scene.robot.frames else "ur5_ee_link"
    task = scene.goal
    if not isinstance(task, nmm.Task):
        there = nmm.Configuration(robot, robot.q(scene.start | scene.goal)).placement(frame).translation
        task = nmm.Task(nmm.Position(frame), there)
    task = nmm.Task(task.function, task.reference, gain=1.0, speed=0.5)
    keeps = nmm.Collisions(DISTANCE, obstacles=scene.obstacles)
    controller = nmm.Controller(
        robot,
        task,
        nmm.ProjectedGradient(),
        nmm.Clearance(collisions=keeps),
        limits=LIMITS,
        collisions=keeps,
        dt=0.05,
        retreat=nmm.Retreat(),
    )
    run = nmm.simulate(controller, scene.start, 40.0, 0.05, "zoh", until=nmm.Goal(0.005))
    return bool(run.error_norm[-1] <= 0.005), float(run.t[-1]), float(run.clearance_between.min())


def row(who: str, kind: str, count: int, found: list[Measured]) -> None:
    if found:
        seconds, duration, way, turned, spare = np.array(found).T
        print(
            f"{kind:14}{who:10}{len(found):4}/{count:<4}{(spare > 0.0).sum():5}{(spare <= -DISTANCE).sum():6}"
            f"{np.median(seconds):9.3f}{seconds.max():8.2f}{np.median(duration):8.1f}{np.median(way):7.1f}"
            f"{np.median(turned):7.1f}",
            flush=True,
        )
    else:
        print(f"{kind:14}{who:10}   0/{count}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instances", type=int, nargs="?", default=20)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], default=[])
    parser.add_argument("--reacting", type=int, default=20, help="instances for control that reacts")
    given = parser.parse_args()
    planners = {"nmm": partial(partial, of_nmm), "prepared": of_planner}
    try:
        from ompl import util

        util.noOutputHandler()
        util.RNG.setSeed(given.seed + 1)
        planners["OMPL"] = partial(partial, of_ompl)
    except ImportError:
        print("OMPL is not installed (pip install ompl): its rows are left out")
    for plan in planners.values():  # what is compiled or loaded once is no part of a plan
        for kind in ("u_shaped_wall", "table"):
            plan(KINDS[kind](np.random.default_rng(0)), 0)()
    print(
        f"{'':24}{'found':8}{'free':>5}{'touch':>6}{'s median':>9}{'worst':>8}{'motion':>8}{'m':>7}{'rad':>7}"
    )
    for kind in given.kinds or SIX:
        for who, plan in planners.items():
            found = []
            for k in range(given.instances):
                scene = KINDS[kind](np.random.default_rng([given.seed, k]))
                try:
                    make = plan(scene, k)
                    begin = time.process_time()
                    made = make()
                except nmm.NmmError as error:
                    print(f"  {kind} {k}, {who}: {error}")
                    continue
                seconds = time.process_time() - begin
                found.append(measured(scene, made, seconds))
            row(who, kind, given.instances, found)
        if given.reacting:
            scenes = (KINDS[kind](np.random.default_rng([given.seed, k])) for k in range(given.reacting))
            there, when, least = zip(*(reacts(one, k) for k, one in enumerate(scenes)), strict=True)
            took = np.median([t for t, ok in zip(when, there, strict=True) if ok]) if any(there) else np.nan
            touched = sum(one < 0.0 for one in least)
            print(
                f"{kind:14}{'reacts':10}{sum(there):4}/{given.reacting:<4}{'':5}{touched:6}{'':17}{took:8.1f}"
            )


if __name__ == "__main__":
    main()
