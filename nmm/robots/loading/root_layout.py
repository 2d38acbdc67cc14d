"""The root's part of a Pinocchio configuration: x, y, θ as a planar joint, a free flyer, or three joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.errors import InputError

# How far a root may be from upright or its height, or a pair from unit length: numbers have a few digits.
_LEVEL = 1e-6


class RootLayout(ABC):
    """Between (x, y, θ) of the reference point and the root joint of a model, for N rows at once.

    Parameters
    ----------
    offset : x, y, z (m) and yaw (rad) of the model's root in the axes of the reference point
    """

    nq: int
    nv: int

    def __init__(self, offset: Array) -> None:
        self._x, self._y, self._z, self._yaw = (float(value) for value in offset)

    @staticmethod
    @abstractmethod
    def joint() -> Any:
        """Pinocchio's joint; None for the chain."""

    @abstractmethod
    def configuration(self, pose: Array) -> Array:
        """The root's configuration (N, nq) at (x, y, θ) (N, 3)."""

    @abstractmethod
    def coordinates(self, configuration: Array) -> Array:
        """(x, y, θ), (N, 3), of a configuration (N, nq), θ up to full turns."""

    @abstractmethod
    def velocity(self, pose: Array, rates: Array) -> Array:
        """The root's velocity (N, nv) at (x, y, θ) and their rates, (N, 3)."""

    @abstractmethod
    def rates(self, pose: Array, velocity: Array) -> Array:
        """The rates of (x, y, θ), (N, 3), of the root's velocity (N, nv)."""

    def _moved(self, pose: Array) -> Array:
        """The root's own (x, y, θ)."""
        return pose + np.column_stack([*self._lever(pose[:, 2]), np.full(len(pose), self._yaw)])

    def _back(self, pose: Array) -> Array:
        theta = pose[:, 2] - self._yaw
        lever_x, lever_y = self._lever(theta)
        return np.column_stack([pose[:, 0] - lever_x, pose[:, 1] - lever_y, theta])

    def _lever(self, theta: Array) -> tuple[Array, Array]:
        """From the reference point to the root, in the world's axes."""
        cosine, sine = np.cos(theta), np.sin(theta)
        return cosine * self._x - sine * self._y, sine * self._x + cosine * self._y

    def _moved_rates(self, pose: Array, rates: Array) -> Array:
        """Velocity of the root's own x, y, θ: the lever turns with θ."""
        lever_x, lever_y = self._lever(pose[:, 2])
        turn = rates[:, 2]
        return np.column_stack([rates[:, 0] - turn * lever_y, rates[:, 1] + turn * lever_x, turn])

    def _back_rates(self, pose: Array, rates: Array) -> Array:
        lever_x, lever_y = self._lever(pose[:, 2])
        turn = rates[:, 2]
        return np.column_stack([rates[:, 0] + turn * lever_y, rates[:, 1] - turn * lever_x, turn])

    def _in_body(self, pose: Array, rates: Array) -> Array:
        """The root's velocity along its own axes, and its turn."""
        moved = self._moved_rates(pose, rates)
        theta = pose[:, 2] + self._yaw
        return np.column_stack([*_turned(-theta, moved[:, 0], moved[:, 1]), moved[:, 2]])

    def _from_body(self, pose: Array, body: Array) -> Array:
        theta = pose[:, 2] + self._yaw
        moved = np.column_stack([*_turned(theta, body[:, 0], body[:, 1]), body[:, 2]])
        return self._back_rates(pose, moved)


class ChainRoot(RootLayout):
    """The chain x, y, theta, or nothing at all (`count` 0)."""

    def __init__(self, offset: Array, count: int = 3) -> None:
        super().__init__(offset)
        self.nq = self.nv = count
        _check_height(self._z)

    @staticmethod
    def joint() -> Any:
        return None

    def configuration(self, pose: Array) -> Array:
        return self._moved(pose) if self.nq else pose

    def coordinates(self, configuration: Array) -> Array:
        return self._back(configuration) if self.nq else configuration

    def velocity(self, pose: Array, rates: Array) -> Array:
        return self._moved_rates(pose, rates) if self.nq else rates

    def rates(self, pose: Array, velocity: Array) -> Array:
        return self._back_rates(pose, velocity) if self.nq else velocity


class PlanarRoot(RootLayout):
    """(x, y, cos θ, sin θ); velocity along the body's axes."""

    nq, nv = 4, 3

    def __init__(self, offset: Array) -> None:
        super().__init__(offset)
        _check_height(self._z)

    @staticmethod
    def joint() -> Any:
        return pin.JointModelPlanar()

    def configuration(self, pose: Array) -> Array:
        moved = self._moved(pose)
        return np.column_stack([moved[:, :2], np.cos(moved[:, 2]), np.sin(moved[:, 2])])

    def coordinates(self, configuration: Array) -> Array:
        x, y, cosine, sine = configuration.T
        _check(np.abs(np.hypot(cosine, sine) - 1.0), "cos θ, sin θ: expected a pair of unit length")
        return self._back(np.column_stack([x, y, np.arctan2(sine, cosine)]))

    def velocity(self, pose: Array, rates: Array) -> Array:
        return self._in_body(pose, rates)

    def rates(self, pose: Array, velocity: Array) -> Array:
        return self._from_body(pose, velocity)


class FreeFlyerRoot(RootLayout):
    """(x, y, z, quaternion x y z w); velocity along the body's axes, linear and angular."""

    nq, nv = 7, 6

    @staticmethod
    def joint() -> Any:
        return pin.JointModelFreeFlyer()

    def configuration(self, pose: Array) -> Array:
        moved, nothing = self._moved(pose), np.zeros(len(pose))
        half = 0.5 * moved[:, 2]
        height = np.full(len(pose), self._z)
        return np.column_stack([moved[:, :2], height, nothing, nothing, np.sin(half), np.cos(half)])

    def coordinates(self, configuration: Array) -> Array:
        x, y, z, qx, qy, qz, qw = configuration.T
        length = np.linalg.norm(configuration[:, 3:], axis=1)
        _check(np.abs(length - 1.0), "quaternion: expected one of unit length")
        _check(np.abs(z - self._z), f"z: expected {self._z:g} m, the platform stays on its plane")
        _check(np.hypot(qx, qy), "roll and pitch: expected 0, the platform stays upright")
        return self._back(np.column_stack([x, y, 2.0 * np.arctan2(qz, qw)]))

    def velocity(self, pose: Array, rates: Array) -> Array:
        body, nothing = self._in_body(pose, rates), np.zeros((len(pose), 3))
        return np.column_stack([body[:, :2], nothing, body[:, 2]])

    def rates(self, pose: Array, velocity: Array) -> Array:
        _check(
            np.abs(velocity[:, 2:5]).max(axis=1, initial=0.0), "velocity along z, about x and y: expected 0"
        )
        return self._from_body(pose, velocity[:, [0, 1, 5]])


ROOTS: dict[str, type[RootLayout]] = {"planar": PlanarRoot, "freeflyer": FreeFlyerRoot, "chain": ChainRoot}


def _turned(angle: Array, x: Array, y: Array) -> tuple[Array, Array]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


def _check(off: Array, expected: str) -> None:
    if off.size and off.max() > _LEVEL:
        row = int(off.argmax())
        where = f" in row {row}" if off.size > 1 else ""
        raise InputError(f"{expected}, got {off[row]:g} off{where}")


def _check_height(z: float) -> None:
    if abs(z) > _LEVEL:
        raise InputError(
            f"the model's root is {z:g} m above the reference point, and only a free flyer has a height"
        )
