"""A UR5 on a wheeled base reaches over a table, by nmm and by Pink, on the same shapes and pairs:

    python benchmarks/peers.py

Both follow the same point: 6 s along a line over the table, then it stands, 12 s in all, dt 0.02 s; gain
1.5 1/s, base and joints no faster than 1 m/s, 1 rad/s and 1.5 rad/s, distance 0.03 m, all distances by Coal
between the same convex shapes; both hold their inputs over a sample. Pink has no rolling constraint of its
own: once its base goes sideways as it likes, once the constraint is a row that is written anew at each step
(a strict `LinearHolonomicTask`). Its barrier takes all pairs, or the 20 nearest; gain 4 1/s as nmm's, the
gain of its safe displacement 0, and 1, its default; a posture task of 1e-3. The least
distance is measured afterwards in the same way for all: ten looks a sample along the way that held inputs
make. A step's time is the median over the run, shapes placed and distances measured included.

Pink is optional (`pip install pin-pink daqp`); a peer that is missing is skipped.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import nmm

UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
TIP = "ur5_tool0"
START = {
    "ur5_shoulder_pan_joint": 0.0,
    "ur5_shoulder_lift_joint": -1.2,
    "ur5_elbow_joint": 1.5,
    "ur5_wrist_1_joint": -1.87,
    "ur5_wrist_2_joint": -np.pi / 2,
}
#: The second is lower, and nearer to the table's edge.
GOALS = {"one goal": np.array([1.9, 0.35, 0.8]), "a lower one": np.array([2.0, 0.35, 0.75])}
TABLE = nmm.Obstacle(nmm.Box([0.8, 1.6, 0.6]), [1.9, 0.3, 0.3], name="table")
DT, DURATION, MOVES, GAIN, DISTANCE = 0.02, 12.0, 6.0, 1.5, 0.03
LOOKS = 10


class Found(NamedTuple):
    """What is left of the error, m; the least distance, m; µs a step; the fastest sideways, m/s."""

    left: float
    least: float
    step: float
    sideways: float


def the_robot() -> tuple[nmm.Robot, np.ndarray]:
    """The robot, and where it starts."""
    base = nmm.load("differential_base", platform="unicycle")
    robot = nmm.mount(base, UR5, at="arm_mount", prefix="ur5_")
    return robot, robot.q(START)


def target(t: float, first: np.ndarray, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the tip is to be at t, and its velocity."""
    share = min(t / MOVES, 1.0)
    return first + share * (goal - first), (goal - first) / MOVES * (t < MOVES)


class Distances:
    """Least distances by Pinocchio's loop over the pairs that nmm keeps apart."""

    def __init__(self, robot: nmm.Robot) -> None:
        self.model = robot.model
        self.shapes = nmm.Collisions(DISTANCE, obstacles=[TABLE]).on(robot).queries.shapes
        self.data, self.found = robot.model.createData(), pin.GeometryData(self.shapes)
        for request in self.found.distanceRequests:
            request.gjk_tolerance = 1e-8

    def least(self, q: np.ndarray) -> float:
        """The least distance, m."""
        k = pin.computeDistances(self.model, self.data, self.shapes, self.found, q)
        return float(self.found.distanceResults[k].min_distance)


def driven(
    robot: nmm.Robot,
    q: np.ndarray,
    goal: np.ndarray,
    decide: Callable[[float, np.ndarray], np.ndarray],
    map_: Any,
) -> Found:
    """Run a controller; map_(q) (n, inputs) says what its inputs move."""
    apart, least, times, sideways = Distances(robot), np.inf, [], 0.0
    for k in range(int(DURATION / DT)):
        began = time.perf_counter()
        u = decide(k * DT, q)
        times.append(time.perf_counter() - began)
        v = map_(q) @ u
        sideways = max(sideways, abs(-np.sin(q[2]) * v[0] + np.cos(q[2]) * v[1]))
        for _ in range(LOOKS):
            h = DT / LOOKS
            q = q + h * (map_(q + 0.5 * h * (map_(q) @ u)) @ u)
            least = min(least, apart.least(q))
    left = np.linalg.norm(nmm.Configuration(robot, q).placement(TIP).translation - goal)
    return Found(float(left), least, statistics.median(times) * 1e6, float(sideways))


