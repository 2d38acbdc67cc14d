"""Answers to the exercises of the lab, right ones and the usual wrong ones, and words of the verdict."""

from __future__ import annotations

from typing import Any

import numpy as np
import twin
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

import nmm


def with_column(matrix: np.ndarray, column: int, factor: float) -> np.ndarray:
    changed = matrix.copy()
    changed[:, column] *= factor
    return changed


def degrees(q: np.ndarray) -> np.ndarray:
    """The configuration of one who takes its angles for degrees."""
    return np.concatenate([q[:2], np.radians(q[2:])])


def relative(q: np.ndarray) -> np.ndarray:
    """The Jacobian of one who forgets that the links stand on a platform that turns."""
    return np.hstack([robot.J(q)[:, :2], robot.J(np.concatenate([q[:2], [0.0], q[3:]]))[:, 2:]])


robot = twin.Planar()


def h(q: np.ndarray) -> np.ndarray:
    return twin.S(q).T @ twin.H1(q)[1]


def pg(J, rate, h, alpha, part=lambda N, h: N @ h, sign=-1.0):
    inverse = np.linalg.pinv(J)
    return inverse @ rate + sign * alpha * part(np.eye(4) - inverse @ J, h)


def damped(J, rate, h, alpha):
    return J.T @ np.linalg.solve(J @ J.T + 0.1 * np.eye(2), rate)


def rg(J, rate, h, alpha, basic, change=lambda A: A.T, sign=-1.0, ordered=True):
    free = [j for j in range(4) if j not in basic]
    u = np.zeros(4)
    u[free] = sign * alpha * (h[free] - change(np.linalg.solve(J[:, basic], J[:, free])) @ h[basic])
    u[basic] = np.linalg.solve(J[:, basic], rate - J[:, free] @ u[free])
    return u if ordered else u[[*basic, *free]]


def rate(t, q, feed=1.0, gain=1.0):
    r_d, r_d_dot = twin.circle(t)
    return feed * r_d_dot + gain * (r_d - robot.f(q))


def inputs(t, q):
    return pg(robot.J(q), rate(t, q), h(q), 10.0)


def column(axis, point, hand, sign=1.0):
    arm = hand - point
    return np.concatenate(
        [
            sign * np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]]) @ arm,
            axis,
        ]
    )


def spatial(platform, joints, hand, drive=None, carried=1.0):
    x, y, theta = platform
    upright = column(np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]), hand)
    upright[:3] *= carried
    ahead = [np.cos(theta), np.sin(theta), 0, 0, 0, 0] if drive is None else drive
    return np.array([ahead, upright, *(column(*joint, hand) for joint in joints)]).T


def logarithm(R):
    return Rotation.from_matrix(R).as_rotvec()


def without_limit(R):
    sine_axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = np.linalg.norm(sine_axis)
    with np.errstate(invalid="ignore"):
        return np.arctan2(sine, (np.trace(R) - 1) / 2) * sine_axis / sine


def pointing(hand, J, T, link=1.0, target=1.0):
    """The bearing is the angle of a complex number, which turns by Im(ż / z)."""
    bearing = (-(J[0] + 1j * J[1]) / complex(*(T - hand))).imag
    return link * np.array([0, 1, 1, 1]) - target * bearing


def levels(J_1, r_1, J_2, r_2, bound=1e-9, rest=True, projected=True):
    """Along a basis of what the first leaves, where the solution has a projector."""
    first = np.linalg.lstsq(J_1, r_1)[0]
    left = null_space(J_1)
    A = J_2 @ left if projected else J_2
    more = np.linalg.pinv(A, bound) @ (r_2 - (J_2 @ first if rest else 0))
    return first + (left @ more if projected else more)


def rounded(J_1, r_1, J_2, r_2):
    """With a projector whose singular values of 0 are inverted, but for rounding."""
    inverse = np.linalg.pinv(J_1)
    N = np.eye(4) - inverse @ J_1
    return inverse @ r_1 + np.linalg.pinv(J_2 @ N, 1e-30) @ (r_2 - J_2 @ inverse @ r_1)


def axes(J, power=0.5):
    squares, directions = np.linalg.eigh(J @ J.T)
    return (directions * squares**power)[:, ::-1]


def stops(q):
    return robot.J(q) @ np.eye(3)


LIMITS = nmm.Limits(
    velocity={"v": 0.8, "omega": 1.5, "arm": 1.5}, acceleration={"v": 1.5, "omega": 4, "arm": 6}
)
DESIGN: dict[str, Any] = {
    "gain": 2.0,
    "resolver": nmm.ProjectedGradient(alpha=1.0),
    "objective": nmm.PreferredPosture({"q1": 0.6, "q2": -1.2}),
    "limits": LIMITS,
}

