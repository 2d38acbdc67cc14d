"""Motions that leave the task at rest and that the wheels withhold, and whether manoeuvres give them."""

from __future__ import annotations

import numpy as np

from nmm.analysis.redundancy.motion_words import coordinate_words, motion_text
from nmm.analysis.redundancy.null_space import projector, readable_null_space
from nmm.analysis.singular.jacobians import Jacobians
from nmm.analysis.singular.parts import null_space, rank_of
from nmm.arrays import Array
from nmm.errors import SingularError
from nmm.robots.robot import Robot

#: Singular values of Lie brackets, which are taken by differences, this small beside the largest are zero.
BRACKET_TOLERANCE = 1e-5
#: Step of the differences along the fields of the brackets, m and rad.
STEP = 1e-5


def withheld_motions(
    robot: Robot, q: Array, F: Array, rank_F: int, admitted: Array
) -> tuple[Array, tuple[str, ...]]:
    """Self-motions (k, n) that complete those admitted (rows) to null F, with their sentences.

    They are looked for along the platform's own axes, in which few coordinates say much, and among motions in
    which followers follow.
    """
    n_p, who = robot.platform.n_p, robot.following
    to_world = np.eye(robot.n_independent)
    if n_p:
        c, s = np.cos(q[2]), np.sin(q[2])
        to_world[:2, :2] = [[c, -s], [s, c]]
    own = readable_null_space(
        F @ who.carried @ to_world,
        rank_F,
        [1] * n_p + [0] * (robot.n_independent - n_p),
        admitted[:, who.independent] @ to_world,
    )
    words = coordinate_words(robot, q)
    names, units = (
        [robot.q_names[i] for i in who.independent],
        [f"{robot.q_units[i]}/s" for i in who.independent],
    )
    texts = tuple(motion_text(one, names, units, words, n_p) for one in own)
    return own @ to_world.T @ who.carried.T, texts


def regained_by_brackets(jacobians: Jacobians, t: float, q: Array, rank: int) -> int | None:
    """How many directions the brackets of two self-motions add to the self-motions of the inputs.

    The fields are X_a(q) = S(q) P(q) c_a, with P the projector on null J and c_a an orthonormal basis of it
    at q; [X_a, X_b] = ∂X_b/∂q X_a - ∂X_a/∂q X_b by central differences.
    """
    c = null_space(jacobians.J(t, q), rank).T

    def fields(at: Array) -> Array:
        J = jacobians.J(t, at)
        if jacobians.rank(J, 1e-8) != rank:
            raise SingularError("the rank of J changes")
        return np.asarray(jacobians.robot.S(at) @ projector(J, rank) @ c)

    try:
        here = fields(q)
        along = [(fields(q + STEP * X) - fields(q - STEP * X)) / (2.0 * STEP) for X in here.T]
    except SingularError:
        return None
    brackets = [along[a][:, b] - along[b][:, a] for a in range(len(along)) for b in range(a)]
    both = np.column_stack([here, *brackets])
    return rank_of(both, BRACKET_TOLERANCE) - here.shape[1]
