"""The checks of lab 1: the model and its redundancy."""

from __future__ import annotations

from math import pi

import numpy as np

import nmm
from check.verdicts import Matrix, Wrong, called, compared, exercise, in_degrees, numbers, shaped
from nmm.control.resolvers import Problem

ROBOT = nmm.load("unicycle_2r")
Q, U, HAND = ROBOT.q_names, ROBOT.u_names, ("ee.x", "ee.y")
_random = np.random.default_rng(2006)
SAMPLES = _random.uniform(-1.4, 1.4, (20, ROBOT.n))


def _hand(q: Matrix) -> Matrix:
    return nmm.Configuration(ROBOT, q).placement("ee").translation[:2]


def _jacobian(q: Matrix) -> Matrix:
    configuration = nmm.Configuration(ROBOT, q)
    return configuration.jacobian("ee")[:2] @ configuration.S


@exercise
def platform(G: object) -> str:
    compared(G, lambda q: ROBOT.S(q)[:3, :2], SAMPLES, Q, Q[:3], U[:2])
    return "the platform goes where it points, and never sideways"


@exercise
def all_coordinates(S: object) -> str:
    compared(S, ROBOT.S, SAMPLES, Q, Q, U)
    return "q_dot = S(q) u"


@exercise
def hand(f: object) -> str:
    compared(f, _hand, SAMPLES, Q, HAND)
    return "the hand is where the robot's file says"


@exercise
def jacobian(J: object) -> str:
    missing = "a column for each coordinate. The robot is moved by its inputs: where is S?"
    compared(J, _jacobian, SAMPLES, Q, HAND, U, missing)
    return "the hand moves with J(q) u"


@exercise
def redundancy(counts: object) -> str:
    rows = {"position": 2, "position and heading": 3}
    for task, s in rows.items():
        given = numbers(counts.get(task) if isinstance(counts, dict) else counts, f"redundancy of {task}")
        shaped(f"redundancy of {task}", given, ("static", "kinematic"))
        wanted = (ROBOT.n - s, ROBOT.n_u - s)
        if tuple(given) == wanted[::-1]:
            raise Wrong(f"{task}: right numbers, swapped. Which counts coordinates, which inputs?")
        for kind, one, other in zip(("static", "kinematic"), given, wanted, strict=True):
            if one != other:
                raise Wrong(f"{task}: the degree of {kind} redundancy is not {one:g}")
    return "the wheels take one freedom, the task takes its rows"


def _gradient(q: Matrix, upright: float = pi / 2, q1: float = pi / 4) -> Matrix:
    objective = nmm.Quadratic(
        nmm.QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, upright), nmm.QuadraticTerm("q1", q1)
    )
    return ROBOT.S(q).T @ objective.gradient(nmm.Configuration(ROBOT, q))


@exercise
def gradient(h: object) -> str:
    q = SAMPLES[0]
    given = called(h, q)
    if given.shape == (ROBOT.n,):
        raise Wrong(
            "h: 5 numbers are ∂H/∂q, of the coordinates. What do the 4 inputs feel of it? Where is S?"
        )
    for targets, angle in (((pi / 2, 45.0), 45), ((90.0, pi / 4), 90), ((90.0, 45.0), 90)):
        if np.shape(given) == (ROBOT.n_u,) and np.allclose(given, _gradient(q, *targets)):
            raise Wrong(f"h: {in_degrees(angle)}")
    compared(h, _gradient, SAMPLES, Q, U)
    return "dH/dt = h · u"


def problems() -> list[tuple[Matrix, Matrix, Matrix, float]]:
    """J, rate, h, α at random configurations."""
    return [
        (_jacobian(q), _random.normal(size=2), _random.normal(size=4), float(_random.uniform(1, 10)))
        for q in SAMPLES
    ]


def _does_the_task(name: str, J: Matrix, u: Matrix, rate: Matrix) -> None:
    shaped(name, u, U, hint="@ multiplies matrices, * multiplies entry by entry" if u.ndim == 2 else "")
    if not np.allclose(J @ u, rate, atol=1e-8):
        raise Wrong(f"{name}: J u is not the rate: the hand would not move as the task asks")


