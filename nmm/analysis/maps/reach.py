"""Where the arm puts a frame, for many postures at once, and postures that put it somewhere."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nmm.analysis.maps.coordinates import checked_range, usual_range
from nmm.base.arrays import Array, Flags, Integers
from nmm.base.cores import over_cores
from nmm.base.errors import expect, expect_known
from nmm.base.kernels.compiled import clear, compiled, compiled_without_gil, scratch, view
from nmm.base.kernels.kinematics import Kinematics, place_frames
from nmm.base.kernels.linear_algebra import eliminate
from nmm.base.kernels.record_layout import IntegerVector, Matrix, Vector, views
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.base.progress import Progress
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.robot import Robot

AXES = "xyz"
#: Newton steps onto a place, and the longest of them, rad or m: a stretched arm would leap.
STEPS, LEAP = 12, 0.5
#: Postures a compiled call: what nothing interrupts.
AT_ONCE = 128


class Plane(NamedTuple):
    """The plane to be reached, and the joints that reach it.

    axes (2,), third (1,) : which of x, y, z span the plane, and which does not
    slab (2,) : range of the third, m; -inf and inf where it is free
    moving, lower, upper (k,) : columns of q that are varied, and their ranges
    carried (n, k) : what a unit of each of them moves, mimic joints included
    mimic_joints (4 f,) : see `nmm.base.kernels.velocity_map`
    """

    axes: IntegerVector
    third: IntegerVector
    slab: Vector
    moving: IntegerVector
    lower: Vector
    upper: Vector
    carried: Matrix
    mimic_joints: Vector


@compiled
def rated(integers: Integers, floats: Array, plane: Plane, q: Array, point: Array, rates: Array) -> None:
    """Write the frame's position at q (n,) to point (3,), and rates (s, k) of its constrained coordinates."""
    kinematics = views(Kinematics, integers, floats, 0)
    n = q.shape[0]
    placement, J, none = scratch((1, 3, 4)), scratch((1, 6, n)), scratch((0, 6, n, n))
    clear(J)
    place_frames(kinematics.joints, kinematics.frames, q, placement, J, none)
    for i in range(3):
        point[i] = placement[0, i, 3]
    for i in range(rates.shape[0]):
        axis = plane.axes[i] if i < 2 else plane.third[0]
        for c in range(rates.shape[1]):
            rates[i, c] = 0.0
            for j in range(n):
                rates[i, c] += J[0, axis, j] * plane.carried[j, c]


@compiled
def shortest(rates: Array, wanted: Array, step: Array) -> None:
    """Writes step (k,): the shortest with rates (s, k) step ≈ wanted (s,), no longer than `LEAP`."""
    s, k = rates.shape
    system, ones = scratch((s, s + 1)), scratch(s)
    trace = 0.0
    for i in range(s):
        system[i, s], ones[i] = wanted[i], 1.0
        for j in range(s):
            system[i, j] = 0.0
            for c in range(k):
                system[i, j] += rates[i, c] * rates[j, c]
        trace += system[i, i]
    for i in range(s):
        system[i, i] += 1e-9 * trace + 1e-12
    eliminate(system, ones)
    length = 0.0
    for c in range(k):
        step[c] = 0.0
        for i in range(s):
            step[c] += rates[i, c] * system[i, s]
        length = max(length, abs(step[c]))
    if length > LEAP:
        for c in range(k):
            step[c] *= LEAP / length


@compiled
def advance(plane: Plane, q: Array, x: float, y: float, point: Array, rates: Array) -> None:
    """q (n,) a step nearer to (x, y), from where the frame is at `point` and moves by `rates`; in place."""
    s, k = rates.shape
    wanted, step = scratch(s), scratch(k)
    wanted[0], wanted[1] = x - point[plane.axes[0]], y - point[plane.axes[1]]
    if s > 2:
        # Somewhat inside: a step never ends quite where it aims.
        inset = 0.1 * (plane.slab[1] - plane.slab[0])
        height = point[plane.third[0]]
        wanted[2] = min(max(height, plane.slab[0] + inset), plane.slab[1] - inset) - height
    shortest(rates, wanted, step)
    stopped = False
    for c in range(k):
        ahead = q[plane.moving[c]] + step[c]
        if ahead < plane.lower[c] or ahead > plane.upper[c]:
            stopped = True
            for i in range(s):
                rates[i, c] = 0.0
    if stopped:  # the other joints compensate for those at their limits
        shortest(rates, wanted, step)
    for c in range(k):
        j = plane.moving[c]
        q[j] = min(max(q[j] + step[c], plane.lower[c]), plane.upper[c])
    place_mimic_joints(q, plane.mimic_joints)


@compiled_without_gil
def step_towards(integers: Integers, floats: Array, plane: Plane, q: Array, targets: Array) -> None:
    """Each of q (N, n) a step nearer to its target (N, 2), in place."""
    n, k = q.shape[1], plane.moving.shape[0]
    point, rates = scratch(3), scratch((2 if math.isinf(plane.slab[0]) else 3, k))
    for p in range(q.shape[0]):
        own = view(q, p * n, (n,))
        rated(integers, floats, plane, own, point, rates)
        advance(plane, own, targets[p, 0], targets[p, 1], point, rates)


