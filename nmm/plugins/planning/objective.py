"""An objective as a cost of the samples of a smooth motion."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_kind
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.program import COMPILED, Program, run_program
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.shooting import Shooting

#: Between the gradients whose difference is the curvature, m and rad.
APART = 1e-5
#: The least curvature, a share of the largest curvature or gradient: it carries a slope without curvature.
FLAT = 1e-6


class SampleCosts:
    """H(q) at each sample's beginning, with its exact gradient. H beside the effort of a sample: an input at
    its limit costs `problem.EFFORT`, a rate of an input at its limit 1, both by their squares.

    Raises
    ------
    InputError : no objective; one of another robot; one that changes with time
    """

    def __init__(self, robot: Robot, objective: Objective) -> None:
        expect_kind(objective, Objective, "plan: objective", "an objective, as nmm.Manipulability")
        terms = objective.terms_on(robot)
        self._program = Program(robot, [function for _, function in terms], COMPILED)
        self._program.lay_out()
        self._weights = np.array([weight for weight, _ in terms])
        some = robot.rest + np.random.default_rng(0).uniform(-1.0, 1.0, (4, robot.n))
        values = [self.at(some, t)[0] for t in (0.0, 1.0, np.e)]
        if not all(np.array_equal(values[0], value) for value in values):
            raise InputError(
                "it changes with time", where="plan: objective", expected="one of the configuration alone"
            )

    def at(self, q: Array, t: float = 0.0) -> tuple[Array, Array]:
        """H (K,) and ∂H/∂q (K, n) at q (K, n)."""
        program, rows, weights = self._program, self._program.first_rows, self._weights
        H, H_q = np.empty(len(q)), np.empty(q.shape)
        with np.errstate(over="ignore", invalid="ignore"):
            for k, sample in enumerate(q):
                program.prepare(t, sample)
                run_program(t, sample, *program.blocks)
                H[k] = weights @ program.buffers.value[rows]
                H_q[k] = weights @ program.buffers.value_q[rows]
        return H, H_q

    def curvature(self, q: Array, H_q: Array) -> Array:
        """∂²H/∂q² (K, n, n) at q (K, n), by differences of gradients."""
        n = q.shape[1]
        beside = (q[:, np.newaxis] + APART * np.eye(n)).reshape(-1, n)
        with np.errstate(invalid="ignore"):
            hessian = (self.at(beside)[1].reshape(-1, n, n) - H_q[:, np.newaxis]) / APART
        return 0.5 * (hessian + hessian.transpose(0, 2, 1))

    def write(self, x: Shooting, share: float) -> None:
        """A share of H about the motion, as the problem's squares: its gradient, and its curvature with all
        signs positive, so that a round goes down from everywhere."""
        H_q = self.at(x.q)[1]
        curvature = self.curvature(x.q, H_q)
        if not np.all(np.isfinite(curvature)):  # nothing is known there: limits and effort alone lead on
            x.pull[:] = 0.0
            return
        bends, ways = np.linalg.eigh(curvature)
        bends = np.abs(bends)
        bends = np.maximum(bends, FLAT * max(bends.max(), np.abs(H_q).max(), np.finfo(float).tiny))
        x.aims[:] = ways.transpose(0, 2, 1)
        along = np.einsum("kei,ki->ke", x.aims, x.q)
        x.aimed[:] = along - np.einsum("kei,ki->ke", x.aims, H_q) / bends
        x.pull[:] = share * bends
