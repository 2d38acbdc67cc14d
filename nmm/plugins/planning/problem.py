"""A problem of shooting in numbers, laid out for compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.control.limits.limits import LimitsOn
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import inputs_of
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.search_space import allowed
from nmm.plugins.planning.shooting import Shooting

#: Samples' ends keep this much more than the distance, m.
MARGIN = 0.005
#: The most that the platform turns in one step of its integration, rad, and goes, in lengths of a trailer.
TURN, TOWED = 0.1, 0.04
#: Wheels keep this share of their limits at the ends of samples.
WITHIN = 0.99
#: Hitches keep off their limits by so much at the ends of samples, rad.
FOLDING = 0.02
#: Weight of inputs beside that of their rates, both as shares of their limits; of the end's error.
EFFORT, END = 0.3, 1e5
#: Products of slacks and multipliers to begin with.
MU = 1e-2


def largest_inputs(robot: Robot, limits: LimitsOn, usual: float) -> Array:
    """Limits of inputs (m, 2); usual : speeds of those without, m/s and rad/s."""
    largest = np.full(robot.n_u, usual)
    if robot.platform.n_p:  # rates of wheels as drive the platform so
        G = robot.platform.G(np.zeros(robot.platform.n_p))
        largest[: robot.platform.p] *= np.abs(np.linalg.pinv(G)).max(axis=1)
    return np.where(np.isfinite(limits.inputs), limits.inputs, np.column_stack([-largest, largest]))


def steps_within(robot: Robot, q: Array, u: Array, step: float) -> float:
    """How many steps the platform's integration needs in a sample of a motion q (N + 1, n), u (N + 1, m)."""
    needed = float(np.abs(np.diff(q[:, 2 : robot.platform.n_p], axis=0)).max(initial=0.0)) / TURN
    if isinstance(robot.platform, Tractor):
        shortest = min(trailer.length for trailer in robot.platform.trailers)
        needed = max(needed, step * float(np.abs(u[:, 0]).max()) / (TOWED * shortest))
    return needed


def shooting_problem(
    robot: Robot,
    limits: LimitsOn,
    top: Array,
    check: MotionCheck,
    q: Array,
    u: Array,
    step: float,
    fixed_end: bool,
    aims: int = 0,
    movers: Sequence[int] = (),
) -> Shooting:
    """The problem, with a motion to begin with: q (N + 1, n) and u (N + 1, m) every step, s. top (m, 2) : of
    inputs; fixed_end : whether it ends where the motion does; aims : rows of the cost, of zeros; movers :
    shapes that move."""
    zeros = np.zeros
    n, m, N = robot.n, robot.n_u, len(q) - 1
    hardest = np.abs(limits.changes).max(axis=1)
    within = allowed(robot, limits)
    # Between two ends of samples a joint can go farther than at both, while it turns round.
    room = np.minimum(q[[0, -1]] - within[:, 0], within[:, 1] - q[[0, -1]])
    over = np.zeros(n)
    moved = robot.rate_coordinates
    over[moved[moved >= 0]] = (np.where(np.isfinite(hardest), hardest, 0.0) * step * step / 8.0)[moved >= 0]
    towed = np.setdiff1d(np.arange(robot.platform.n_p), moved)
    over[towed[np.isfinite(within[towed]).any(axis=1)]] = FOLDING
    over = np.minimum(over, 0.5 * np.maximum(room.min(axis=0), 0.0))
    ends = np.vstack(
        [
            within + np.column_stack([over, -over]),
            top,
            limits.changes,
        ]
    )
    column, side = np.nonzero(np.isfinite(ends))
    sign = np.where(side == 0, 1.0, -1.0)
    largest = np.abs(top).max(axis=1)
    hardest = np.where(np.isfinite(hardest), hardest, 10.0 * largest)
    scene, distances = check.scene, check.kept
    spare = zeros(0)
    if scene is not None:
        pairs = range(len(distances))
        apart = np.minimum(*(scene.queries.distances(0.0, end, pairs) for end in q[[0, -1]]))
        spare = np.maximum(0.5 * (apart - distances), 0.0)
    R = len(column) + 2 * len(limits.spin) + len(distances)
    return Shooting(
        inputs=inputs_of(robot),
        step=np.array(step),
        substeps=np.array(max(2, math.ceil(steps_within(robot, q, u, step))), dtype=np.int64),
        column=column.astype(np.int64),
        sign=sign,
        offset=-sign * ends[column, side],
        wheels=limits.wheels,
        spin=WITHIN * limits.spin,
        weights=np.concatenate([EFFORT / largest**2, 1.0 / hardest**2]),
        goal=q[-1],
        ends=END * np.concatenate([np.full(n, float(fixed_end)), np.ones(m)]),
        aims=zeros((N + 1, aims, n)),
        aimed=zeros((N + 1, aims)),
        pull=zeros((N + 1, aims)),
        movers=np.array(movers, dtype=np.int64),
        tracks=zeros((N + 1, len(movers), 12)),
        drift=zeros((N, len(distances))),
        room=spare,
        margin=np.full(N + 1, MARGIN),
        loose=np.array(0.0 if fixed_end else 0.5 * MARGIN),
        q=q,
        u=u,
        a=np.diff(u, axis=0) / step,
        moves=zeros((N + 1, n + 2 * m)),
        gaps=zeros((N, n)),
        D=zeros((N, n, n + 2 * m)),
        c=zeros((N + 1, R)),
        s=zeros((N + 1, R)),
        z=zeros((N + 1, R)),
        ds=zeros((N + 1, R)),
        dz=zeros((N + 1, R)),
        rows=zeros((N + 1, R - len(column), n + m)),
        K=zeros((N, m, n + m + 1)),
        V=zeros((n + m, n + m + 1)),
        Q=zeros((n + 2 * m, n + 2 * m + 1)),
        W=zeros((n + m, n + 2 * m)),
        duals=zeros(n + m),
        mu=np.array(MU),
    )
