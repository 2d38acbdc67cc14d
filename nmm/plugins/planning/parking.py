"""Laws that bring a platform on wheels to a pose: a turning one in polar coordinates, a car along words."""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array, scalar
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import compiled, kernel, scratch
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Row, Stage
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.ways import ROLLS, Ways, ways_of
from nmm.plugins.planning.words import PARTS, reeds_shepp, wrapped

#: Where numbers begin: whether memory stands, the goal, the frame that rolls, what is near enough, ...
STANDS, GOAL, ROLLING, WITHIN = 0, 1, 4, 7
#: ... of a car its steering, the radius of words, the largest curvature; what it remembers: parts of the word
#: (0: none), the present one, where that begins, turns, lengths.
STEERING, WHEELBASE, RADIUS, MOST, COUNT, PART, BASE, TURNS, LENGTHS = (
    8,
    9,
    10,
    11,
    12,
    13,
    14,
    17,
    17 + PARTS,
)
SIZE = LENGTHS + PARTS
#: A turning platform's rate of turning, and the pull towards the goal's heading, of Aicardi's law.
TURNING, PULL = 3.0, 1.0
#: A car that is e and θ off its word, ℓ before the end, has the curvature -A e / ℓ² - B θ / ℓ more; e falls
#: as ℓ³ and ℓ⁴.
A, B = 12.0, 6.0
#: ℓ is at most so many radii.
LONGEST = 2.0
#: Where that is more than so many times the word's own curvature, there is a new word.
GIVES_UP = 2.0
#: Words are of arcs so many times a car's least radius; between arcs it steers up to this share of its least.
WIDER, SHARPEST = 1.3, 0.97
#: Where it steers anew, it arrives as slowly as so many radii before a goal.
BEYOND = 0.1
#: A car's steering has so many times the gain; while it is off by this angle, rad, the car stands.
STEERS, OFF = 4.0, 0.1
#: How far the goal is, is told up to so many times what is driven.
TELLS = 20.0


@compiled
def place(q: Array, numbers: Array, pose: Array, goal: Array) -> tuple[float, float]:
    """Write the poses of the frame that rolls; returns where it is from the platform's origin, world axes."""
    x, y, turned = numbers[ROLLING], numbers[ROLLING + 1], numbers[ROLLING + 2]
    c, s = math.cos(numbers[GOAL + 2]), math.sin(numbers[GOAL + 2])
    goal[0], goal[1] = numbers[GOAL] + c * x - s * y, numbers[GOAL + 1] + s * x + c * y
    c, s = math.cos(q[2]), math.sin(q[2])
    arm_x, arm_y = c * x - s * y, s * x + c * y
    pose[0], pose[1], pose[2] = q[0] + arm_x, q[1] + arm_y, q[2] + turned
    goal[2] = numbers[GOAL + 2] + turned
    return arm_x, arm_y


@compiled
def write_way(rows: Rows, q: Array, numbers: Array, wanted: float, least: float) -> None:
    """The first row: gain K drives K × wanted along the way, m, and the error is how far the goal is."""
    apart = math.hypot(q[0] - numbers[GOAL], q[1] - numbers[GOAL + 1])
    far = max(apart, abs(wrapped(q[2] - numbers[GOAL + 2])), least)
    factor = min(max(far / abs(wanted), 1.0), TELLS) if wanted != 0.0 else 1.0
    rows.value[0] = -factor * wanted
    for k in range(3):
        rows.value_q[0, k] *= factor


