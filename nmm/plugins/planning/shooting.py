"""Motions of samples within all limits, as a problem of multiple shooting, compiled: what it asks for.

The unknowns are q and u at the samples' ends and the constant rate a = du/dt within each; gaps between the
samples close while it is solved (`nmm.plugins.planning.interior`).
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, clear, compiled, compiled_without_gil, scratch, view
from nmm.base.kernels.kinematics import axes, place_joints
from nmm.base.kernels.record_layout import (
    BLOCKS,
    Cell,
    IntegerCell,
    IntegerVector,
    Matrices,
    Matrix,
    Vector,
    views,
)
from nmm.base.kernels.signatures import int64
from nmm.model.robots.wheel_rates import rolling
from nmm.model.robots.zero_order_hold import Inputs
from nmm.plugins.planning.collisions.legs_check import (
    MovedShapes,
    begin_motion,
    look,
    place_shape,
    placed_bound,
    write_approach,
)
from nmm.plugins.planning.samples import flow, write_fastest

#: Distances are looked at within this beyond those to keep, m.
NEAR = 0.08
#: The least slack to begin with.
SLACK = 1e-2


class Shooting(NamedTuple):
    """N samples of n coordinates and m inputs, B bounds of one number each, w wheels, P pairs of shapes.

    inputs : what they move; step (), substeps () : of each sample, s
    column (B,), sign (B,), offset (B,) : bounds offset + sign [q u a][column] ≥ 0
    wheels (w, 9), spin (w,) : see `nmm.model.robots.wheel_rates`, and the largest rates, rad/s
    weights (2 m,) : of u and a; goal (n,), ends (n + m,) : weights of the end's error in q and u, 0 where it
        is free
    aims (N + 1, e, n), aimed (N + 1, e), pull (N + 1, e) : the motion costs pull (aims q - aimed)² / 2
    movers (M,), tracks (N + 1, M, 12) : shapes that move, and where they are at each sample's beginning
    drift (N, P) : how far the obstacle of a pair moves in each sample at most, m
    room (P,), margin (N + 1,) : what each pair and each sample's beginning keep beyond the distance at most
    loose () : distances that lack no more than this are good enough, m
    q (N + 1, n), u (N + 1, m), a (N, m) : the motion; moves (N + 1, n + 2 m) : what a round changes of it
    gaps (N, n), D (N, n, n + 2 m) : where a sample leads less the next one's beginning, and its derivative
    c, s, z, ds, dz (N + 1, R) : the R = B + 2 w + P constraints of each sample's beginning; c is infinite for
        pairs that are far apart; rows (N + 1, 2 w + P, n + m) : derivatives of the last
    K (N, m, n + m + 1) : changes of a by those of q and u, and alone
    V (n + m, n + m + 1), Q (n + 2 m, n + 2 m + 1), W (n + m, n + 2 m) : while it solves
    duals (n + m,) : multipliers of the end; mu () : of the interior
    """

    inputs: Inputs
    step: Cell
    substeps: IntegerCell
    column: IntegerVector
    sign: Vector
    offset: Vector
    wheels: Matrix
    spin: Vector
    weights: Vector
    goal: Vector
    ends: Vector
    aims: Matrices
    aimed: Matrix
    pull: Matrix
    movers: IntegerVector
    tracks: Matrices
    drift: Matrix
    room: Vector
    margin: Vector
    loose: Cell
    q: Matrix
    u: Matrix
    a: Matrix
    moves: Matrix
    gaps: Matrix
    D: Matrices
    c: Matrix
    s: Matrix
    z: Matrix
    ds: Matrix
    dz: Matrix
    rows: Matrices
    K: Matrices
    V: Matrix
    Q: Matrix
    W: Matrix
    duals: Vector
    mu: Cell


@compiled
def place_movers(scene: MovedShapes, x: Shooting, k: int, share: float) -> None:
    """Put the obstacles that move where they are at a share of sample k; turned as at its beginning."""
    for i in range(x.movers.shape[0]):
        for c in range(12):
            scene.place[x.movers[i], c] = x.tracks[k, i, c]
            if c >= 9 and share > 0.0:
                scene.place[x.movers[i], c] += share * (x.tracks[k + 1, i, c] - x.tracks[k, i, c])


@compiled
def write_constraints(scene: MovedShapes, joints: Array, twists: Array, x: Shooting, k: int) -> None:
    """c and rows at the beginning of sample k; at the first, and at a last that is given, of a alone."""
    n, m, B, w = x.q.shape[1], x.u.shape[1], x.column.shape[0], x.spin.shape[0]
    N = x.a.shape[0]
    inner = 0 < k < N or (k == N and x.ends[0] == 0.0)
    for r in range(B):
        i = x.column[r]
        x.c[k, r] = math.inf
        if i >= n + m:
            if k < N:
                x.c[k, r] = x.offset[r] + x.sign[r] * x.a[k, i - n - m]
        elif inner and (i < n or k < N):
            value = x.q[k, i] if i < n else x.u[k, i - n]
            x.c[k, r] = x.offset[r] + x.sign[r] * value
    P = scene.kept.shape[0]
    if not inner:
        for r in range(2 * w + P):
            x.c[k, B + r] = math.inf
        return
    q, n_p = x.q[k], x.inputs.coordinates
    p = m - x.inputs.moved.shape[0]
    row, G, G_q = scratch(n + m), scratch((n_p, p)), scratch((n_p, p, n_p))
    clear(row)
    if w > 0:
        clear(G)
        clear(G_q)
        call_platform(x.inputs.platform, view(q, 0, (n_p,)), x.inputs.parameters, G, G_q)
    for i in range(w):
        steer = int(x.wheels[i, 4])
        along, across, turn, steered = rolling(x.wheels[i], q[2], q[steer] if steer >= 0 else 0.0)
        total = 0.0
        for j in range(p):
            row[n + j] = along * G[0, j] + across * G[1, j] + turn * G[2, j]
            if steer >= 0:
                row[n + j] += steered * G[steer, j]
            total += row[n + j] * x.u[k, j]
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            r = 2 * i + side
            x.c[k, B + r] = x.spin[i] + sign * total
            for b in range(n + m):
                x.rows[k, r, b] = sign * row[b]
    place_joints(scene.joints, q, joints)
    axes(scene.joints, joints, twists)
    place_movers(scene, x, k, 0.0)
    for shape in range(scene.carrier.shape[0]):
        place_shape(scene, joints, shape)
    for pair in range(P):
        r = 2 * w + pair
        asked = scene.kept[pair] + min(x.room[pair], x.margin[k])
        apart = placed_bound(scene, pair, asked + NEAR, asked + NEAR)
        x.c[k, B + r] = math.inf
        if apart < asked + NEAR:
            x.c[k, B + r] = apart - asked
            clear(x.rows[k, r])
            write_approach(scene, joints, twists, pair, x.rows[k, r])


@compiled
def write_all(scene: MovedShapes, x: Shooting) -> float:
    """Gaps, derivatives and constraints of the motion; returns how far it is from one that is allowed."""
    N, n = x.a.shape[0], x.q.shape[1]
    count = scene.joints.parent.shape[0]
    joints, twists, ahead = scratch((count, 12)), scratch((count, 6)), scratch(n)
    worst = 0.0
    for k in range(N):
        flow(x.inputs, x.q[k], x.u[k], x.a[k], x.step[()], x.substeps[()], ahead, x.D[k])
        for i in range(n):
            x.gaps[k, i] = ahead[i] - x.q[k + 1, i]
            worst = max(worst, abs(x.gaps[k, i]))
    for i in range(x.ends.shape[0]):
        if x.ends[i] > 0.0:
            worst = max(worst, abs(x.q[N, i] - x.goal[i] if i < n else x.u[N, i - n]))
    for k in range(N + 1):
        write_constraints(scene, joints, twists, x, k)
        for r in range(x.c.shape[1]):
            far = r >= x.c.shape[1] - x.drift.shape[1]
            worst = max(worst, -x.c[k, r] - (x.loose[()] if far else 0.0))
            if x.c[k, r] < math.inf and x.s[k, r] == 0.0:
                x.s[k, r] = max(x.c[k, r], SLACK)
                x.z[k, r] = x.mu[()] / x.s[k, r]
            if x.c[k, r] == math.inf:
                x.s[k, r] = 0.0
    return worst


@compiled
def sample_blocked(scene: MovedShapes, x: Shooting, k: int) -> int:
    """The pair that comes too near within sample k, or -1."""
    n, q, u, a, time = x.q.shape[1], x.q[k], x.u[k], x.a[k], x.step[()]
    current, joints, leg = scratch(n), scratch((scene.joints.parent.shape[0], 12)), scratch(3 + n)
    none = scratch((n, 0))
    write_fastest(x.inputs, q, u, a, time, x.substeps[()], leg)
    for pair in range(x.drift.shape[1]):
        scene.drift[pair] = x.drift[k, pair]
    begin_motion(scene, leg)
    share = 0.0
    while 0.0 <= share < 1.0:
        flow(x.inputs, q, u, a, share * time, x.substeps[()], current, none)
        place_movers(scene, x, k, share)
        share = look(scene, current, leg, share, joints, 0)
    return -1 if share >= 0.0 else int(-1.0 - share)


@compiled_without_gil
def first_blocked_sample(integers: Integers, floats: Array, own_integers: Integers, own_floats: Array) -> int:
    """The first sample that comes too near to something, or -1."""
    scene = views(MovedShapes, integers, floats, 0)
    x = views(Shooting, own_integers, own_floats, 0)
    for k in range(x.a.shape[0]):
        if sample_blocked(scene, x, k) >= 0:
            return k
    return -1


LOOK = int64(*BLOCKS.types, *BLOCKS.types)
