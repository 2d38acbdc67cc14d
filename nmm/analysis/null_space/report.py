"""Redundancy: how much the task leaves free, in configurations and in motions, and what it is in words."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.null_space.motion_words import coordinate_words, input_words, motion_text
from nmm.analysis.null_space.null_fields import readable_null_space
from nmm.analysis.singular.jacobians import Jacobians, Subject, checked
from nmm.analysis.singular.parts import null_space, rank_of
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array, positive
from nmm.base.errors import SingularError
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.directions import direction_text
from nmm.control.functions.program import Program
from nmm.control.functions.tasks.task import Comparison
from nmm.control.resolvers.projected_gradient import ProjectedGradient
from nmm.control.step.idle_inputs import inputs_without_effect
from nmm.model.robots.robot import Robot

#: Singular values of Lie brackets, which are taken by differences, this small beside the largest are zero.
BRACKET_TOLERANCE = 1e-5
#: Step of the differences along the fields of the brackets, m and rad.
STEP = 1e-5


def withheld_motions(
    robot: Robot, q: Array, F: Array, rank_F: int, admitted: Array
) -> tuple[Array, tuple[str, ...]]:
    """Self-motions (k, n), with sentences, that complete the rows of `admitted` to null F.

    They are searched in the platform's own axes, where few coordinates suffice, and with mimic joints.
    """
    n_p, who = robot.platform.n_p, robot.following
    to_world = np.eye(robot.n_independent)
    if n_p:
        c, s = np.cos(q[2]), np.sin(q[2])
        to_world[:2, :2] = [[c, -s], [s, c]]
    costs = [1] * n_p + [0] * (robot.n_independent - n_p)
    known = admitted[:, who.independent] @ to_world
    own = readable_null_space(F @ who.carried @ to_world, rank_F, costs, known)
    words = coordinate_words(robot, q)
    names = [robot.q_names[i] for i in who.independent]
    units = [f"{robot.q_units[i]}/s" for i in who.independent]
    texts = tuple(motion_text(vector, names, units, words, n_p) for vector in own)
    return own @ to_world.T @ who.carried.T, texts


def regained_by_brackets(jacobians: Jacobians, t: float, q: Array, rank: int) -> int | None:
    """How many directions the brackets of two self-motions add to the self-motions of the inputs.

    The fields are X_a(q) = S(q) P(q) c_a, with P = I - J⁺ J the projector on null J and c_a an orthonormal
    basis of it at q; [X_a, X_b] = ∂X_b/∂q X_a - ∂X_a/∂q X_b by central differences.
    """
    c = null_space(jacobians.J(t, q), rank).T

    def fields(at: Array) -> Array:
        J = jacobians.J(t, at)
        if jacobians.rank(J, 1e-8) != rank:
            raise SingularError("the rank of J changes")
        N = null_space(J, rank)
        return np.asarray(jacobians.robot.S(at) @ (N.T @ N) @ c)

    try:
        at_q = fields(q)
        along = [(fields(q + STEP * X) - fields(q - STEP * X)) / (2.0 * STEP) for X in at_q.T]
    except SingularError:
        return None
    brackets = [along[a][:, b] - along[b][:, a] for a in range(len(along)) for b in range(a)]
    both = np.column_stack([at_q, *brackets])
    return rank_of(both, BRACKET_TOLERANCE) - at_q.shape[1]


@dataclass(frozen=True, eq=False)
class RedundancyReport:
    """What a task leaves free at (t, q), by coordinates and by inputs (paper, section II).

    F = ∂f/∂q - ∂g/∂q (s, n) and J = F S (s, m); with a fixed base both are the same, unless joints follow
    others: these leave n - k coordinates to choose.

    Attributes
    ----------
    robot, rows : the robot, the names of the task's s rows
    t, q (n,) : where
    F (s, n), J (s, m), S (n, m) : there
    rank_F, rank_J : ranks of F for motions in which followers follow, and of J
    null (m - rank_J, m) : orthonormal null vectors of J
    readable (m - rank_J, m) : a basis of the same space with few non-zero components, the largest of each 1
    texts : each of `readable` in words
    without_effect : inputs that move the task nowhere; each is a null vector of its own
    withheld (k, n) : self-motions q_dot with F q_dot = 0 that no input gives, which complete S `readable` to
        null F
    withheld_texts : each in words, along the platform's own axes
    by_brackets : how many of the k the Lie brackets of two self-motions S(q) u give; None where the wheels
        or the task do not let them be taken

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> report = nmm.analysis.redundancy((robot, nmm.Posture("q1", "q2")), robot.rest)
    >>> report.texts
    ('the platform drives forward at 1 m/s alone', 'the platform turns left at 1 rad/s alone')
    """

    robot: Robot
    rows: tuple[str, ...]
    t: float
    q: Array
    F: Array
    J: Array
    S: Array
    rank_F: int
    rank_J: int
    null: Array
    readable: Array
    texts: tuple[str, ...]
    without_effect: tuple[str, ...]
    withheld: Array
    withheld_texts: tuple[str, ...]
    by_brackets: int | None

    @property
    def static(self) -> int:
        """Degree of static redundancy, n - s, without mimic joints; negative if the task asks too much."""
        return self.robot.n_independent - len(self.rows)

    @property
    def kinematic(self) -> int:
        """Degree of kinematic redundancy, p + n_m - s; negative if the task asks for too much."""
        return self.robot.n_u - len(self.rows)

    @property
    def manifold(self) -> int:
        """n - rank F: dimension of the configurations around q with the same task value."""
        return self.robot.n_independent - self.rank_F

    @property
    def free(self) -> int:
        """m - rank J: how many independent motions of the inputs leave the task at rest."""
        return self.robot.n_u - self.rank_J

    @property
    def withheld_coordinates(self) -> tuple[str, ...]:
        """`withheld` in the coordinates' names: "0.3 x + y"."""
        return tuple(direction_text(vector, self.robot.q_names) for vector in self.withheld)

    def text(self) -> str:
        """The report for people."""
        return "\n\n".join("\n".join(map(str, part)) for part in self.findings())

    def findings(self) -> list[list[Finding]]:
        """What was found, part by part: counts, the motions left free, those withheld."""
        return [part for part in (self._counts(), self._motions(), self._withheld()) if part]

    def _counts(self) -> list[Finding]:
        robot, s, n = self.robot, len(self.rows), self.robot.n_independent
        findings = [
            Finding("redundancy_of", {"robot": robot.name, "rows": self.rows}),
            Finding("redundancy_sizes", {"n": n, "following": robot.n - n, "inputs": robot.n_u, "rows": s}),
            Finding("static_redundancy", {"n": n, "rows": s, "degree": self.static}),
            Finding("kinematic_redundancy", {"inputs": robot.n_u, "rows": s, "degree": self.kinematic}),
            Finding("redundancy_at", {"q": dict(zip(robot.q_names, self.q.tolist(), strict=True))}),
            Finding("configurations_free", {"rank": self.rank_F, "rows": s, "dimension": self.manifold}),
            Finding("motions_free", {"rank": self.rank_J, "rows": s, "count": self.free}),
        ]
        if self.rank_J < self.rank_F:
            findings.append(Finding("singular_inputs", {"lost": self.rank_F - self.rank_J}))
        return findings

    def _motions(self) -> list[Finding]:
        if not self.free:
            return []
        findings = [Finding("self_motions", {"count": self.free})]
        for k, (vector, text) in enumerate(zip(self.readable, self.texts, strict=True)):
            moved = [name for name, rate in zip(self.robot.u_names, vector, strict=True) if rate]
            values = {"number": k, "motion": text, "alone": len(moved) == 1}
            everywhere = moved[0] in self.without_effect
            findings.append(Finding("self_motion", {**values, "everywhere": everywhere}))
        return [*findings, Finding("self_motions_combined", {"count": self.free})]

    def _withheld(self) -> list[Finding]:
        k = len(self.withheld)
        if not k:
            same = self.robot.n_independent == self.robot.n_u
            return [] if same else [Finding("nothing_withheld")]
        findings = [Finding("motions_withheld", {"dimension": self.manifold, "count": k})]
        for text, coordinates in zip(self.withheld_texts, self.withheld_coordinates, strict=True):
            findings.append(Finding("motion_withheld", {"motion": text, "coordinates": coordinates}))
        if self.free < 2:
            findings.append(Finding("no_manoeuvre", {"free": self.free, "withheld": k}))
        elif self.by_brackets is not None:
            findings.append(Finding("manoeuvres", {"given": self.by_brackets, "withheld": k}))
        return findings


