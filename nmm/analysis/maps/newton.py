"""Newton's steps that bring a frame onto places of a plane, for many postures in one compiled call."""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import clear, compiled, compiled_without_gil, scratch, view
from nmm.kernels.followers import place_followers
from nmm.kernels.kinematics import Kinematics, place_frames
from nmm.kernels.linear_algebra import eliminate
from nmm.kernels.memory import IntegerVector, Matrix, Vector, views

#: The longest step, rad or m: a stretched arm would leap.
LEAP = 0.5


class Plane(NamedTuple):
    """What is to be reached, and with which joints.

    axes (2,), third (1,) : of x, y, z, which are in the plane, and which is not
    slab (2,) : the third's lowest and highest, m; -inf and inf where it is free
    moving (k,), lower (k,), upper (k,) : columns of q that are varied, and their ranges
    carried (n, k) : what a unit of each of them moves, followers included
    followers (4 f,) : see `nmm.kernels.followers`
    """

    axes: IntegerVector
    third: IntegerVector
    slab: Vector
    moving: IntegerVector
    lower: Vector
    upper: Vector
    carried: Matrix
    followers: Vector


@compiled
def rated(integers: Integers, floats: Array, plane: Plane, q: Array, point: Array, rates: Array) -> None:
    """point (3,): where the one frame is at q (n,); rates (s, k): the derivatives of what counts of that."""
    here = views(Kinematics, integers, floats, 0)
    n = q.shape[0]
    placement, J, none = scratch((1, 3, 4)), scratch((1, 6, n)), scratch((0, 6, n, n))
    clear(J)
    place_frames(here.joints, here.frames, q, placement, J, none)
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
    """step (k,): the shortest with rates (s, k) step = wanted (s,), all but; no longer than `LEAP`."""
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
    if stopped:  # the other joints do what a joint at its limit cannot
        shortest(rates, wanted, step)
    for c in range(k):
        j = plane.moving[c]
        q[j] = min(max(q[j] + step[c], plane.lower[c]), plane.upper[c])
    place_followers(q, plane.followers)


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
    """Each of q (N, n) to where `steps` steps bring the frame nearest to its target (N, 2), in place.

    points (N, 3), left (N,) : where that is, and how far from the target, infinite where none was in the slab
    near : so near is there
    """
    n, k = q.shape[1], plane.moving.shape[0]
    here, point, rates = scratch(n), scratch(3), scratch((2 if math.isinf(plane.slab[0]) else 3, k))
    for p in range(q.shape[0]):
        x, y = targets[p, 0], targets[p, 1]
        for j in range(n):
            here[j] = q[p, j]
        left[p] = math.inf
        for i in range(3):
            points[p, i] = 0.0
        for taken in range(steps + 1):
            rated(integers, floats, plane, here, point, rates)
            across, along = point[plane.axes[0]] - x, point[plane.axes[1]] - y
            apart = math.sqrt(across * across + along * along)
            height = point[plane.third[0]]
            if plane.slab[0] <= height <= plane.slab[1] and apart < left[p]:
                left[p] = apart
                for j in range(n):
                    q[p, j] = here[j]
                for i in range(3):
                    points[p, i] = point[i]
            if taken == steps or not left[p] > near:
                break
            advance(plane, here, x, y, point, rates)
