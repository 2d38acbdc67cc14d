"""Redundancy: how much the task leaves free, in configurations and in motions, and what it is in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.redundancy.motion_words import input_words, motion_text
from nmm.analysis.redundancy.null_space import readable_null_space
from nmm.analysis.redundancy.withheld import regained_by_brackets, withheld_motions
from nmm.analysis.singular.jacobians import Jacobians, Subject, checked
from nmm.analysis.singular.parts import null_space
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.arrays import Array, positive
from nmm.control.controller import Controller
from nmm.control.directions import direction_text
from nmm.control.idle_inputs import inputs_without_effect
from nmm.errors import SingularError
from nmm.functions.function import Function
from nmm.functions.program import Program
from nmm.functions.tasks.comparison import Comparison
from nmm.resolvers.projected_gradient import ProjectedGradient
from nmm.robots.robot import Robot


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
        """Degree of static redundancy, n - s, without what follows (below zero: the task asks for more than
        there is)."""
        return self.robot.n_independent - len(self.rows)

    @property
    def kinematic(self) -> int:
        """Degree of kinematic redundancy, p + n_m - s (below zero: the task asks for more than there is)."""
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
        return tuple(direction_text(one, self.robot.q_names) for one in self.withheld)

    def text(self) -> str:
        """The report for people."""
        parts = (self._counts(), self._motions(), self._withheld())
        return "\n\n".join("\n".join(part) for part in parts if part)

    def _counts(self) -> list[str]:
        robot, s, n = self.robot, len(self.rows), self.robot.n_independent
        following = f" (and {robot.n - n} that follow others)" if robot.followers else ""
        lines = [
            f"{robot.name}, task {', '.join(self.rows)}",
            f"n = {_many(n, 'coordinate')}{following}, n_u = {_many(robot.n_u, 'input')}, "
            f"s = {_many(s, 'row')} of the task",
            f"static redundancy       n - s = {n} - {s} = {self.static} (configurations)",
            f"kinematic redundancy  n_u - s = {robot.n_u} - {s} = {self.kinematic} (motions)",
            "at "
            + ", ".join(f"{name} = {value:.4g}" for name, value in zip(robot.q_names, self.q, strict=True))
            + ":",
            f"  rank of ∂f/∂q {self.rank_F} of {s}: configurations with this task value form a manifold of "
            f"dimension {self.manifold}",
            f"  rank of J {self.rank_J} of {s}: {_many(self.free, 'motion')} of the inputs "
            f"{'leaves' if self.free == 1 else 'leave'} the task at rest",
        ]
        if self.rank_J < self.rank_F:
            lost = self.rank_F - self.rank_J
            lines.append(
                f"  {_many(lost, 'direction')} of the task that the coordinates move "
                f"{'is' if lost == 1 else 'are'} moved by no input here: J is singular, ∂f/∂q is not"
            )
        return lines

    def _motions(self) -> list[str]:
        if not self.free:
            return []
        several = self.free > 1
        lines = [
            f"the task stays at rest in {'each of these motions' if several else 'this motion'} "
            f"(--self-motion takes {'their numbers' if several else 'its number'}):"
        ]
        for k, (vector, text) in enumerate(zip(self.readable, self.texts, strict=True)):
            moved = [name for name, rate in zip(self.robot.u_names, vector, strict=True) if rate]
            of_it = ""
            if len(moved) == 1:
                where = "" if moved[0] in self.without_effect else " here"
                of_it = f" (without effect on the task{where})"
            lines.append(f"  {k}  {text}{of_it}")
        return [*lines, "and in their opposites and combinations" if several else "and in its opposite"]

    def _withheld(self) -> list[str]:
        k = len(self.withheld)
        if not k:
            if self.robot.n_independent == self.robot.n_u:
                return []
            return ["the inputs give every motion of the coordinates that leaves the task at rest"]
        them = "it" if k == 1 else "them"
        lines = [
            f"the coordinates could move in {_many(self.manifold, 'independent way')} with the task at rest; "
            f"the wheels withhold {k} of them, which no input gives:",
            *(
                f"  - {text} (q_dot: {coordinates})"
                for text, coordinates in zip(self.withheld_texts, self.withheld_coordinates, strict=True)
            ),
        ]
        if not self.free:
            why = "no motion of the inputs leaves the task at rest"
        elif self.free == 1:
            why = "only one motion of the inputs leaves the task at rest, and it only leads there and back"
        elif self.by_brackets is None:
            return lines
        elif self.by_brackets == k:
            return [
                *lines,
                f"but a manoeuvre gives {them}, the task at rest all the while: two motions of the inputs in "
                "turn, there and back (rank of the Lie brackets); so every configuration nearby with this "
                "task value can be reached",
            ]
        else:
            give = f"give {self.by_brackets} of them" if self.by_brackets else f"do not give {them} either"
            return [
                *lines,
                f"manoeuvres, two motions of the inputs in turn, there and back, {give} (rank of the Lie "
                "brackets; longer manoeuvres were not looked at)",
            ]
        return [*lines, f"nor does a manoeuvre give {them} with the task at rest all the while: {why}"]


def _many(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


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
        texts=tuple(motion_text(one, robot.u_names, robot.u_units, words, p) for one in readable),
        without_effect=inputs_without_effect(
            Controller(robot, jacobians.task, ProjectedGradient(), steering=False), q
        ),
        withheld=withheld,
        withheld_texts=texts,
        by_brackets=regained_by_brackets(jacobians, t, q, rank_J) if len(withheld) else 0,
    )


def coordinate_jacobian(jacobians: Jacobians, t: float, q: Array) -> Array:
    """F = ∂f/∂q - ∂g/∂q (s, n) at (t, q), so that J = F S; of a pose, minus the derivative of its error.

    Raises
    ------
    SingularError : it is not a number there
    """
    functions: list[Function] = []
    for task in jacobians.task:
        functions += [task.function, task.reference, Comparison(task)]
    program = Program(jacobians.robot, functions)
    program.lay_out()
    found = program.evaluate(t, q)
    blocks = []
    for f, g, error in zip(found[::3], found[1::3], found[2::3], strict=True):
        blocks.append(-error.value_q if len(error.value) else f.value_q - g.value_q)
    F = np.vstack(blocks)
    if not np.all(np.isfinite(F)):
        raise SingularError(f"at t = {t:g} s: the task or its reference is undefined there")
    return F
