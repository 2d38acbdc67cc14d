"""The checks of lab 3: an arm in space, and tasks beside the first. By laws alone: nmm is not asked."""

from __future__ import annotations

import numpy as np

from check.lab_1 import U
from check.verdicts import Matrix, Wrong, called, exercise, numbers, one_number, shaped

TWIST = ("v_x", "v_y", "v_z", "omega_x", "omega_y", "omega_z")
LENGTHS = (0.3, 0.5, 0.3)
_random = np.random.default_rng(13)


def turned(vector: Matrix, by: Matrix) -> Matrix:
    """A vector (3,) turned by a rotation vector (3,), rad, as Rodrigues has it."""
    angle = np.linalg.norm(by)
    if angle == 0.0:
        return vector
    axis = by / angle
    return (
        np.cos(angle) * vector
        + np.sin(angle) * np.cross(axis, vector)
        + (1 - np.cos(angle)) * (axis @ vector) * axis
    )


def _rotation(by: Matrix) -> Matrix:
    return np.stack([turned(column, by) for column in np.eye(3)], axis=1)


def _unit(count: int) -> Matrix:
    vector = _random.normal(size=count)
    return vector / np.linalg.norm(vector)


def _twist_by_differences(axis: Matrix, point: Matrix, hand: Matrix) -> Matrix:
    step = 1e-5
    ahead, behind = (point + turned(hand - point, sign * step * axis) for sign in (1, -1))
    return np.concatenate([(ahead - behind) / (2 * step), axis])


@exercise
def joint_column(column: object) -> str:
    for _ in range(10):
        axis, point, hand = _unit(3), _random.normal(size=3), _random.normal(size=3)
        given, right = called(column, axis, point, hand), _twist_by_differences(axis, point, hand)
        shaped("joint_column", given, TWIST)
        if np.allclose(given, right, atol=1e-8):
            continue
        if np.allclose(given, np.roll(right, 3), atol=1e-8):
            raise Wrong("joint_column: the linear velocity comes first, then the angular one")
        if np.allclose(given[:3], -right[:3], atol=1e-8):
            raise Wrong("joint_column: the hand moves the other way: a × b = -(b × a)")
        if np.allclose(given[:3], np.cross(axis, hand), atol=1e-8):
            raise Wrong("joint_column: this axis passes through the origin. Where does it pass?")
        where = "linear" if np.allclose(given[3:], axis) else "angular"
        raise Wrong(f"joint_column: the {where} velocity is not right")
    return "a joint turns all that it carries about its axis"


def _chain() -> tuple[Matrix, list[tuple[Matrix, Matrix]], Matrix]:
    platform = _random.uniform(-2, 2, 3)
    return platform, [(_unit(3), _random.normal(size=3)) for _ in range(5)], _random.normal(size=3)


@exercise
def spatial_jacobian(J: object) -> str:
    columns = ("v", "omega", *(f"q{k + 1}" for k in range(5)))
    for _ in range(10):
        (x, y, theta), joints, hand = _chain()
        upright = (np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]))
        turning = [_twist_by_differences(*joint, hand) for joint in (upright, *joints)]
        ahead = np.array([np.cos(theta), np.sin(theta), 0, 0, 0, 0])
        right = np.stack([ahead, *turning], axis=1)
        given = called(J, np.array([x, y, theta]), joints, hand)
        hint = "x and y are no inputs: the wheels leave v and omega" if given.shape[-1] == 8 else ""
        shaped("J", given, TWIST, columns, hint)
        off = np.any(abs(given - right) > 1e-8, axis=0)
        if not off.any():
            continue
        if off[0] and np.allclose(given[:, 0], np.eye(6)[0]):
            raise Wrong("J: column v: the platform drives where it points, not along the world's x")
        if off[1] and np.allclose(given[:, 1], np.eye(6)[5]):
            raise Wrong("J: column omega: a platform that turns also carries the hand round")
        raise Wrong(f"J: column {', '.join(np.array(columns)[off])} not right")
    return "6 rows, 7 inputs: the platform is one more joint that turns, and one that drives"


