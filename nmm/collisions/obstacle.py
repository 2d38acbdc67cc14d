"""An obstacle: a shape in the world that stands, moves along a path, or is set from outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import Array, array, scalar, vector
from nmm.collisions.shapes import Shape
from nmm.errors import InputError, NmmError, RunError
from nmm.words import one_line

#: Where a shape is: (3,) its origin, (6,) origin and rotation vector, or (4, 4); m, rad, world axes.
Placement: TypeAlias = ArrayLike
#: Step of the differences that give a path's velocity, s.
STEP = 1e-6


class Obstacle:
    """A shape that the robot keeps away from.

    Parameters
    ----------
    shape : `Box`, `Sphere`, `Cylinder`, `Capsule`, `Plane` or `Mesh`
    placement : where it is: (3,) its origin, (6,) origin and rotation vector, or a (4, 4) matrix; the world's
        origin when not given
    motion : in its place, where it is at t, s: a function that returns such a placement
    name : for messages; the shape's kind when not given
    velocity : that of its origin along `motion` at t: a function that returns (3,), m/s, world axes, or (6,)
        with the angular velocity, rad/s; differences of `motion` when not given

    Raises
    ------
    InputError : no shape, a placement or a motion that gives no such numbers, both of them

    Examples
    --------
    >>> pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    >>> ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [2.0 - 0.1 * t, 1.5, 0.3], name="ball")
    >>> pillar.moves, ball.moves, ball.at(10.0).translation
    (False, True, array([1. , 1.5, 0.3]))
    """

    def __init__(
        self,
        shape: Shape,
        placement: Placement | None = None,
        motion: Callable[[float], Placement] | None = None,
        name: str = "",
        velocity: Callable[[float], ArrayLike] | None = None,
    ) -> None:
        if not isinstance(shape, Shape):
            raise InputError(f"obstacle: expected a shape (Box, Sphere, ...), got {shape!r}")
        self.shape = shape
        self.name = name or type(shape).__name__.lower()
        self.motion = motion
        if motion is not None and not callable(motion):
            raise InputError(
                f"obstacle {self.name}: motion: expected a Python function of t that returns a placement, as "
                f"in lambda t: [0.1 * t, 0, 0.3], got {motion!r}"
            )
        if motion is not None and placement is not None:
            raise InputError(f"obstacle {self.name}: expected a placement or a motion, got both")
        if velocity is not None and (motion is None or not callable(velocity)):
            raise InputError(
                f"obstacle {self.name}: velocity: expected a function of t, with motion, got {velocity!r}"
            )
        self._velocity = velocity
        standing = (0.0, 0.0, 0.0) if placement is None else placement
        self._placement = self._checked(standing if motion is None else self._moved(motion, 0.0, InputError))
        self._twist = np.zeros(6)

    def __repr__(self) -> str:
        return f"Obstacle({self.name}, {self.shape})"

    @property
    def moves(self) -> bool:
        """Whether it moves along a path."""
        return self.motion is not None

    def placement(self, t: float) -> Array:
        """Where it is at t, s: (4, 4), world axes, m."""
        found: Array = self.at(t).homogeneous
        return found

    def move_to(self, placement: Placement, velocity: ArrayLike | None = None) -> None:
        """Set where it is from now on.

        Parameters
        ----------
        placement : as in the constructor
        velocity : (3,) of its origin, or (6,) with its angular velocity, m/s and rad/s, world axes; 0 when
            not given

        Raises
        ------
        InputError : it moves along a path; no such numbers
        """
        if self.motion is not None:
            raise InputError(f"obstacle {self.name}: it moves along a path and cannot be set")
        found = self._checked(placement)
        self._twist = np.zeros(6) if velocity is None else self._six(velocity)
        self._placement = found

    def at(self, t: float) -> Any:
        """As `placement`, Pinocchio's; the same object as long as nothing sets it."""
        return self._placement if self.motion is None else self._checked(self._moved(self.motion, t))

    def _moved(
        self, motion: Callable[[float], Placement], t: float, kind: type[NmmError] = RunError
    ) -> Placement:
        """What the motion says at t, s; an error of that kind where it raises one of its own."""
        try:
            return motion(t)
        except NmmError:
            raise
        except Exception as error:  # a user's function may raise anything
            raise kind(
                f"obstacle {self.name}: motion({t:g}) raised {type(error).__name__}: {one_line(str(error))}"
            ) from error

    def twist(self, t: float) -> Array:
        """Velocity of its origin over its angular velocity at t, (6,), m/s and rad/s, world axes."""
        if self.motion is None:
            return self._twist
        if self._velocity is not None:
            return self._six(self._velocity(t))
        behind, ahead = self.at(t - STEP), self.at(t + STEP)
        turned = pin.log3(ahead.rotation @ behind.rotation.T)
        return np.concatenate([ahead.translation - behind.translation, turned]) / (2.0 * STEP)

    def _six(self, velocity: ArrayLike) -> Array:
        given = vector(velocity, None, f"obstacle {self.name}: velocity")
        if given.size not in (3, 6):
            raise InputError(f"obstacle {self.name}: velocity: expected 3 or 6 numbers, got {given.size}")
        return np.concatenate([given, np.zeros(6 - given.size)])

    def _checked(self, placement: Placement) -> Any:
        # What a motion usually returns: it is asked along the way ahead, many times a sample.
        if isinstance(placement, np.ndarray) and placement.dtype == np.float64 and placement.shape == (6,):
            six: Array = placement
            if six.dot(six) < np.inf:
                return pin.SE3(pin.exp3(six[3:]), six[:3])
        name = f"obstacle {self.name}: {'placement' if self.motion is None else 'motion'}"
        given = array(placement, name)
        if given.shape == (4, 4):
            rotation = given[:3, :3]
            if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0.0:
                raise InputError(f"{name}: expected a rotation in the upper left of the matrix")
            if np.abs(given[3] - (0.0, 0.0, 0.0, 1.0)).max() > 1e-6:
                raise InputError(f"{name}: expected 0, 0, 0, 1 in the last row of the matrix, got {given[3]}")
            return pin.SE3(rotation, given[:3, 3])
        if given.shape == (3,):
            return pin.SE3(np.eye(3), given)
        if given.shape == (6,):
            return pin.SE3(pin.exp3(given[3:]), given[:3])
        raise InputError(f"{name}: expected 3 or 6 numbers or a (4, 4) matrix, got shape {given.shape}")


def checked_distance(value: ArrayLike, name: str) -> float:
    """A distance, m, from 0."""
    distance = scalar(value, name)
    if distance < 0.0:
        raise InputError(f"{name}: expected a number from 0, got {distance:g}")
    return distance