@exercise
def projected_gradient(PG: object) -> str:
    for J, rate, h, alpha in problems():
        plain, u = called(PG, J, rate, 0 * h, alpha), called(PG, J, rate, h, alpha)
        _does_the_task("PG with h = 0", J, plain, rate)
        if not np.allclose(plain, np.linalg.lstsq(J, rate)[0], atol=1e-8):
            raise Wrong("PG with h = 0: it does the task, but smaller inputs would do it, too")
        if not np.allclose(J @ u, rate, atol=1e-8):
            raise Wrong("PG: its part with h moves the hand: it has to be projected into the null space of J")
        if h @ (u - plain) > 0:
            raise Wrong("PG: its part with h climbs H: look at the sign")
        wanted = nmm.ProjectedGradient(alpha).resolve(Problem(J, rate, h)).u
        if not np.allclose(u, wanted, atol=1e-8):
            raise Wrong(
                "PG: it does the task, but the rest is not -alpha (I - J⁺ J) h: is h in it, and alpha, once?"
            )
    return "the hand does its task, and H descends with what is left"


@exercise
def reduced_gradient(RG: object) -> str:
    for J, rate, h, alpha in problems():
        for basic in ([0, 1], [0, 2], [2, 0]):
            free = [j for j in range(4) if j not in basic]
            u = called(RG, J, rate, h, alpha, basic)
            shaped("RG", u, U)
            resolver = nmm.ReducedGradient(alpha, partitions=[[f"u{j}" for j in basic]], threshold=1e-9)
            wanted = resolver.resolve(Problem(J, rate, h)).u
            if np.allclose(u, wanted, rtol=1e-6, atol=1e-8):
                continue
            if np.allclose(u, wanted[[*basic, *free]], rtol=1e-6, atol=1e-8):
                raise Wrong(
                    "RG: these are (u_a, u_b) one after the other: put each where its input stands in u"
                )
            _does_the_task(f"RG with u_a = {basic}", J, u, rate)
            if np.allclose(u[free], -wanted[free], rtol=1e-6):
                raise Wrong("RG: u_b climbs H: look at its sign")
            if np.allclose(u[free], -alpha * h[free]):
                raise Wrong("RG: u_b descends by h_b alone. But u_b moves u_a, and that changes H, too")
            change = np.linalg.solve(J[:, basic], J[:, free])
            if np.allclose(u[free], -alpha * (h[free] - change @ h[basic])):
                raise Wrong("RG: a matrix is transposed, or one is not that should be (2 x 2 hides it)")
            raise Wrong("RG: it does the task, but u_b is not as in eq. (10): is h in it, and alpha, once?")
    return "u_b descends H, u_a does the task, without a pseudoinverse"


@exercise
def singular_block(q: object) -> str:
    at = numbers(q, "q")
    shaped("q", at, Q)
    if turned := [angle for angle in at[2:] if abs(angle) >= 7 and float(angle).is_integer()]:
        raise Wrong(f"q: {in_degrees(turned[0])}")
    J = _jacobian(at)
    determinant = np.linalg.det(J[:, [0, 2]])
    if abs(determinant) > 1e-6:
        raise Wrong(f"det J_a = {determinant:.3g} there, for u_a = (v, q1)")
    least = np.linalg.svd(J, compute_uv=False)[-1]
    return f"det J_a = 0, and yet the robot is not singular: the smallest singular value of J is {least:.2f}"


@exercise
def far_from_the_axle(d: object) -> str:
    value = float(np.ravel(numbers(d, "d"))[0])
    a, b = np.meshgrid(np.linspace(-pi, pi, 181), np.linspace(-pi, pi, 181))
    minor = value + 0.5 * np.cos(a) + 0.3 * np.cos(a + b)
    if minor.min() * minor.max() <= 1e-9:
        i = np.unravel_index(np.argmin(abs(minor)), minor.shape)
        raise Wrong(
            f"with d = {value:g} m the block of (v, omega) is singular near q1 = {a[i]:.2f}, q2 = {b[i]:.2f}"
        )
    return f"with d = {value:g} m the block of (v, omega) can be inverted everywhere: no switching is needed"