@exercise
def rotation_vector(log: object) -> str:
    for angle in (1.0, 0.1, 2.0, 3.0, 1e-7):
        vector = angle * _unit(3)
        given = called(log, _rotation(vector))
        shaped("rotation_vector", given, ("x", "y", "z"))
        if np.allclose(given, vector, rtol=1e-6, atol=1e-12):
            continue
        if np.allclose(given, -vector, rtol=1e-6):
            raise Wrong("rotation_vector: it turns the other way: which entry of R - Rᵀ is which?")
        if np.allclose(given, np.sin(angle) * vector / angle):
            raise Wrong("rotation_vector: its length is sin φ; expected φ")
        if np.allclose(given, np.degrees(vector)):
            raise Wrong("rotation_vector: in degrees; all angles here are radians")
        if np.allclose(abs(given / np.linalg.norm(given) @ vector), angle):
            length = np.linalg.norm(given)
            raise Wrong(f"rotation_vector: the right axis; a turn of {angle:g} rad has length {length:.3g}")
        raise Wrong(f"rotation_vector: not right for a turn of {angle:g} rad")
    try:
        at_rest = called(log, np.eye(3))
    except Wrong as error:
        raise Wrong(f"at R = I: {error}") from None
    if np.linalg.norm(at_rest) > 1e-12:
        raise Wrong(f"rotation_vector: R = I is no turn at all; got {at_rest}")
    return "the turn about one axis that takes one orientation to another"


def planar(q: Matrix, lengths: tuple[float, float, float] = LENGTHS) -> tuple[Matrix, Matrix]:
    """The hand (2,) and its J (2, 4) of lab 1's robot, with lengths (d, l1, l2), m."""
    arms = np.array([[np.cos(a), np.sin(a)] for a in np.cumsum(q[2:])]) * np.array(lengths)[:, None]
    carried = np.cumsum(arms[::-1], axis=0)[::-1]
    turning = np.stack([-carried[:, 1], carried[:, 0]])
    drive = np.array([np.cos(q[2]), np.sin(q[2])])
    return q[:2] + arms.sum(axis=0), np.column_stack([drive, turning])


def _moved(q: Matrix, j: int, by: float) -> Matrix:
    """q after a small move of input j, to second order."""
    ahead = np.array([np.cos(q[2]), np.sin(q[2]), 0.0, 0.0, 0.0])
    return q + by * (ahead if j == 0 else np.eye(5)[1 + j])


def _slope(q: Matrix, j: int, T: Matrix, lengths: tuple[float, float, float], step: float = 1e-5) -> float:
    """How fast the arm's heading leaves the direction to T, as input j moves it: a central difference."""

    def off(at: Matrix) -> float:
        to = T - planar(at, lengths)[0]
        return float(at[2:].sum() - np.arctan2(to[1], to[0]))

    return (off(_moved(q, j, step)) - off(_moved(q, j, -step))) / (2 * step)


@exercise
def target_jacobian(J_bar: object) -> str:
    for _ in range(10):
        q, T = _random.uniform(-1.4, 1.4, 5), _random.uniform(4, 6, 2)
        d, l1, l2 = _random.uniform(0.2, 0.6, 3)
        lengths = d, l1, l2
        hand, J = planar(q, lengths)

        right = np.array([_slope(q, j, T, lengths) for j in range(4)])
        given = np.squeeze(called(J_bar, hand, J, T))
        shaped("J_bar", given, U)
        if np.allclose(given, right, atol=1e-7):
            continue
        link = np.array([0.0, 1.0, 1.0, 1.0])
        if np.allclose(given, link):
            raise Wrong("J_bar: this is J of the link's heading: the target moves, too, as the hand does")
        if np.allclose(given, 2 * link - right, atol=1e-7):
            raise Wrong("J_bar: the sign of ∂g/∂q: in which direction does T seem to move?")
        if np.allclose(given, link - right, atol=1e-7) or np.allclose(given, right - link, atol=1e-7):
            raise Wrong("J_bar: this is the target's part alone: and the link's?")
        raise Wrong(f"J_bar: {', '.join(np.array(U)[abs(given - right) > 1e-7])} not right")
    return "ė = -J̄ u: what the link does, less what its target does"


def _two_tasks(rows: int, more: int, inputs: int) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    normal = _random.normal
    return normal(size=(rows, inputs)), normal(size=rows), normal(size=(more, inputs)), normal(size=more)


@exercise
def extended_jacobian(EJ: object) -> str:
    for _ in range(10):
        J, rate, J_y, rate_y = _two_tasks(2, 2, 4)
        u = called(EJ, J, rate, J_y, rate_y)
        shaped("EJ", u, U)
        if not np.allclose(J @ u, rate, atol=1e-7):
            raise Wrong("EJ: J u is not the rate: the hand would not move as its task asks")
        if not np.allclose(J_y @ u, rate_y, atol=1e-7):
            raise Wrong("EJ: the hand's task is done, the added one is not: J_y u differs from rate_y")
    return "as many rows as inputs: nothing is left to choose"


