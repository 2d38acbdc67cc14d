"""The paper written out again, in (x, y, theta, q1, ...) and plain numpy: nothing of nmm is imported here.

Signs and indices are those that the mathematics gives; where the printed text differs, a comment says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy import cos, pi, sin
from numpy.typing import NDArray

Array = NDArray[np.float64]
Minors = dict[tuple[int, ...], float]

TARGET = np.array([6.0, 2.0])  # T of cases 2 and 3, m
START_2R = np.array([-1.0, -1.0, pi, 0.0, 0.0])
START_3R = np.array([0.0, 0.0, pi, 0.0, pi / 2, 0.0])


def G(q: Array) -> Array:
    return np.array([[cos(q[2]), 0.0], [sin(q[2]), 0.0], [0.0, 1.0]])


def S(q: Array) -> Array:
    """blkdiag(G, I): q_dot = S u."""
    arm = len(q) - 3
    return np.block([[G(q), np.zeros((3, arm))], [np.zeros((arm, 2)), np.eye(arm)]])


@dataclass(frozen=True)
class Planar:
    """Unicycle + planar 2R arm; q = [x, y, theta, q1, q2], u = [v, omega, q1_dot, q2_dot]."""

    d: float = 0.3
    l1: float = 0.5
    l2: float = 0.3

    def f(self, q: Array) -> Array:
        """Eq. (14)."""
        x, y, a, b, c = q[0], q[1], q[2], q[2] + q[3], q[2] + q[3] + q[4]
        return np.array(
            [
                x + self.d * cos(a) + self.l1 * cos(b) + self.l2 * cos(c),
                y + self.d * sin(a) + self.l1 * sin(b) + self.l2 * sin(c),
            ]
        )

    def J(self, q: Array) -> Array:
        """Eq. (15), 2 x 4."""
        d, l1, l2 = self.d, self.l1, self.l2
        a, b, c = q[2], q[2] + q[3], q[2] + q[3] + q[4]
        return np.array(
            [
                [cos(a), -d * sin(a) - l1 * sin(b) - l2 * sin(c), -l1 * sin(b) - l2 * sin(c), -l2 * sin(c)],
                [sin(a), d * cos(a) + l1 * cos(b) + l2 * cos(c), l1 * cos(b) + l2 * cos(c), l2 * cos(c)],
            ]
        )

    def J_pointing(self, q: Array) -> Array:
        """Case 2: with the absolute orientation of link 2, 3 x 4."""
        return np.vstack([self.J(q), [0.0, 1.0, 1.0, 1.0]])

    def J_link_pointing(self, q: Array) -> Array:
        """Case 3: with the absolute orientation of link 1, 3 x 4."""
        return np.vstack([self.J(q), [0.0, 1.0, 1.0, 0.0]])

    def minors(self, q: Array) -> Minors:
        """Those of (15); the printed 13, 14, 23 and 24 have the opposite sign."""
        d, l1, l2 = self.d, self.l1, self.l2
        c1, s1, c12, s12, s2 = cos(q[3]), sin(q[3]), cos(q[3] + q[4]), sin(q[3] + q[4]), sin(q[4])
        return {
            (1, 2): d + l1 * c1 + l2 * c12,
            (1, 3): l1 * c1 + l2 * c12,
            (1, 4): l2 * c12,
            (2, 3): d * (l1 * s1 + l2 * s12),
            (2, 4): l2 * (l1 * s2 + d * s12),
            (3, 4): l1 * l2 * s2,
        }

    def minors_pointing(self, q: Array) -> Minors:
        d, l1 = self.d, self.l1
        c1, s1 = cos(q[3]), sin(q[3])
        return {(1, 2, 3): d, (1, 2, 4): d + l1 * c1, (1, 3, 4): l1 * c1, (2, 3, 4): d * l1 * s1}

    def _elbow_to_target(self, q: Array) -> Array:
        b = q[2] + q[3]
        return TARGET - np.array(
            [q[0] + self.d * cos(q[2]) + self.l1 * cos(b), q[1] + self.d * sin(q[2]) + self.l1 * sin(b)]
        )

    def bearing(self, q: Array) -> float:
        """g(q) of case 3: the angle at which link 1 would point at the target."""
        ex, ey = self._elbow_to_target(q)
        return float(np.arctan2(ey, ex))

    def J_bar(self, q: Array) -> Array:
        """J - dg/dq S of case 3, by hand: g_dot = (ey px_dot - ex py_dot) / rho^2, p the elbow."""
        d, l1 = self.d, self.l1
        a, b = q[2], q[2] + q[3]
        ex, ey = self._elbow_to_target(q)
        elbow = np.array(
            [
                [cos(a), -d * sin(a) - l1 * sin(b), -l1 * sin(b), 0.0],
                [sin(a), d * cos(a) + l1 * cos(b), l1 * cos(b), 0.0],
            ]
        )
        J = self.J_link_pointing(q)
        J[2] -= (ey * elbow[0] - ex * elbow[1]) / (ex**2 + ey**2)
        return J

    def minor_bar_123(self, q: Array) -> float:
        """The minor of J_bar that RG inverts in case 3 (the paper shows J's)."""
        rho = float(np.hypot(*self._elbow_to_target(q)))
        return self.d * (rho - self.l2 * cos(q[2] + q[3] + q[4] - self.bearing(q))) / rho


@dataclass(frozen=True)
class Elbow:
    """Unicycle + 3R elbow-type arm; q = [x, y, theta, q1, q2, q3], u = [v, omega, q1_dot, q2_dot, q3_dot]."""

    d: float = 0.3
    h: float = 0.3
    l1: float = 0.4
    l2: float = 0.5
    l3: float = 0.4

    def f(self, q: Array) -> Array:
        a, b = q[2], q[2] + q[3]
        reach = self.l2 * sin(q[4]) + self.l3 * sin(q[4] + q[5])
        return np.array(
            [
                q[0] + self.d * cos(a) + reach * cos(b),
                q[1] + self.d * sin(a) + reach * sin(b),
                self.h + self.l1 + self.l2 * cos(q[4]) + self.l3 * cos(q[4] + q[5]),
            ]
        )

    def J(self, q: Array) -> Array:
        """3 x 5; the first sign of the printed entry (1, 3) is wrong."""
        d, l2, l3 = self.d, self.l2, self.l3
        a, b = q[2], q[2] + q[3]
        s2, c2, s23, c23 = sin(q[4]), cos(q[4]), sin(q[4] + q[5]), cos(q[4] + q[5])
        L, D = l2 * s2 + l3 * s23, l2 * c2 + l3 * c23
        return np.array(
            [
                [cos(a), -d * sin(a) - L * sin(b), -L * sin(b), D * cos(b), l3 * c23 * cos(b)],
                [sin(a), d * cos(a) + L * cos(b), L * cos(b), D * sin(b), l3 * c23 * sin(b)],
                [0.0, 0.0, 0.0, -L, -l3 * s23],
            ]
        )

    def minors(self, q: Array) -> Minors:
        """The printed ones hang on other index triples."""
        d, l2, l3 = self.d, self.l2, self.l3
        s1, c1, s3, s23 = sin(q[3]), cos(q[3]), sin(q[5]), sin(q[4] + q[5])
        L = l2 * sin(q[4]) + l3 * s23
        return {
            (1, 2, 3): 0.0,
            (1, 2, 4): -L * (L * c1 + d),
            (1, 2, 5): -l3 * s23 * (L * c1 + d),
            (1, 3, 4): -(L**2) * c1,
            (1, 3, 5): -l3 * s23 * L * c1,
            (1, 4, 5): -l2 * l3 * s1 * s3,
            (2, 3, 4): -d * L**2 * s1,
            (2, 3, 5): -d * l3 * s1 * s23 * L,
            (2, 4, 5): l2 * l3 * s3 * (d * c1 + L),
            (3, 4, 5): l2 * l3 * L * s3,
        }


def H1(q: Array) -> tuple[float, Array]:
    """The objective of case 1 and its gradient in q; likewise H2, H3, H4."""
    a, b = q[2] + q[3] + q[4] - pi / 2, q[3] - pi / 4
    return (a**2 + b**2) / 2, np.array([0.0, 0.0, a, a + b, a])


def H2(q: Array) -> tuple[float, Array]:
    return (q[4] + pi / 2) ** 2 / 2, np.array([0.0, 0.0, 0.0, 0.0, q[4] + pi / 2])


def H3(q: Array) -> tuple[float, Array]:
    a = q[2] + q[3] + q[4]
    return a**2 / 2, np.array([0.0, 0.0, a, a, a])


def H4(q: Array) -> tuple[float, Array]:
    return (q[3] ** 2 + (q[5] + pi / 2) ** 2) / 2, np.array([0.0, 0.0, 0.0, q[3], 0.0, q[5] + pi / 2])


def circle(t: float) -> tuple[Array, Array]:
    """Eq. (16) and its time derivative."""
    phi, w = 0.08 * pi * t + 5 / 4 * pi, 0.08 * pi
    return 2 + 3 * np.array([cos(phi), sin(phi)]), 3 * w * np.array([-sin(phi), cos(phi)])


def wrapped(angle: float) -> float:
    return float(np.arctan2(sin(angle), cos(angle)))


#: J_bar, rate (K = 1) and the gradient of H in q, of one of the paper's cases at (t, q).
Problem = tuple[Array, Array, Array]


def case_1(t: float, q: Array) -> Problem:
    r_d, rate = circle(t)
    robot = Planar()
    return robot.J(q), rate + r_d - robot.f(q), H1(q)[1]


def case_2(t: float, q: Array) -> Problem:
    (r_d, rate), robot = circle(t), Planar()
    ex, ey = TARGET - r_d
    turning = (ey * rate[0] - ex * rate[1]) / (ex**2 + ey**2)
    error = wrapped(float(np.arctan2(ey, ex)) - (q[2] + q[3] + q[4]))
    return robot.J_pointing(q), np.append(rate + r_d - robot.f(q), turning + error), H2(q)[1]


def case_3(t: float, q: Array) -> Problem:
    (r_d, rate), robot = circle(t), Planar()
    error = wrapped(robot.bearing(q) - (q[2] + q[3]))
    return robot.J_bar(q), np.append(rate + r_d - robot.f(q), error), H3(q)[1]


def case_4(t: float, q: Array) -> Problem:
    (r_d, rate), robot = circle(t), Elbow()
    return robot.J(q), np.append(rate, 0.0) + np.append(r_d, 0.5) - robot.f(q), H4(q)[1]


def permutation(basic: Sequence[int], m: int) -> Array:
    """T of eq. (8): J T = [Ja Jb], with the basic columns in the order given, then the others."""
    order = [*basic, *(j for j in range(m) if j not in basic)]
    return np.eye(m)[:, order]


def reduced_gradient(
    J: Array, rate: Array, gradient: Array, S: Array, basic: Sequence[int], alpha: float = 10.0
) -> Array:
    """Eqs. (8) to (10), to the letter; `gradient` is that of H in q."""
    s, m = J.shape
    T = permutation(basic, m)
    Ja, Jb = np.split(J @ T, [s], axis=1)
    reduction = np.hstack([-np.linalg.solve(Ja, Jb).T, np.eye(m - s)])
    ub = -alpha * reduction @ T.T @ S.T @ gradient
    ua = np.linalg.solve(Ja, rate - Jb @ ub)
    return T @ np.concatenate([ua, ub])


def reduced_gradient_on_arm(
    Jp: Array, Jm: Array, G: Array, rate: Array, gradient_p: Array, gradient_m: Array, alpha: float = 10.0
) -> Array:
    """The special case Ja = Jm (n_m = s); the printed up has dimensions that do not match."""
    up = -alpha * (G.T @ gradient_p - np.linalg.solve(Jm, Jp @ G).T @ gradient_m)
    return np.concatenate([up, np.linalg.solve(Jm, rate - Jp @ G @ up)])


def projected_gradient(J: Array, rate: Array, gradient: Array, S: Array, alpha: float = 10.0) -> Array:
    """Eqs. (5) and (7), with the pseudoinverse and the projector written out."""
    inverse = np.linalg.pinv(J)
    return inverse @ rate - alpha * (np.eye(J.shape[1]) - inverse @ J) @ S.T @ gradient


def extended_jacobian(J: Array, rate: Array, Jc: Array, rate_c: Array) -> Array:
    return np.linalg.solve(np.vstack([J, Jc]), np.concatenate([rate, rate_c]))


def runge_kutta(velocity: Callable[[float, Array], Array], q: Array, times: Array, steps: int = 1) -> Array:
    """q at `times` (N, n) of q_dot = velocity(t, q), by the classical fourth-order method."""
    found = [np.array(q, dtype=float)]
    for begin, end in pairwise(times):
        q, dt = found[-1], (end - begin) / steps
        for t in begin + dt * np.arange(steps):
            k1 = velocity(t, q)
            k2 = velocity(t + dt / 2, q + dt / 2 * k1)
            k3 = velocity(t + dt / 2, q + dt / 2 * k2)
            k4 = velocity(t + dt, q + dt * k3)
            q = q + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        found.append(q)
    return np.array(found)