def redundancy(
    subject: Subject, q: ArrayLike | Mapping[str, float], t: float = 0.0, *, tolerance: float = TOLERANCE
) -> RedundancyReport:
    """What the task leaves free at (t, q): degrees of redundancy, null space, in numbers and in words.

    Parameters
    ----------
    subject : a controller, or (robot, task); the controller is not run
    q : (n,) m and rad, or by name
    t : s; a reference that moves is looked at as it stands at t
    tolerance : singular values this small beside the largest are zero

    Raises
    ------
    InputError : a task of more rows than inputs, q of another length, an unknown name
    SingularError : there is no J: the wheels cannot roll there, or the task is undefined

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> report = nmm.analysis.redundancy((robot, nmm.Position("ee", "xy")), {"q2": 0.5})
    >>> report.kinematic, report.static
    (2, 3)
    """
    jacobians = Jacobians(subject)
    t, q = checked(jacobians, t, q)
    tolerance = positive(tolerance, "tolerance")
    robot, p = jacobians.robot, jacobians.robot.platform.p
    J, F, S = jacobians.J(t, q), coordinate_jacobian(jacobians, t, q), robot.S(q)
    rank_J, rank_F = jacobians.rank(J, tolerance), jacobians.rank(F @ robot.following.carried, tolerance)
    readable = readable_null_space(J, rank_J, [1] * p + [0] * (robot.n_u - p))
    words = input_words(robot, q)
    controller = Controller(robot, jacobians.task, ProjectedGradient(), steering=False)
    withheld, texts = withheld_motions(robot, q, F, rank_F, readable @ S.T)
    return RedundancyReport(
        robot=robot,
        rows=jacobians.row_names,
        t=t,
        q=q,
        F=F,
        J=J,
        S=S,
        rank_F=rank_F,
        rank_J=rank_J,
        null=null_space(J, rank_J),
        readable=readable,
        texts=tuple(motion_text(vector, robot.u_names, robot.u_units, words, p) for vector in readable),
        without_effect=inputs_without_effect(controller.solver, q),
        withheld=withheld,
        withheld_texts=texts,
        by_brackets=regained_by_brackets(jacobians, t, q, rank_J) if len(withheld) else 0,
    )


def coordinate_jacobian(jacobians: Jacobians, t: float, q: Array) -> Array:
    """F = ∂f/∂q - ∂g/∂q (s, n) at (t, q), so that J = F S; of a pose, minus the derivative of its error."""
    each = [(task.function, task.reference, Comparison(task)) for task in jacobians.task]
    program = Program(jacobians.robot, list(itertools.chain(*each)))
    program.lay_out()
    evaluated = program.evaluate(t, q)
    triples = zip(evaluated[::3], evaluated[1::3], evaluated[2::3], strict=True)
    F = np.vstack([-e.value_q if len(e.value) else f.value_q - g.value_q for f, g, e in triples])
    if not np.all(np.isfinite(F)):
        raise SingularError(f"at t = {t:g} s: the task or its reference is undefined there")
    return F