@exercise
def algorithmic_singularity(q: object) -> str:
    at = numbers(q, "q")
    shaped("q", at, ("x", "y", "theta", "q1", "q2"))
    J, J_y = planar(at)[1], np.array([[0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    least = np.linalg.svd(np.vstack([J, J_y]), compute_uv=False)[-1]
    if least > 1e-6:
        raise Wrong(f"the smallest singular value of J_e is {least:.3g} there; expected 0, to 1e-6")
    alone = np.linalg.svd(J, compute_uv=False)[-1]
    if alone < 1e-3:
        raise Wrong("the hand's own J is singular there, too: look for a place where it is not")
    return f"J_e is singular; the hand's own J is not: its smallest singular value is {alone:.2f}"


@exercise
def priorities(prioritised: object) -> str:
    for rows, more in ((2, 1), (2, 2), (3, 3), (2, 4), (3, 4)):
        J_1, r_1, J_2, r_2 = _two_tasks(rows, more, 4)
        if more == 4:
            J_1[1] = J_1[0] + 1e-3 * J_1[1]  # as well conditioned as a robot's J may be, and no better
        u = called(prioritised, J_1, r_1, J_2, r_2)
        shaped("prioritised", u, U)
        if np.linalg.norm(u) > 1e8:
            raise Wrong(
                f"prioritised: ‖u‖ = {np.linalg.norm(u):.0e}: a singular value that is 0, but for rounding, "
                "was inverted"
            )
        if not np.allclose(J_1 @ u, r_1, atol=1e-7):
            raise Wrong(f"prioritised: the first task ({rows} rows) is spoilt by the second ({more} rows)")
        left = np.linalg.svd(J_1)[2][rows:].T  # a basis of what the first task leaves
        first = np.linalg.pinv(J_1) @ r_1
        best = first + left @ np.linalg.lstsq(J_2 @ left, r_2 - J_2 @ first)[0]
        wanted, given = (np.linalg.norm(J_2 @ one - r_2) for one in (best, u))
        if given > wanted + 1e-7:
            raise Wrong(
                f"prioritised: the second task is off by {given:.3g}; with what the first leaves "
                f"{wanted:.3g} can be had"
            )
    return "the first task is done, the second as well as the first allows"


@exercise
def ellipsoid(semi_axes: object) -> str:
    for rows, inputs in ((2, 4), (3, 7), (2, 2)):
        J = _random.normal(size=(rows, inputs))
        given, names = called(semi_axes, J), [f"row {k + 1}" for k in range(rows)]
        shaped("semi_axes", given, names, [f"axis {k + 1}" for k in range(rows)])
        between = given.T @ given
        lengths, right = np.sqrt(np.diag(between)), np.linalg.svd(J, compute_uv=False)
        if not np.allclose(between, np.diag(lengths**2), atol=1e-8):
            aside = given @ given.T
            if np.allclose(aside, np.diag(np.diag(aside)), atol=1e-8):
                raise Wrong("semi_axes: each column is an axis; here they are rows")
            raise Wrong("semi_axes: they are not at right angles")
        if np.allclose(np.sort(lengths), np.sort(right**2)):
            raise Wrong("semi_axes: their lengths are squares: eigenvalues of J Jᵀ are σ²")
        if np.allclose(lengths, 1.0):
            raise Wrong("semi_axes: the right angles, but all lengths are 1")
        if not np.allclose(given @ given.T, J @ J.T, atol=1e-8):
            raise Wrong("semi_axes: the ellipsoid of these axes is not that of J u with ‖u‖ = 1")
        if np.any(np.diff(lengths) > 1e-9):
            raise Wrong("semi_axes: the longest comes first")
    return "σ_k along the left singular vectors"


@exercise
def speed_along(speed: object) -> str:
    for rows, inputs in ((2, 4), (3, 7), (2, 2)):
        J, direction = _random.normal(size=(rows, inputs)), _unit(rows)
        given = one_number(speed, J, direction)
        least = np.linalg.norm(np.linalg.lstsq(J, direction)[0])  # of the inputs for 1 m/s
        if np.isclose(given, least) and not np.isclose(least, 1.0):
            raise Wrong("speed: upside down: these are the inputs that 1 m/s needs")
        if np.isclose(given, np.linalg.norm(J.T @ direction)):
            raise Wrong(
                "speed: so far does the ellipsoid reach along it, but there the hand also moves across it"
            )
        if not np.isclose(given, 1 / least):
            raise Wrong(f"speed: with inputs of length 1 it is {1 / least:.3g}, not {given:.3g}")
    return "from the middle of the ellipsoid to its surface"