@kernel(FUNCTION)
def park_turning(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The law in polar coordinates: v = K e cos α, ω = K (TURNING α + cos α sin α / α (α + PULL θ)), e and α
    the distance and bearing of the goal, θ its bearing from its own axis; within `within` it only turns."""
    pose, goal = scratch(3), scratch(3)
    arm_x, arm_y = place(at.q, numbers, pose, goal)
    x, y = goal[0] - pose[0], goal[1] - pose[1]
    ahead, turn, distance = 0.0, wrapped(goal[2] - pose[2]), math.hypot(x, y)
    if distance > numbers[WITHIN]:
        bearing = math.atan2(y, x)
        alpha, theta = wrapped(bearing - pose[2]), wrapped(bearing - goal[2])
        slope = math.sin(alpha) / alpha if alpha != 0.0 else 1.0
        ahead = distance * math.cos(alpha)
        turn = alpha + math.cos(alpha) * slope * (alpha + PULL * theta) / TURNING
    c, s = math.cos(pose[2]), math.sin(pose[2])
    rows.value_q[0, 0], rows.value_q[0, 1], rows.value_q[0, 2] = c, s, s * arm_x - c * arm_y
    write_way(rows, at.q, numbers, ahead, 0.0)
    rows.value[1], rows.value_q[1, 2] = -turn, 1.0 / TURNING


@compiled
def new_word(numbers: Array, pose: Array, goal: Array) -> None:
    """Remember the shortest word from the pose to the goal."""
    radius, word = numbers[RADIUS], scratch((PARTS, 2))
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = (goal[0] - pose[0]) / radius, (goal[1] - pose[1]) / radius
    reeds_shepp(c * x + s * y, c * y - s * x, wrapped(goal[2] - pose[2]), word)
    count = 0
    for i in range(PARTS):
        if word[i, 1] != 0.0 or (i == PARTS - 1 and count == 0):
            numbers[TURNS + count], numbers[LENGTHS + count] = word[i, 0], radius * word[i, 1]
            count += 1
    numbers[COUNT], numbers[PART] = count, 0.0
    for k in range(3):
        numbers[BASE + k] = pose[k]


@compiled
def next_part(numbers: Array) -> None:
    """Begin the next part where the present one ends."""
    i = int(numbers[PART])
    length = numbers[LENGTHS + i]
    half = 0.5 * length * numbers[TURNS + i] / numbers[RADIUS]
    chord = length * (math.sin(half) / half if half != 0.0 else 1.0)
    numbers[BASE] += chord * math.cos(numbers[BASE + 2] + half)
    numbers[BASE + 1] += chord * math.sin(numbers[BASE + 2] + half)
    numbers[BASE + 2] += 2.0 * half
    numbers[PART] += 1.0


@compiled
def beside(numbers: Array, pose: Array, off: Array) -> None:
    """off = [how far along the present part, to its left, turned off it]."""
    i = int(numbers[PART])
    c, s = math.cos(numbers[BASE + 2]), math.sin(numbers[BASE + 2])
    x, y, turn = pose[0] - numbers[BASE], pose[1] - numbers[BASE + 1], pose[2] - numbers[BASE + 2]
    off[0], off[1], off[2] = c * x + s * y, c * y - s * x, turn
    if numbers[TURNS + i] != 0.0:
        side, radius = numbers[TURNS + i], numbers[RADIUS] / numbers[TURNS + i]
        along, across = side * off[0], side * (radius - off[1])
        angle = math.atan2(along, across)
        angle += 2.0 * math.pi * math.floor(0.5 + (turn - angle) / (2.0 * math.pi))
        off[0], off[1], off[2] = radius * angle, radius - side * math.hypot(along, across), turn - angle


@compiled
def ahead_of(numbers: Array, along: float) -> tuple[float, float, float]:
    """The direction of the present part, what is left until the car steers anew, and what is left then, m."""
    first, count = int(numbers[PART]), int(numbers[COUNT])
    way = -1.0 if numbers[LENGTHS + first] < 0.0 else 1.0
    run, rest = -way * along, 0.0
    for i in range(first, count):
        length = numbers[LENGTHS + i]
        if rest == 0.0 and way * length >= 0.0 and numbers[TURNS + i] == numbers[TURNS + first]:
            run += abs(length)
        else:
            rest += abs(length)
    return way, run, rest


@kernel(FUNCTION)
def park_car(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The law that follows a word, which it remembers; the second row is the steering's, whose angle is that
    of the word's curvature and of what leads back to the word."""
    pose, goal, off = scratch(3), scratch(3), scratch(3)
    arm_x, arm_y = place(at.q, numbers, pose, goal)
    radius, within, most = numbers[RADIUS], numbers[WITHIN], numbers[MOST]
    way, run, rest, ell, own, more = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for attempt in range(2):
        if numbers[COUNT] == 0.0:
            new_word(numbers, pose, goal)
        beside(numbers, pose, off)
        while numbers[STANDS] == 0.0 and numbers[PART] < numbers[COUNT] - 1.0:
            length = numbers[LENGTHS + int(numbers[PART])]
            if abs(length) > (off[0] if length > 0.0 else -off[0]):
                break
            next_part(numbers)
            beside(numbers, pose, off)
        way, run, rest = ahead_of(numbers, off[0])
        if rest == 0.0 and run < 0.0:  # beyond the goal
            way = -way
        ell = min(max(abs(run + rest), math.sqrt(A * within * radius)), LONGEST * radius)
        own = numbers[TURNS + int(numbers[PART])] / radius
        more = -A * off[1] / (ell * ell) - B * way * off[2] / ell
        missed = rest == 0.0 and abs(run) < within and max(abs(off[1]), abs(off[2])) > within
        lost = missed or abs(more) > GIVES_UP / radius or abs(own * off[1]) > 0.5
        if attempt == 1 or not lost or numbers[STANDS] == 1.0:
            break
        numbers[COUNT] = 0.0
    steering, wheelbase = int(numbers[STEERING]), numbers[WHEELBASE]
    bent = min(max(own + more, -most), most)
    # At its widest the angle follows the word no further: limits would stop the car with it.
    follows = bent == own + more and abs(math.tan(at.q[steering])) < wheelbase * most
    tangent = pose[2] - off[2]
    c, s = math.cos(tangent), math.sin(tangent)
    for k in range(3):
        x, y = (-arm_y, arm_x) if k == 2 else ((1.0, 0.0) if k == 0 else (0.0, 1.0))
        along, left = (c * x + s * y) / (1.0 - own * off[1]), c * y - s * x
        turn = (1.0 if k == 2 else 0.0) - own * along
        bends = -A * left / (ell * ell) - B * way * turn / ell
        if ell == abs(run + rest):
            bends -= (2.0 * A * off[1] / ell + B * way * off[2]) / (ell * ell) * way * along
        rows.value_q[0, k] = along
        if follows:
            rows.value_q[1, k] = -wheelbase * bends / (1.0 + (wheelbase * bent) ** 2) / STEERS
    rows.value[1] = at.q[steering] - math.atan(wheelbase * bent)
    rows.value_q[1, steering] = 1.0 / STEERS
    wanted = abs(run)
    if rest > 0.0:
        short = 0.5 * abs(numbers[LENGTHS + int(numbers[PART])])
        wanted = max(run, 0.0) + min(BEYOND * radius, max(short, within))
    share = max(0.0, 1.0 - abs(rows.value[1]) / OFF)
    write_way(rows, at.q, numbers, way * share * wanted, share * (wanted + rest))


class Parking(Function):
    """A feedback law that brings a platform on wheels, of a unicycle's or a car's kind, to a pose (x, y, θ).

    No smooth feedback of x, y and θ does (R. W. Brockett 1983). Two rows that the platform drives:

    - One that turns on the spot is driven in polar coordinates (M. Aicardi, G. Casalino, A. Bicchi,
      A. Balestrino 1995), v = K e cos α: the distance e falls, and the goal is approached along its axis.
    - A car follows the shortest word of arcs and lines to and fro (J. A. Reeds, L. A. Shepp 1990), which it
      remembers from sample to sample; where it cannot come back to it, there is a new one.

    The reference is [0, 0]. The error's rows are the way to go, m, and the angle to turn or to steer, rad.
    Either may be 0 on the way, but not both: with one tolerance for both, of 2 to 10 × `within`, the pose is
    reached to it in m and rad. The rows of J are velocities, scaled, and no derivatives of the error, which
    may grow on the way. Obstacles are not looked at: `nmm.plan` does.

    Parameters
    ----------
    x, y, theta : the pose of the platform, m and rad
    within : m and rad at which the platform rests: ten times the noise of a measured pose

    Raises
    ------
    InputError : a platform that can move sideways, stands, or has other ways; `within` is not above 0

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Parking(0.0, 1.0, 0.0), [0, 0], gain=2.0)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=nmm.Limits())
    >>> run = nmm.simulate(controller, robot.rest, 20, 0.02, "zoh", until=nmm.Goal(0.001, 0.001))
    >>> run.complete, bool(abs(run.q[-1, :3] - [0, 1, 0]).max() < 0.001)
    (True, True)
    """

    def __init__(self, x: float = 0.0, y: float = 0.0, theta: float = 0.0, within: float = 0.0005) -> None:
        coordinates = (("x", x), ("y", y), ("theta", theta))
        self.x, self.y, self.theta = (scalar(value, f"parking: {name}") for name, value in coordinates)
        self.within = scalar(within, "parking: within", above=0.0)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        steers = int(self._ways(robot).steering) >= 0
        return Row("parking.way", "m"), Row(f"parking.{'steering' if steers else 'turning'}", "rad")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        ways = self._ways(robot)
        numbers = np.zeros(SIZE)
        numbers[GOAL : GOAL + 3] = self.x, self.y, self.theta
        numbers[ROLLING : ROLLING + 3], numbers[WITHIN] = ways.rolling, self.within
        if int(ways.steering) < 0:
            return (Stage(park_turning, 2, numbers=numbers),)
        numbers[STEERING], numbers[WHEELBASE] = ways.steering, ways.wheelbase
        numbers[RADIUS], numbers[MOST] = WIDER * ways.radius, SHARPEST / ways.radius
        return (Stage(park_car, 2, numbers=numbers, remembers=True),)

    def _ways(self, robot: Robot) -> Ways:
        ways = ways_of(robot, np.ones(3 + robot.n), 0.0, True)
        if int(ways.kind) != ROLLS:
            raise InputError(
                where="parking",
                expected="wheels that cannot move sideways (a posture of x, y, theta does for others)",
                got=robot.platform.name,
            )
        return ways
