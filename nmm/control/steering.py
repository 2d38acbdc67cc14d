"""A steering law for platforms whose steering does not affect the task: pursuit of the end-effector.

At first order a car's steering rate does not affect a task: its column of J is zero. Without a law the car
drives straight on. So its steering angle δ converges to δ* = atan2(2 L sin β, l), with which the car would
drive, forwards or backwards, on a circle through the end-effector at distance l in direction β:

    δ_dot = -k (δ - δ*),  δ* within the joint limits,

within the limits of that input, replacing the resolver's value, which does not move the task. In the null
space, a spring keeps the end-effector ahead of the axle: α h gains k1 ∂(½ β²)/∂u.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, positive, scalar
from nmm.base.kernels.compiled import compiled
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.record_layout import Cell, IntegerCell, IntegerVector, Vector
from nmm.control.functions.pursuit import Pursuit
from nmm.control.functions.tasks.task import Task
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.model.platforms.base import Platform
from nmm.model.platforms.steering import SteeringPivot
from nmm.model.robots.reach import first_tip, reach
from nmm.model.robots.robot import Robot


class SteeringNumbers(NamedTuple):
    """What a step needs to steer k pivots.

    on () : 1 where the law is in force
    row () : the first of the k + 1 rows of the `Pursuit` in the program
    coordinates, inputs (k,) : the pivots' angles, and the inputs that set their rates
    gain () : k, 1/s
    spring () : the weight of ∂(½ β²)/∂u in h
    """

    on: IntegerCell
    row: IntegerCell
    coordinates: IntegerVector
    inputs: IntegerVector
    gain: Cell
    spring: Cell


@compiled
def steer(
    steering: SteeringNumbers, q: Array, value: Vector, G: Array, problem: ProblemArrays, u: Array
) -> None:
    """Steering inputs in u (m,) with which the pivots' angles converge to c* = `value`, within the limits."""
    for i in range(steering.inputs.shape[0]):
        j, c = steering.inputs[i], steering.coordinates[i]
        if math.isnan(u[j]):  # no solution
            return
        rate = -steering.gain[()] * (q[c] - value[steering.row[()] + i])
        for other in range(G.shape[1]):
            if other != j:
                rate -= G[c, other] * u[other]
        wanted = rate / G[c, j]
        # Rows hold with the resolver's value of this input, so the range that they allow is never empty.
        for row in range(problem.lower.shape[0]):
            slope = problem.limit_rows[row, j]
            if slope != 0.0:
                rest = dot(problem.limit_rows[row], u) - slope * u[j]
                ends = (problem.lower[row] - rest) / slope, (problem.upper[row] - rest) / slope
                wanted = min(max(wanted, min(ends[0], ends[1], u[j])), max(ends[0], ends[1], u[j]))
        u[j] = min(max(wanted, problem.u_lower[j]), problem.u_upper[j])


class Steering:
    """The law for steering inputs that do not affect a task (`platforms.base.Platform.steered_axle`).

    It is in force where none of these inputs affects the task, the added task or the objective, the task
    moves the platform by other inputs, and the steered body carries the arm with the end-effector.

    Parameters
    ----------
    gain : k, with which a steering angle converges, 1/s
    spring : k1 with which the null space turns the end-effector ahead of the axle, 1/s; 0 for none

    Raises
    ------
    InputError : a gain that is not above 0, a spring below 0

    Source: that the null space chooses the steering, De Luca, Oriolo, Robuffo Giordano, "Kinematic control of
    nonholonomic mobile manipulators in the presence of steering wheels", ICRA 2010; pursuit: Coulter,
    "Implementation of the pure pursuit path tracking algorithm", CMU-RI-TR-92-01, 1992.

    Examples
    --------
    >>> robot = nmm.Scenario.load("kinova_car").robot()
    >>> task = nmm.Task(nmm.Position("j2s6s200_end_effector"), nmm.Circle([0, 3, 1], 2.5, rate=0.1))
    >>> gentle, none = (
    ...     nmm.Controller(robot, task, nmm.ProjectedGradient(), steering=law)
    ...     for law in (nmm.Steering(gain=1.0), False)
    ... )
    >>> q = robot.q(nmm.Scenario.load("kinova_car").parts.q0)
    >>> np.allclose(gentle(0.0, q), none(0.0, q))
    False
    """

    def __init__(self, gain: float = 5.0, spring: float = 2.0) -> None:
        self.gain = positive(gain, "gain")
        self.spring = scalar(spring, "spring", least=0.0)

    def on(self, robot: Robot, task: Iterable[Task] = ()) -> Steered | None:
        """The law on a robot with tasks, whichever inputs they use; None where nothing steers a body."""
        if type(robot.platform).steered_axle is Platform.steered_axle:  # spares searching all frames
            return None
        hands = [part.function.shown().positions for part in task]
        for hand in [*hands, first_tip(robot)]:
            body = None if hand is None else _body(robot, hand)
            axle = None if body is None else robot.platform.steered_axle(body)
            arm = None if hand is None else reach(robot, hand)
            if hand is not None and body is not None and axle is not None and arm is not None and arm.length:
                return Steered(self, robot, Pursuit(hand, body, axle))
        return None


