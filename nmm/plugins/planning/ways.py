"""How a platform gets from one configuration to another where nothing is in the way, compiled, as legs."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.record_layout import Cell, IntegerCell, IntegerVector, Vector
from nmm.model.platforms.steering import SteeredAxle, SteeringPivot
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.words import PARTS, dubins, reeds_shepp, wrapped

#: What a platform does: it stands, moves every way, rolls one way, to and fro or only forwards, or tows
#: trailers, whose ways are not legs (`nmm.plugins.planning.towing`).
STANDS, SLIDES, ROLLS, FORWARDS, TOWS = 0, 1, 2, 3, 4
#: Legs of one way at most: the parts of a word, and the steering before and after each.
LEGS = 2 * PARTS + 1
#: A platform that turns on the spot is driven along arcs of this radius, as a share of its size.
TURNING = 0.2
#: Of words whose length is below this, m and rad, nothing is driven.
SHORT = 1e-9


class Ways(NamedTuple):
    """What decides a platform's ways; lengths in m, angles in rad.

    kind () : STANDS, SLIDES, ROLLS, FORWARDS or TOWS; radius () : of its arcs
    rolling (3,) : where, in the platform's axes, a frame stands whose origin moves only along its x axis
    steering () : the coordinate that is the steering angle, or -1; wheelbase () : tan(angle) = wheelbase /
        radius
    speeds (3 + n,) : of each number of a leg, to weigh them; pause () : what a stop between legs takes, s
    turns, own_or_leader (n,) : see `Robot`
    """

    kind: IntegerCell
    radius: Cell
    rolling: Vector
    steering: IntegerCell
    wheelbase: Cell
    speeds: Vector
    pause: Cell
    turns: Vector
    own_or_leader: IntegerVector


@compiled
def leg_time(ways: Ways, leg: Array) -> float:
    """How long a leg takes without its pause, s; the arm's part counts a little more where it is not the
    longest."""
    longest = 0.0
    arm = 0.0
    for i in range(leg.shape[0]):
        time = abs(leg[i]) / ways.speeds[i]
        longest = max(longest, time)
        if i >= 3:
            arm += time
    return longest + 0.05 * arm


@compiled
def joint_way(ways: Ways, a: Array, b: Array, i: int) -> float:
    """How far coordinate i goes from a to b (n,), the short way round."""
    far = b[i] - a[i]
    if ways.turns[i] != 0.0:
        j = ways.own_or_leader[i]
        far -= 2.0 * math.pi * ways.turns[i] * math.floor(0.5 + (b[j] - a[j]) / (2.0 * math.pi))
    return far


@compiled
def least_time(ways: Ways, a: Array, b: Array) -> float:
    """No way from a to b takes less, s."""
    first = 3 if ways.kind[()] != STANDS else 0
    longest = math.hypot(b[0] - a[0], b[1] - a[1]) / ways.speeds[0] if first == 3 else 0.0
    for i in range(first, a.shape[0]):
        longest = max(longest, abs(joint_way(ways, a, b, i)) / ways.speeds[3 + i])
    return longest


@compiled
def add_leg(legs: Array, count: int, x: float, y: float, turn: float) -> int:
    """Write a leg that moves the platform; returns the number of legs."""
    clear(legs[count])
    legs[count, 0], legs[count, 1], legs[count, 2] = x, y, turn
    return count + 1


@compiled
def steer(ways: Ways, legs: Array, count: int, angle: Array, wanted: float) -> int:
    """Write a leg that turns the steering at rest, where it is not at that angle."""
    if abs(wanted - angle[0]) > SHORT:
        count = add_leg(legs, count, 0.0, 0.0, 0.0)
        legs[count - 1, 3 + ways.steering[()]] = wanted - angle[0]
        angle[0] = wanted
    return count


@compiled
def roll(ways: Ways, a: Array, b: Array, legs: Array) -> int:
    """Write the legs of the shortest word of arcs and lines; returns their number."""
    x, y, turned = ways.rolling[0], ways.rolling[1], ways.rolling[2]
    radius, steering = ways.radius[()], ways.steering[()]
    # Between the frames that roll, in radii: T⁻¹ (a⁻¹ b) T.
    ca, sa = math.cos(a[2]), math.sin(a[2])
    turn = b[2] - a[2]
    c, s = math.cos(turn), math.sin(turn)
    dx = ca * (b[0] - a[0]) + sa * (b[1] - a[1]) + c * x - s * y - x
    dy = -sa * (b[0] - a[0]) + ca * (b[1] - a[1]) + s * x + c * y - y
    cr, sr = math.cos(turned), math.sin(turned)
    word = scratch((PARTS, 2))
    u, v = (cr * dx + sr * dy) / radius, (cr * dy - sr * dx) / radius
    if ways.kind[()] == ROLLS:
        reeds_shepp(u, v, wrapped(turn), word)
    else:
        dubins(u, v, wrapped(turn), word)
    angle = scratch(1)
    angle[0] = a[steering] if steering >= 0 else 0.0
    count = 0
    for i in range(PARTS):
        if abs(word[i, 1]) <= SHORT:
            continue
        if steering >= 0:
            count = steer(ways, legs, count, angle, math.atan(word[i, 0] * ways.wheelbase[()] / radius))
        way, dt = word[i, 1] * radius, word[i, 0] * word[i, 1]
        # The velocity of the platform's own origin where the frame that rolls has (way, 0) and dt.
        count = add_leg(legs, count, way * cr + dt * y, way * sr - dt * x, dt)
    if steering >= 0:
        count = steer(ways, legs, count, angle, b[steering])
    return count


@compiled
def slide(a: Array, b: Array, legs: Array) -> int:
    """Write the leg of constant twist from a to b; returns 1, or 0 where the platform is there already."""
    turn = wrapped(b[2] - a[2])
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = c * (b[0] - a[0]) + s * (b[1] - a[1]), c * (b[1] - a[1]) - s * (b[0] - a[0])
    if abs(x) + abs(y) + abs(turn) <= SHORT:
        return 0
    if abs(turn) > SHORT:
        half = 0.5 * turn
        share = half / math.tan(half)
        x, y = share * x + half * y, share * y - half * x
    return add_leg(legs, 0, x, y, turn)


@compiled
def find_way(ways: Ways, a: Array, b: Array, legs: Array) -> int:
    """Write the legs (at most `LEGS` of 3 + n) from a to b (n,) and return their number. Joints move in all
    of them, in proportion to what the platform takes for each."""
    n, kind = a.shape[0], ways.kind[()]
    count = 0
    if kind == SLIDES:
        count = slide(a, b, legs)
    elif kind != STANDS:
        count = roll(ways, a, b, legs)
    first = 0 if kind == STANDS else (3 if ways.steering[()] < 0 else 4)
    moves = False
    for i in range(first, n):
        moves = moves or abs(joint_way(ways, a, b, i)) > SHORT
    if not moves:
        return count
    total = 0.0
    for k in range(count):
        total += leg_time(ways, legs[k])
    if total == 0.0:
        count = add_leg(legs, count, 0.0, 0.0, 0.0)
    for k in range(count):
        share = leg_time(ways, legs[k]) / total if total > 0.0 else 1.0
        for i in range(first, n):
            legs[k, 3 + i] = share * joint_way(ways, a, b, i)
    return count


@compiled
def way_time(ways: Ways, legs: Array, count: int) -> float:
    """What a way takes, s."""
    total = 0.0
    for k in range(count):
        total += leg_time(ways, legs[k]) + ways.pause[()]
    return total


def ways_of(
    robot: Robot,
    speeds: Array,
    pause: float,
    reverses: bool,
    limits: Array | None = None,
    within: Array | None = None,
) -> Ways:
    """The ways of a robot's platform, and of its joints within limits (n, 2); within (n, 2) : with its own.

    Raises
    ------
    InputError : a platform whose ways are not known (wheels that steer on their own), a car that cannot steer
        straight on
    """
    steers = robot.q_limits if within is None else within
    widest = tuple(steers[3].tolist()) if robot.platform.n_p == 4 else (0.0, 0.0)
    kind, radius, rolling, steering, wheelbase = _of_platform(robot, reverses, within is None, *widest)
    return Ways(
        kind=np.array(kind, dtype=np.int64),
        radius=np.array(radius),
        rolling=rolling.copy(),
        steering=np.array(steering, dtype=np.int64),
        wheelbase=np.array(wheelbase),
        speeds=speeds,
        pause=np.array(pause),
        turns=robot.turns(limits),
        own_or_leader=robot.own_or_leader.copy(),
    )


@lru_cache(maxsize=8)
def _of_platform(
    robot: Robot, reverses: bool, of_file: bool, right: float, left: float
) -> tuple[int, float, Array, int, float]:
    """Kind, radius, rolling, steering and wheelbase of a robot's `Ways`; a car's steering angle is within
    [right, left], rad; of_file : whether these are the robot's own."""
    platform = robot.platform
    kind, radius, rolling, steering, wheelbase = STANDS, 1.0, np.zeros(3), -1, 0.0
    if platform.n_p >= 3:
        kind = ROLLS if reverses else FORWARDS
        G = platform.G(np.zeros(platform.n_p))[:3]
        twists, axle = np.linalg.matrix_rank(G, tol=1e-9), platform.steered_axle("theta")
        # What no twist has, a vx + b vy + c ω = 0: (a, b) is across the direction in which it rolls.
        across = np.linalg.svd(G)[0][:, 2]
        size = float(np.hypot(*across[:2]))
        if isinstance(platform, Tractor):
            kind = TOWS
        elif platform.n_p == 3 and twists == 3:
            kind = SLIDES
        elif platform.n_p == 3 and twists == 2 and size > 1e-9:
            ahead = np.array([across[1], -across[0]]) / size
            point = across[2] / size * ahead
            ahead *= -1.0 if ahead[0] < 0.0 else 1.0
            rolling = np.array([*point, np.arctan2(ahead[1], ahead[0])])
            radius = TURNING * size_of(robot)
        elif platform.n_p == 4 and axle is not None and _plain(axle):
            rolling = np.array([axle.x, axle.y, axle.heading])
            steering, wheelbase = 3, axle.pivots[0].x
            if not right < 0.0 < left:
                raise InputError(
                    where=f"{robot.name if of_file else 'plan: limits'}: {robot.q_names[3]}",
                    expected="[lower, upper] about 0",
                    got=[right, left],
                )
            widest = min(min(-right, left), axle.pivots[0].widest)
            radius = axle.least_radius(((-widest, widest),))
        else:
            raise InputError(
                f"no ways from pose to pose are known for the platform {platform.name}",
                where=robot.name,
                expected="one that stands, moves every way, turns on the spot, steers one axle as a car "
                "or is a tractor",
            )
    return kind, radius, rolling, steering, wheelbase


def _plain(axle: SteeredAxle) -> bool:
    """Whether one angle steers the axle as a car's does: tan(angle) = wheelbase × curvature."""
    return len(axle.pivots) == 1 and axle.pivots[0] == SteeringPivot(
        axle.pivots[0].coordinate, axle.pivots[0].input, axle.pivots[0].x, widest=axle.pivots[0].widest
    )


def size_of(robot: Robot) -> float:
    """How far the robot's root link reaches to the side, m, by its collision shapes; a tenth of its reach
    without any."""
    far = 0.0
    for shape in robot.collision_model.geometryObjects:
        if robot.model.joints[shape.parentJoint].idx_q == 2:
            shape.geometry.computeLocalAABB()
            box = shape.geometry.aabb_local
            corner = np.maximum(np.abs(box.min_), np.abs(box.max_))
            far = max(far, float(np.linalg.norm((np.abs(shape.placement.rotation) @ corner)[:2])))
    return far or 0.1 * robot.reach
