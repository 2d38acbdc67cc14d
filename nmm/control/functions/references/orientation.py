"""Orientations and poses as references: rotation vectors from other notations, and turns in time."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, matrix, nonzero_vector, positive, scalar, vector
from nmm.base.errors import expect
from nmm.base.kernels.compiled import kernel, scratch
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.rotations import (
    between3,
    compose3,
    exp3,
    left_jacobian_inverse3,
    log3,
    transposed_times3,
)
from nmm.control.functions.function import Function, Row, Stage, named, stacked
from nmm.control.functions.references.polynomial import Constant, Profile, share_of_way
from nmm.model.robots.robot import Robot

#: How far RᵀR may be from the identity, and a quaternion from length 1.
SLACK = 1e-6
ROWS = tuple(Row(name, "rad") for name in ("rx", "ry", "rz"))

#: A rotation vector φ (3,), rad: R = exp(φ^).
RotationVector = ArrayLike


@kernel(FUNCTION)
def turning(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """φ = log(exp(φ0) exp(a s)), φ_dot = Jr(φ)⁻¹ a s_dot; s(t) a polynomial, at rest outside [t0, t1];
    numbers = [φ0, a, t0, t1, coefficients of s, highest power first]."""
    outside = at.t < numbers[6] or at.t > numbers[7]
    local = min(max(at.t, numbers[6]), numbers[7])
    s = 0.0
    s_t = 0.0
    for k in range(8, numbers.shape[0]):
        s_t = s_t * local + s
        s = s * local + numbers[k]
    axis, rate = scratch(3), scratch(3)
    for i in range(3):
        axis[i] = numbers[3 + i] * s
        rate[i] = 0.0 if outside else numbers[3 + i] * s_t
    first, turn, R = scratch((3, 3)), scratch((3, 3)), scratch((3, 3))
    exp3(numbers[:3], first)
    exp3(axis, turn)
    compose3(first, turn, R)
    log3(R, rows.value)
    left_jacobian_inverse3(rows.value, turn)
    transposed_times3(turn, rate, rows.value_t)


class _Turning(Function):
    """An orientation that turns about a fixed axis; `turning` reads its numbers."""

    @abstractmethod
    def __init__(self, *numbers: ArrayLike) -> None:
        self._numbers = np.concatenate(numbers)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return ROWS

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(turning, 3, (), self._numbers),)


class SteadyTurn(_Turning):
    """An orientation that turns at constant rate: R(t) = R0 exp(a rate t), as a rotation vector, rad.

    Parameters
    ----------
    axis : a, three numbers, in the axes of the orientation itself; its length is not read
    rate : rad/s
    start : at t = 0, R0: a rotation vector (3,), rad; the world's axes when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> turn = nmm.SteadyTurn([0, 0, 1], rate=0.5)
    >>> nmm.evaluate(turn, 1.0, nmm.Configuration(robot, robot.rest)).value
    array([0. , 0. , 0.5])
    """

    def __init__(self, axis: ArrayLike, rate: float, start: RotationVector | None = None) -> None:
        direction = nonzero_vector(axis, 3, "axis")
        direction = direction / float(np.linalg.norm(direction))
        first = np.zeros(3) if start is None else vector(start, 3, "start")
        super().__init__(first, direction, [-np.inf, np.inf], [scalar(rate, "rate"), 0.0])


class Slerp(_Turning):
    """From one orientation to another by the shortest turn, then at rest, as a rotation vector, rad.

    R(t) = R0 exp(log(R0ᵀR1) s(t)), s from 0 to 1. Between orientations that are π apart exactly there are two
    shortest turns; one of them is taken.

    Parameters
    ----------
    start : R0: a rotation vector (3,), rad (`rotation_vector`)
    end : where it ends, R1
    duration : s, above 0
    profile : "constant" speed, or "smooth", a fifth-degree polynomial from rest to rest

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> turn = nmm.Slerp(start=[0, 0, 0], end=[0, 0, 1], duration=2)
    >>> nmm.evaluate(turn, 1.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([0. , 0. , 0.5])
    """

    def __init__(
        self, start: RotationVector, end: RotationVector, duration: float, profile: Profile = "constant"
    ) -> None:
        first, last = vector(start, 3, "start"), vector(end, 3, "end")
        T = positive(duration, "duration")
        share = share_of_way(profile, T)
        (R0, R1, between), turn = np.empty((3, 3, 3)), np.empty(3)
        exp3(first, R0)
        exp3(last, R1)
        between3(R0, R1, between)
        log3(between, turn)
        super().__init__(first, turn, [0.0, T], share)


def rotation_vector(
    *, rpy: ArrayLike | None = None, quaternion: ArrayLike | None = None, matrix: ArrayLike | None = None
) -> Array:
    """The rotation vector φ (3,), rad, |φ| <= π, of an orientation in another notation.

    Parameters
    ----------
    rpy : (3,) roll, pitch, yaw, rad: R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF
    quaternion : (4,) x, y, z, w, of length 1
    matrix : (3, 3) R

    Raises
    ------
    InputError : not exactly one of them, a quaternion of another length, a matrix that is no rotation

    Examples
    --------
    >>> nmm.rotation_vector(rpy=[0, 0, 0.5])
    array([0. , 0. , 0.5])
    """
    forms = {"rpy": rpy, "quaternion": quaternion, "matrix": matrix}
    names = [name for name, value in forms.items() if value is not None]
    expect(len(names) == 1, "orientation", f"one of {', '.join(forms)}", names)
    phi = np.empty(3)
    if rpy is not None:
        log3(_from_rpy(rpy), phi)
    elif quaternion is not None:
        log3(_from_quaternion(quaternion), phi)
    elif matrix is not None:
        log3(_rotation(matrix), phi)
    return phi


def _from_rpy(rpy: ArrayLike) -> Array:
    R = np.eye(3)
    turn = np.empty((3, 3))
    for axis, angle in zip(np.eye(3), vector(rpy, 3, "rpy"), strict=True):
        exp3(axis * angle, turn)
        R = turn @ R
    return np.ascontiguousarray(R)


def _from_quaternion(quaternion: ArrayLike) -> Array:
    xyzw = vector(quaternion, 4, "quaternion")
    length = float(np.linalg.norm(xyzw))
    expect(abs(length - 1.0) <= SLACK, "quaternion", "x, y, z, w of length 1", xyzw)
    x, y, z, w = xyzw / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _rotation(value: ArrayLike) -> Array:
    R = matrix(value, (3, 3), "matrix")
    rotation = np.abs(R.T @ R - np.eye(3)).max() <= SLACK and np.linalg.det(R) >= 0.0
    expect(rotation, "matrix", "a rotation (orthonormal columns, determinant 1)")
    return R


class PoseReference(Function):
    """A position over an orientation, (6,): the target of a pose.

    Parameters
    ----------
    position : three numbers (world axes, m), or a function of three rows
    orientation : a rotation vector, rad, or a function of three rows (slerp, turn, orientation, ...)

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> target = nmm.PoseReference(nmm.Line([0, 0, 1], [1, 0, 1], duration=2), [0, 0, 0.5])
    >>> nmm.evaluate(target, 1.0, nmm.Configuration(robot, robot.rest)).value
    array([0.5, 0. , 1. , 0. , 0. , 0.5])
    """

    def __init__(self, position: Function | ArrayLike, orientation: Function | RotationVector) -> None:
        self.position = _three(position, "position", "m")
        self.orientation = _three(orientation, "orientation", "rad")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        rows = []
        for name, unit in (("position", "m"), ("orientation", "rad")):
            components = getattr(self, name).rows(robot)
            expect(len(components) == 3, name, f"three components, {unit}", named(components))
            rows += [Row(row.name, unit) for row in components]
        return tuple(rows)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return stacked((self.position, self.orientation), robot)


def _three(value: Function | ArrayLike, name: str, unit: str) -> Function:
    return value if isinstance(value, Function) else Constant(vector(value, 3, name), unit)