class Steered:
    """The law of `steering` on one robot.

    Attributes
    ----------
    pursuit : the pursuit
    pivots : what is steered
    inputs : names of their inputs
    """

    def __init__(self, steering: Steering, robot: Robot, pursuit: Pursuit) -> None:
        self.steering = steering
        self.robot = robot
        self.pursuit = pursuit
        self.pivots: tuple[SteeringPivot, ...] = pursuit.axle.pivots
        self.inputs = tuple(pivot.input for pivot in self.pivots)

    def __repr__(self) -> str:
        law = self.steering
        return (
            f"Steered({', '.join(self.inputs)}: pursuit of {self.pursuit.hand}, gain {law.gain:g} 1/s, "
            f"spring {law.spring:g} 1/s)"
        )

    def numbers(self, row: int, alpha: float) -> SteeringNumbers:
        """The record of a step whose program has the pursuit at `row`; the law is not yet in force."""
        robot = self.robot
        return SteeringNumbers(
            on=np.array(0),
            row=np.array(row),
            coordinates=np.array([robot.coordinate(pivot.coordinate) for pivot in self.pivots]),
            inputs=np.array([robot.input(name) for name in self.inputs]),
            gain=np.array(self.steering.gain),
            spring=np.array(self.steering.spring / alpha),
        )

    @property
    def least_radius(self) -> float:
        """The radius of the smallest circle of the axle's midpoint, m."""
        return self.pursuit.axle.least_radius(self.pursuit.limits(self.robot))

    def described(self) -> tuple[str, ...]:
        """The law in words, then what geometry rules out, if anything."""
        law, names = self.steering, ", ".join(self.inputs)
        lines = (
            f"{names}: no task feels {'it' if len(self.inputs) == 1 else 'them'}; pursuit of "
            f"{self.pursuit.hand} steers, gain {law.gain:g} 1/s, spring {law.spring:g} 1/s",
        )
        arm, radius = reach(self.robot, self.pursuit.hand), self.least_radius
        if arm is None or not np.isfinite(arm.length):  # unlimited reach
            return lines
        ratio = f"least turning radius {radius:.3g} m, {radius / arm.length:.2g} times the arm's reach"
        if radius <= arm.length:
            return (*lines, ratio)
        return (
            *lines,
            f"{ratio} ({arm.length:.3g} m): it cannot turn under its own arm, so that paths which turn "
            "sharply, or begin beside it, may stretch the arm",
        )


#: Without a law.
NOTHING = SteeringNumbers(
    np.array(0), np.array(0), np.zeros(0, int), np.zeros(0, int), np.array(0.0), np.array(0.0)
)


def _body(robot: Robot, hand: str) -> str | None:
    """The platform's coordinate that turns the body whose arm carries the end-effector; None for none."""
    model = robot.model
    chain = [
        model.joints[j].idx_q for j in model.supports[model.frames[robot.frame_id(hand)].parentJoint] if j > 0
    ]
    n_p = robot.platform.n_p
    own = [index for index in chain if index < n_p]
    return robot.q_names[own[-1]] if len(chain) > len(own) and len(own) > 2 else None