@compiled_without_gil
def lead_onto(
    integers: Integers,
    floats: Array,
    plane: Plane,
    targets: Array,
    near: float,
    steps: int,
    q: Array,
    points: Array,
    left: Array,
) -> None:
    """Brings q (N, n), in place, nearest to targets (N, 2) within `steps` steps, or to within `near`.

    Writes points (N, 3), and left (N,), the distances: infinite where no step was in the slab.
    """
    n, k = q.shape[1], plane.moving.shape[0]
    posture, point, rates = scratch(n), scratch(3), scratch((2 if math.isinf(plane.slab[0]) else 3, k))
    for p in range(q.shape[0]):
        x, y = targets[p, 0], targets[p, 1]
        for j in range(n):
            posture[j] = q[p, j]
        left[p] = math.inf
        for i in range(3):
            points[p, i] = 0.0
        for taken in range(steps + 1):
            rated(integers, floats, plane, posture, point, rates)
            across, along = point[plane.axes[0]] - x, point[plane.axes[1]] - y
            apart = math.sqrt(across * across + along * along)
            height = point[plane.third[0]]
            if plane.slab[0] <= height <= plane.slab[1] and apart < left[p]:
                left[p] = apart
                for j in range(n):
                    q[p, j] = posture[j]
                for i in range(3):
                    points[p, i] = point[i]
            if taken == steps or not left[p] > near:
                break
            advance(plane, posture, x, y, point, rates)


class ArmReach:
    """The arm's joints over their limits, the platform at rest at q (n,).

    plane, slab : two of x, y, z; (lower, upper) of the third, m, or None
    moving, ranges : columns of q that are varied; (lower, upper) of joints, else the limits, at most one turn
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        plane: str,
        slab: tuple[float, float] | None,
        q: Array,
        moving: Integers,
        ranges: Mapping[str, Sequence[float]] | None,
    ) -> None:
        self.robot, self.frame, self.slab, self.q = robot, frame, slab, q
        self.in_plane = [AXES.index(axis) for axis in plane]
        (self.third,) = {0, 1, 2} - set(self.in_plane)
        self.moving = moving
        names = [robot.q_names[j] for j in moving]
        spans = dict(ranges or {})
        for name in spans:
            expect_known("joint", name, names, "ranges")
        limits = [checked_range(spans[name], name) if name in spans else self._usual(name) for name in names]
        self.lower, self.upper = np.ascontiguousarray(np.array(limits).reshape(-1, 2).T)
        who = robot.following
        self._path = FramePath(robot, frame)
        self._plane = Plane(
            axes=np.array(self.in_plane),
            third=np.array([self.third]),
            slab=np.array([-np.inf, np.inf] if slab is None else slab, dtype=np.float64),
            moving=np.ascontiguousarray(moving, dtype=np.int64),
            lower=self.lower,
            upper=self.upper,
            carried=np.ascontiguousarray(who.carried[:, np.searchsorted(who.independent, moving)]),
            mimic_joints=who.table.ravel(),
        )

    def _usual(self, name: str) -> tuple[float, float]:
        index = self.robot.coordinate(name)
        bounded = self.robot.q_units[index] != "m" or self.robot.limited[index].all()
        expect(bounded, "ranges", f"one for {name}, which has no limits")
        return usual_range(self.robot, name, self.q)

    def postures(self, count: int, seed: int = 2006) -> Array:
        """`count` (a power of 2) configurations (count, n), spread evenly over the joints' ranges (Sobol)."""
        # Here, as it takes a second to import: a map over coordinates does without.
        from scipy.stats import qmc

        unit = qmc.Sobol(len(self.moving), rng=seed).random(count)
        return self.placed(self.lower + unit * (self.upper - self.lower))

    def placed(self, joints: Array) -> Array:
        """Configurations (N, n) with these varied joints (N, k)."""
        q = np.tile(self.q, (len(joints), 1))
        q[:, self.moving] = joints
        return self.robot.following.placed(q)

    def positions(self, q: Array, progress: Progress | None = None) -> Array:
        """Where the frame is, (N, 3), m."""
        return self._path.positions(q, progress)

    def held(self, points: Array) -> Flags:
        """Whether each point (N, 3) is in the slab."""
        lower, upper = self._plane.slab
        return np.asarray((points[:, self.third] >= lower) & (points[:, self.third] <= upper))

    def towards(self, q: Array, targets: Array) -> Array:
        """Configurations (N, n) a Newton step nearer to targets (N, 2) in the plane, in ranges and slab."""
        moved = np.array(q, order="C")

        def step(first: int, last: int) -> None:
            step_towards(*self._path.blocks, self._plane, moved[first:last], targets[first:last])

        over_cores(len(q), AT_ONCE, lambda: step)
        return moved

    def onto(
        self, q: Array, targets: Array, near: float, progress: Progress | None = None
    ) -> tuple[Array, Array, Array]:
        """q (N, n) brought nearest to targets (N, 2) or within `near`, positions (N, 3), distances (N,), m.

        Where no step was in the slab, the distance is infinite and q as given.
        """
        best, points, left = np.array(q, order="C"), np.empty((len(q), 3)), np.empty(len(q))

        def lead(first: int, last: int) -> None:
            goals, *outputs = (each[first:last] for each in (targets, best, points, left))
            lead_onto(*self._path.blocks, self._plane, goals, near, STEPS, *outputs)

        over_cores(len(q), AT_ONCE, lambda: lead, progress)
        return best, points, left
