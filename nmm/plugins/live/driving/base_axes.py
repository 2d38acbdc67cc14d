"""Which inputs drive a platform ahead, sideways and round: those that its wheels admit, and no others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nmm.base.arrays import Array
from nmm.model.platforms import Platform
from nmm.model.robots.robot import Robot

#: Full axes without a limit of the robot's that is lower: ISO 10218-1 has 0.25 m/s for a hand that is jogged.
LINEAR, ANGULAR = 0.25, 0.5
#: Of a limit of the robot's, such a share is taken.
SHARE = 0.5
#: What moves a platform by less than this, per unit of an input, does not move it; angles of steering, rad.
NOTHING, TURN = 1e-9, 1e-4
#: How exactly a direction has to be admissible.
EXACTLY = 1e-6


def body_map(platform: Platform, qp: Array) -> Array:
    """(3, p): by how much each input moves x, y (m) and theta (rad), in the platform's own axes, at qp."""
    c, s = np.cos(qp[2]), np.sin(qp[2])
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turned @ platform.G(qp)[:3])


def full_speeds(robot: Robot, q: Array) -> Array:
    """(p,): of each input at a full axis, in its unit: `LINEAR` and `ANGULAR` of the platform, or a `SHARE`
    of the robot's limit where that is less. Inputs that only steer turn at `ANGULAR`."""
    platform = robot.platform
    if not platform.p:
        return np.zeros(0)
    B = body_map(platform, q[: platform.n_p])
    along, about = np.hypot(B[0], B[1]), np.abs(B[2])
    free = np.minimum(LINEAR / np.maximum(along, NOTHING), ANGULAR / np.maximum(about, NOTHING))
    free[np.maximum(along, about) < NOTHING] = ANGULAR
    return np.minimum(free, SHARE * robot.u_limits[: platform.p])


def base_directions(platform: Platform, qp: Array, speeds: Array) -> Array:
    """(p, 3): the inputs at a full axis ahead, to the left, and round to the left, at qp (n_p,).

    Each is as large as `speeds` (p,) allow; 0 where the wheels do not admit it. A car's inputs that do not
    move it, but steer, are what bends its way to the left.
    """
    directions = np.zeros((platform.p, 3))
    if not platform.p:
        return directions
    B = body_map(platform, qp)
    moves = np.linalg.norm(B, axis=0) > NOTHING
    D = B[:, moves]
    rank = int(np.linalg.matrix_rank(D, tol=EXACTLY)) if D.size else 0
    if rank == 1:
        way = D[:, np.abs(D).max(axis=0).argmax()]
        # The only way there is: ahead if it leads there at all, else round, else aside.
        for axis in [k for k in (0, 2, 1) if abs(way[k]) > EXACTLY][:1]:
            directions[moves, axis] = np.sign(way[axis])
        directions[~moves, 2] += _bends(platform, qp, moves)
    elif rank:
        rows = [0, 1, 2] if rank == 3 else [0, 2]
        solved = np.linalg.pinv(D[rows])
        admitted = np.abs(D[rows] @ solved - np.eye(len(rows))).max(axis=0) < EXACTLY
        directions[np.ix_(moves, rows)] = np.where(admitted, solved, 0.0)
    most = np.abs(directions / speeds[:, np.newaxis]).max(axis=0, initial=0.0)
    return np.asarray(np.where(most > 0.0, directions / np.where(most > 0.0, most, 1.0), 0.0))


def _bends(platform: Platform, qp: Array, moves: NDArray[np.bool_]) -> Array:
    """How the inputs that only steer, among all, bend the way to the left."""

    def way(at: Array) -> complex:
        moved = body_map(platform, at)[:, moves].sum(axis=1)
        return complex(moved[0], moved[2])

    steer = TURN * platform.G(qp)[:, ~moves].T
    bends = np.array([np.angle(way(qp + by) * np.conj(way(qp - by))) for by in steer])
    return np.where(np.abs(bends) > EXACTLY * TURN, bends, 0.0)


def base_inputs(platform: Platform, qp: Array, axes: Array, speeds: Array) -> Array:
    """(p,): the inputs for axes (3,) from -1 to 1, none above `speeds` (p,)."""
    inputs = base_directions(platform, qp, speeds) @ axes
    return np.asarray(inputs / max(1.0, np.abs(inputs / speeds).max(initial=0.0)))