#: Of each exercise: an answer, and words of the verdict. What is right is the twin's, where nmm has no part.
ANSWERS: list[tuple[str, Any, str]] = [
    ("platform", twin.G, "✓ right"),
    ("platform", lambda q: twin.G(degrees(q)), "degrees"),
    ("platform", lambda q: twin.G(q).T, r"expected 3 rows .* and 2 columns .*, got 2 x 3: it is transposed"),
    ("platform", lambda q: twin.G(q)[[1, 0, 2]], "column v .*not right"),
    ("platform", lambda q: twin.G(q)[:, ::-1], "column v is what belongs in column omega"),
    ("platform", lambda q: -twin.G(q), "column v .*, column omega .* has the wrong sign"),
    ("platform", twin.G(np.zeros(5)), r"expected the function itself, without \(q\)"),
    ("platform", lambda q: [[np.cos(q[2]), ...], [0, 1], [0, 1]], "not yet"),
    ("all_coordinates", twin.S, "✓ right"),
    ("all_coordinates", lambda q: np.eye(5)[:, 1:], "column v .*not right"),
    ("hand", robot.f, "✓ right"),
    ("hand", lambda q: robot.f(degrees(q)), "degrees"),
    ("hand", lambda q: robot.f(q)[:1], r"expected 2 numbers \(ee.x, ee.y\), got 1"),
    ("hand", lambda q: twin.Planar(l2=0.2).f(q), "ee.x, ee.y not right"),
    ("jacobian", robot.J, "✓ right"),
    ("jacobian", lambda q: robot.J(q).T, "it is transposed"),
    ("jacobian", lambda q: np.zeros((2, 5)), "a column for each coordinate.*where is S"),
    (
        "jacobian",
        lambda q: with_column(robot.J(q), 2, -1.0),
        "column q1 has the wrong sign, the rest is right",
    ),
    ("jacobian", lambda q: robot.J(q)[:, [0, 1, 3, 2]], "column q1 is what belongs in column q2"),
    ("jacobian", lambda q: robot.J(degrees(q)), "degrees"),
    ("jacobian", relative, "column q1, column q2: right where theta = 0, and only there"),
    ("jacobian", lambda q: with_column(robot.J(q), 1, 0.5), "column omega is 0.5 times what it should be"),
    ("jacobian", lambda q: with_column(robot.J(q), 3, 0.0), "column q2 is 0, the rest is right"),
    (
        "jacobian",
        lambda q: with_column(robot.J(q), 1, 180 / np.pi),
        "column omega is 57.3 times what it should be",
    ),
    ("jacobian", twin.Planar(l1=0.4).J, r"column omega, column q1 not right, for example at q = \["),
    (
        "jacobian",
        lambda q: robot.J(q) * [[1, 1, 1, -1], [1] * 4],
        r"column q2 \(row ee.x\) has the wrong sign",
    ),
    ("hand", lambda q: robot.f([*q[:4], q[4] - q[3]]), "right where q1 = 0, and only there"),
    ("jacobian", stops, r"stops with ValueError: .*, at: return robot.J\(q\) @ np.eye\(3\)"),
    ("jacobian", lambda q: None, "not yet"),
    ("redundancy", {"position": (3, 2), "position and heading": (2, 1)}, "✓ right"),
    ("redundancy", {"position": (2, 3), "position and heading": (2, 1)}, "swapped"),
    ("redundancy", {"position": (3, 2), "position and heading": (2, 2)}, "kinematic redundancy is not 2"),
    ("gradient", h, "✓ right"),
    ("gradient", lambda q: twin.H1(q)[1], "5 numbers are .*H.*Where is S"),
    ("gradient", lambda q: h(q) + np.array([0, 0, np.pi / 4 - 45, 0]), "45 is in degrees: write pi / 4"),
    (
        "gradient",
        lambda q: h(q) - (90 - np.pi / 2) * np.array([0, 1, 1, 1]),
        "90 is in degrees: write pi / 2",
    ),
    ("gradient", lambda q: -h(q), "omega, q1, q2 has the wrong sign"),
    ("projected_gradient", pg, "✓ right"),
    ("projected_gradient", lambda *a: pg(*a, sign=1.0), "climbs H"),
    ("projected_gradient", lambda *a: pg(*a, part=lambda N, h: h), "moves the hand"),
    ("projected_gradient", lambda *a: pg(*a, part=lambda N, h: N * h), "got 4 x 4: @ multiplies matrices"),
    ("projected_gradient", damped, "J u is not the rate"),
    ("projected_gradient", lambda *a: rg(*a, [0, 1]), "smaller inputs would do it"),
    ("projected_gradient", lambda J, r, h, a: pg(J, r, h, 1.0), "is h in it, and alpha"),
    ("reduced_gradient", rg, "✓ right"),
    ("reduced_gradient", lambda *a: rg(*a, sign=1.0), "climbs H"),
    ("reduced_gradient", lambda *a: rg(*a, change=lambda A: A), "transposed"),
    ("reduced_gradient", lambda *a: rg(*a, change=lambda A: 0 * A), "descends by h_b alone"),
    ("reduced_gradient", lambda *a: rg(*a, ordered=False), "one after the other"),
    ("reduced_gradient", lambda J, r, h, a, b: pg(J, r, h, a), r"not as in eq\. \(10\)"),
    ("reduced_gradient", lambda J, r, h, a, b: rg(J, 0 * r, h, a, b), "J u is not the rate"),
    ("singular_block", [0, 0, 0.3, np.pi / 2, 0], "✓ right"),
    ("singular_block", [0, 0, 0, -90, 0], "-90 is in degrees: write -pi / 2"),
    ("singular_block", [0, 0, 0, 0, 0], "det J_a = 0.8 there"),
    ("singular_block", [0, 0, 0], r"expected 5 numbers"),
    ("far_from_the_axle", -0.81, "✓ right"),
    ("far_from_the_axle", 0.7, "is singular near q1"),
    ("task_rate", rate, "✓ right"),
    ("task_rate", lambda t, q: rate(t, q, feed=0.0), "follows the error alone"),
    ("task_rate", lambda t, q: rate(t, q, gain=0.0), "whatever the error is"),
    ("task_rate", lambda t, q: rate(t, q, gain=-1.0), "the sign of the error"),
    ("closed_loop", lambda t, q: twin.S(q) @ inputs(t, q), "✓ right"),
    ("closed_loop", inputs, "4 numbers are inputs u"),
    ("closed_loop", lambda t, q: np.insert(inputs(t, q), 1, 0.0), "q_dot: x, y not right"),
    ("euler", lambda v, t, q, dt: q + dt * v(t, q), "✓ right"),
    ("euler", lambda v, t, q, dt: dt * v(t, q), "gives the change"),
    ("euler", lambda v, t, q, dt: q + v(t, q), "is taken 10 times"),
    ("euler", lambda v, t, q, dt: q + dt * v(t + dt / 2, q + dt / 2 * v(t, q)), "at which t, and at which q"),
    ("fitted_gain", lambda t, e: np.log(e[0] / e[-1]) / (t[-1] - t[0]), "✓ right"),
    ("fitted_gain", lambda t, e: np.polyfit(t, np.log(e), 1)[0], "the sign"),
    ("fitted_gain", lambda t, e: -np.polyfit(t, np.log10(e), 1)[0], "natural logarithm"),
    ("fitted_gain", lambda t, e: -np.log(e[-1]) / t[-1], "begins with 2.5"),
    ("fitted_gain", lambda t, e: -np.polyfit(t, np.log(e), 1), "expected one number, got 2"),
    ("effort", lambda t, u: np.mean(np.sum(u**2, axis=1)) * (t[-1] - t[0]), "✓ right"),
    ("effort", lambda t, u: np.trapezoid(np.linalg.norm(u, axis=1), t), "for 8 s: 200; got 40"),
    ("effort", lambda t, u: 5 * np.trapezoid(np.linalg.norm(u, axis=1), t), "half of a constant's, 100"),
    ("peaks", lambda u: np.linalg.norm(u, np.inf, axis=0), "✓ right"),
    ("peaks", lambda u: u.max(axis=0), "an input of -7 has a peak of 7"),
    ("peaks", lambda u: abs(u).max(), "expected 4 numbers .*, got one number"),
    ("share_left", lambda J, u, r: np.linalg.norm(J @ u) / np.linalg.norm(r), "✓ right"),
    ("share_left", lambda J, u, r: np.linalg.norm(r) / max(np.linalg.norm(J @ u), 1e-9), "upside down"),
    ("design", DESIGN, "✓ right"),
    ("design", DESIGN | {"limits": None}, r"v changes by .* at most 1.5"),
    (
        "design",
        DESIGN | {"limits": nmm.Limits({"v": 0.8})},
        r"omega reaches .* at most 1.5.*omega changes",
    ),
    ("design", DESIGN | {"gain": 0.5}, r"the hand is off by .* cm at t = .*; at most 1 cm from 5 s on"),
    (
        "design",
        DESIGN | {"objective": None},
        r"q2 is between .*; from 5 s on it has to stay between -2 and -0.8",
    ),
    ("design", DESIGN | {"gain": -1}, "design: "),
    ("design", DESIGN | {"gain": ...}, "not yet: design: gain to be chosen"),
    ("design", {"gain": 1}, "expected a dictionary with gain, resolver, objective, limits"),
    ("joint_column", column, "✓ right"),
    ("joint_column", lambda a, p, r: np.roll(column(a, p, r), 3), "the linear velocity comes first"),
    ("joint_column", lambda a, p, r: column(a, p, r, sign=-1.0), "the other way"),
    ("joint_column", lambda a, p, r: column(a, 0 * p, r), "passes through the origin"),
    ("joint_column", lambda a, p, r: np.concatenate([column(a, p, r)[:3], 2 * a]), "the angular velocity"),
    ("joint_column", lambda a, p, r: column(a, p, r)[:3], "expected 6 numbers"),
    ("spatial_jacobian", spatial, "✓ right"),
    ("spatial_jacobian", lambda *a: spatial(*a, drive=[1, 0, 0, 0, 0, 0]), "where it points"),
    ("spatial_jacobian", lambda *a: spatial(*a, carried=0.0), "carries the hand round"),
    ("spatial_jacobian", lambda *a: np.insert(spatial(*a), 0, 0.0, axis=1), "the wheels leave v and omega"),
    ("spatial_jacobian", lambda p, joints, r: spatial(p, joints[::-1], r), "column q1, q2, q4, q5 not right"),
    ("rotation_vector", logarithm, "✓ right"),
    ("rotation_vector", lambda R: logarithm(R.T), "the other way"),
    ("rotation_vector", lambda R: np.sinc(np.linalg.norm(logarithm(R)) / np.pi) * logarithm(R), "is sin φ"),
    ("rotation_vector", lambda R: np.degrees(logarithm(R)), "in degrees"),
    ("rotation_vector", lambda R: 2 * logarithm(R), "a turn of 1 rad has length 2"),
    ("rotation_vector", without_limit, "at R = I: .*not finite"),
    ("target_jacobian", pointing, "✓ right"),
    ("target_jacobian", lambda *a: pointing(*a)[None], "✓ right"),
    ("target_jacobian", lambda *a: pointing(*a, target=0.0), "the target moves, too"),
    ("target_jacobian", lambda *a: pointing(*a, target=-1.0), "the sign of ∂g/∂q"),
    ("target_jacobian", lambda *a: pointing(*a, link=0.0), "and the link's"),
    ("extended_jacobian", lambda J, r, K, s: np.linalg.pinv(np.block([[J], [K]])) @ [*r, *s], "✓ right"),
    ("extended_jacobian", lambda J, r, K, s: np.linalg.pinv(J) @ r, "the added one is not"),
    (
        "extended_jacobian",
        lambda J, r, K, s: np.linalg.solve(np.vstack([K, J]), [*r, *s]),
        "J u is not the rate",
    ),
    ("algorithmic_singularity", [1, 2, 3, -np.arccos(-0.6), 1.0], "✓ right"),
    ("algorithmic_singularity", [0, 0, 0, 0, 0], "expected 0, to 1e-6"),
    ("algorithmic_singularity", [0, 0, 0], "expected 5 numbers"),
    ("priorities", levels, "✓ right"),
    ("priorities", lambda *a: levels(*a, rest=False), "can be had"),
    ("priorities", lambda *a: levels(*a, projected=False), "is spoilt by the second"),
    ("priorities", lambda J, r, K, s: np.linalg.lstsq(J, r)[0], "can be had"),
    ("priorities", rounded, "was inverted"),
    ("ellipsoid", axes, "✓ right"),
    ("ellipsoid", lambda J: axes(J, power=1.0), "squares"),
    ("ellipsoid", lambda J: axes(J, power=0.0), "all lengths are 1"),
    ("ellipsoid", lambda J: axes(J).T, "here they are rows"),
    ("ellipsoid", lambda J: axes(J)[:, ::-1], "the longest comes first"),
    ("ellipsoid", lambda J: 3 * axes(J), "is not that of J u"),
    ("ellipsoid", lambda J: J @ J.T, "not at right angles"),
    ("speed_along", lambda J, d: (d @ np.linalg.solve(J @ J.T, d)) ** -0.5, "✓ right"),
    ("speed_along", lambda J, d: np.linalg.norm(np.linalg.pinv(J) @ d), "upside down"),
    ("speed_along", lambda J, d: np.linalg.norm(J.T @ d), "moves across it"),
    ("speed_along", lambda J, d: np.linalg.norm(J), "with inputs of length 1 it is"),
]
