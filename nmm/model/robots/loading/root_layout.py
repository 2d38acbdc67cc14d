"""The root's part of a Pinocchio configuration: x, y, θ as three joints, a planar joint, or a free flyer.

Points and velocities of the plane are complex numbers.
"""

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from nmm.base.arrays import Array
from nmm.base.errors import InputError

# How far a root may be from upright or its height, or a pair from unit length: numbers have a few digits.
_LEVEL = 1e-6


class ChainRoot:
    """Between (x, y, θ) of the reference point, N rows, and a model's chain x, y, theta.
    offset : x, y, z (m) and yaw (rad) of the model's root in the axes of the reference point"""

    nq, nv = 3, 3
    #: Pinocchio's joint; None for the chain.
    joint: Any = None

    def __init__(self, offset: Array) -> None:
        x, y, self._z, self._yaw = (float(value) for value in offset)
        self._offset = complex(x, y)
        if self.nq < 7 and abs(self._z) > _LEVEL:
            expected = "a root as high as the reference point, m: only a free flyer has a height"
            raise InputError(where="model: z", expected=expected, got=self._z)

    def configuration(self, pose: Array) -> Array:
        """The root's configuration (N, nq) at (x, y, θ) (N, 3)."""
        return _rows(_plane(pose) + self._lever(pose[:, 2]), pose[:, 2] + self._yaw)

    def coordinates(self, configuration: Array) -> Array:
        """(x, y, θ), (N, 3), of a configuration (N, nq), θ up to full turns."""
        theta = configuration[:, 2] - self._yaw
        return _rows(_plane(configuration) - self._lever(theta), theta)

    def velocity(self, pose: Array, rates: Array) -> Array:
        """The root's velocity (N, nv) at (x, y, θ) and their rates, (N, 3)."""
        return self._moved_rates(pose, rates, 1.0)

    def rates(self, pose: Array, velocity: Array) -> Array:
        """The rates of (x, y, θ), (N, 3), of the root's velocity (N, nv)."""
        return self._moved_rates(pose, velocity, -1.0)

    def _lever(self, theta: Array) -> NDArray[np.complex128]:
        """From the reference point to the root, in the world's axes."""
        return self._offset * np.exp(1j * theta)

    def _moved_rates(self, pose: Array, rates: Array, sign: float) -> Array:
        """Velocity of the root's own x, y, θ (the lever turns with θ); with sign -1, the way back."""
        return _rows(_plane(rates) + sign * 1j * rates[:, 2] * self._lever(pose[:, 2]), rates[:, 2])


class PlanarRoot(ChainRoot):
    """(x, y, cos θ, sin θ); velocity along the body's axes."""

    nq, nv = 4, 3
    joint = pin.JointModelPlanar
    #: Those of the root's nv velocities that move it in the plane: along its own x and y, and its turn.
    planar: tuple[int, int, int] = (0, 1, 2)

    def configuration(self, pose: Array) -> Array:
        moved = super().configuration(pose)
        return np.column_stack([moved[:, :2], np.cos(moved[:, 2]), np.sin(moved[:, 2])])

    def coordinates(self, configuration: Array) -> Array:
        x, y, cosine, sine = configuration.T
        _check(np.abs(np.hypot(cosine, sine) - 1.0), "cos θ, sin θ", "a pair of unit length")
        return super().coordinates(np.column_stack([x, y, np.arctan2(sine, cosine)]))

    def velocity(self, pose: Array, rates: Array) -> Array:
        moved, result = super().velocity(pose, rates), np.zeros((len(pose), self.nv))
        result[:, self.planar] = _rows(_plane(moved) / self._axes(pose), moved[:, 2])
        return result

    def rates(self, pose: Array, velocity: Array) -> Array:
        body = velocity[:, self.planar]
        return super().rates(pose, _rows(_plane(body) * self._axes(pose), body[:, 2]))

    def _axes(self, pose: Array) -> NDArray[np.complex128]:
        return np.exp(1j * (pose[:, 2] + self._yaw))


class FreeFlyerRoot(PlanarRoot):
    """(x, y, z, quaternion x y z w); velocity along the body's axes, linear and angular."""

    nq, nv = 7, 6
    joint = pin.JointModelFreeFlyer
    planar = (0, 1, 5)

    def configuration(self, pose: Array) -> Array:
        moved, nothing = ChainRoot.configuration(self, pose), np.zeros(len(pose))
        half = 0.5 * moved[:, 2]
        height = np.full(len(pose), self._z)
        return np.column_stack([moved[:, :2], height, nothing, nothing, np.sin(half), np.cos(half)])

    def coordinates(self, configuration: Array) -> Array:
        x, y, z, qx, qy, qz, qw = configuration.T
        length = np.linalg.norm(configuration[:, 3:], axis=1)
        _check(np.abs(length - 1.0), "quaternion", "one of unit length")
        _check(np.abs(z - self._z), "z", f"{self._z:g} m: the platform stays on its plane")
        _check(np.hypot(qx, qy), "roll and pitch", "0: the platform stays upright")
        return ChainRoot.coordinates(self, np.column_stack([x, y, 2.0 * np.arctan2(qz, qw)]))

    def rates(self, pose: Array, velocity: Array) -> Array:
        off = np.abs(velocity[:, 2:5]).max(axis=1, initial=0.0)
        _check(off, "velocity along z, about x and y", "0")
        return super().rates(pose, velocity)


ROOTS: dict[str, type[ChainRoot]] = {"planar": PlanarRoot, "freeflyer": FreeFlyerRoot, "chain": ChainRoot}


def _plane(rows: Array) -> NDArray[np.complex128]:
    return rows[:, 0] + 1j * rows[:, 1]


def _rows(plane: NDArray[np.complex128], turn: Array) -> Array:
    return np.column_stack([plane.real, plane.imag, turn])


def _check(off: Array, where: str, expected: str) -> None:
    if off.size and off.max() > _LEVEL:
        row = int(off.argmax())
        place = f"row {row}: {where}" if off.size > 1 else where
        raise InputError(where=place, expected=f"{expected}, to {_LEVEL:g}", got=float(off[row]))