def ours(goal: np.ndarray, *, avoids: bool = True) -> Found:
    """nmm, with distances and without."""
    robot, q = the_robot()
    first = nmm.Configuration(robot, q).placement(TIP).translation.copy()
    reference = nmm.Line(first, goal, duration=MOVES)
    controller = nmm.Controller(
        robot,
        nmm.Task(nmm.Position(TIP), reference, gain=GAIN),
        nmm.ProjectedGradient(),
        limits=nmm.Limits({"platform": 1.0, "arm": 1.5}, position=False),
        collisions=nmm.Collisions(DISTANCE, obstacles=[TABLE]) if avoids else None,
        dt=DT,
    )
    return driven(robot, q, goal, controller, robot.S)


def pink_s(goal: np.ndarray, pairs: int | None, *, rolls: bool, cautious: float = 0.0) -> Found:
    """Pink, with all pairs or the nearest, its base rolling or free to go sideways."""
    import pink
    from pink.barriers import SelfCollisionBarrier
    from pink.limits import VelocityLimit
    from pink.tasks import FrameTask, LinearHolonomicTask, PostureTask

    robot, q = the_robot()
    model = robot.model
    fastest = np.full(model.nv, 1.5)
    fastest[:3] = 1.0
    model.velocityLimit = fastest
    shapes = Distances(robot).shapes
    found = pin.GeometryData(shapes)
    configuration = pink.Configuration(
        model, model.createData(), q, collision_model=shapes, collision_data=found
    )
    tip = FrameTask(TIP, position_cost=1.0, orientation_cost=0.0, gain=GAIN * DT)
    posture = PostureTask(cost=1e-3, gain=GAIN * DT)
    posture.set_target(q)
    tip.set_target(configuration.get_transform_frame_to_world(TIP))
    barrier = SelfCollisionBarrier(
        len(shapes.collisionPairs) if pairs is None else pairs,
        gain=4.0,
        safe_displacement_gain=cautious,
        d_min=DISTANCE,
    )
    first = configuration.get_transform_frame_to_world(TIP).translation.copy()
    limits = [VelocityLimit(model)]

    def decide(t: float, now: np.ndarray) -> np.ndarray:
        configuration.update(now)
        where, velocity = target(t, first, goal)
        # Without a velocity fed forward it is told a point ahead, so that it does not lag.
        tip.transform_target_to_world.translation = where + velocity / GAIN
        rows = None
        if rolls:
            A = np.zeros((1, model.nv))
            A[0, :2] = -np.sin(now[2]), np.cos(now[2])
            rows = [LinearHolonomicTask(A, np.zeros(1), now.copy())]
        v = pink.solve_ik(
            *(configuration, [tip, posture], DT, "daqp"),
            limits=limits,
            barriers=[barrier],
            constraints=rows,
            safety_break=False,
        )
        if not rolls:
            return v
        forward = np.cos(now[2]) * v[0] + np.sin(now[2]) * v[1]
        return np.concatenate([[forward], v[2:]])

    if rolls:
        return driven(robot, q, goal, decide, robot.S)
    return driven(robot, q, goal, decide, lambda q: np.eye(len(q)))


def main() -> None:
    """Print the table."""
    cases: dict[str, Callable[[np.ndarray], Found]] = {
        "nmm": ours,
        "nmm, nothing kept": lambda goal: ours(goal, avoids=False),
        "Pink, all pairs, sideways": lambda goal: pink_s(goal, None, rolls=False),
        "Pink, all pairs, rolling row": lambda goal: pink_s(goal, None, rolls=True),
        "Pink, 20 pairs, rolling row": lambda goal: pink_s(goal, 20, rolls=True),
        "Pink, 20, safe displacement 1": lambda goal: pink_s(goal, 20, rolls=True, cautious=1.0),
    }
    for what, goal in GOALS.items():
        print(f"{what:30}{'left, mm':>10}{'least, mm':>11}{'µs a step':>11}{'sideways, m/s':>15}")
        for name, run in cases.items():
            try:
                found = run(goal)
            except ImportError as error:
                print(f"{name:30}  skipped: {error}")
                continue
            except Exception as error:  # a peer's own: no answer is an answer, too
                print(f"{name:30}  ended: {type(error).__name__}: {str(error)[:80]}")
                continue
            print(
                f"{name:30}{1e3 * found.left:10.1f}{1e3 * found.least:11.2f}{found.step:11.0f}"
                f"{found.sideways:15.3f}"
            )


if __name__ == "__main__":
    main()
