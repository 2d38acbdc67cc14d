"""What a platform is: the velocities that its wheels admit, `qp_dot = G(qp) up` (paper, eq. 2)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nmm.arrays import vector
from nmm.compiled import Kernel

Array = NDArray[np.float64]


class Platform(ABC):
    """A driftless platform. To add one, write a subclass in a file of its own that:

    1. sets the class attributes `coordinates` (the first three are always x, y, theta), `inputs`
       and `input_units`;
    2. implements `velocity_map`, a kernel of signature `compiled.PLATFORM`;
    3. implements `pfaffian`, the constraint rows with `A(qp) G(qp) = 0`, written independently
       of G (from the rolling of the wheels): the tests check the one against the other.

    Attributes
    ----------
    coordinates : names of qp, length n_p (m and rad)
    inputs : names of the pseudovelocities up, length p < n_p
    input_units : their units
    """

    name: ClassVar[str]
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "theta")
    inputs: ClassVar[tuple[str, ...]]
    input_units: ClassVar[tuple[str, ...]]

    @property
    @abstractmethod
    def velocity_map(self) -> Kernel:
        """Kernel that writes G (n_p, p) and G_q (n_p, p, n_p), G_q[i, j, k] = dG[i, j]/dqp[k].

        Both arrays come filled with zeros.
        """

    @abstractmethod
    def pfaffian(self, qp: Array) -> Array:
        """Constraint rows A(qp), shape (n_p - p, n_p), with A(qp) qp_dot = 0."""

    @property
    def parameters(self) -> Array:
        """The numbers that `velocity_map` reads (lengths in m, angles in rad); none by default."""
        return np.zeros(0)

    @property
    def n_p(self) -> int:
        """Number of platform coordinates."""
        return len(self.coordinates)

    @property
    def p(self) -> int:
        """Number of platform inputs."""
        return len(self.inputs)

    def G(self, qp: ArrayLike) -> Array:
        """Admissible velocities, shape (n_p, p): qp_dot = G(qp) up (paper, eq. 2)."""
        return self._evaluate(qp)[0]

    def G_dot(self, qp: ArrayLike, qp_dot: ArrayLike) -> Array:
        """Time derivative of G along the velocity `qp_dot`, shape (n_p, p)."""
        derivative: Array = self._evaluate(qp)[1] @ vector(qp_dot, self.n_p, "qp_dot")
        return derivative

    def A(self, qp: ArrayLike) -> Array:
        """Pfaffian constraint rows, shape (n_p - p, n_p): A(qp) qp_dot = 0, so A(qp) G(qp) = 0."""
        return self.pfaffian(vector(qp, self.n_p, "qp"))

    def _evaluate(self, qp: ArrayLike) -> tuple[Array, Array]:
        G = np.zeros((self.n_p, self.p))
        G_q = np.zeros((self.n_p, self.p, self.n_p))
        self.velocity_map(vector(qp, self.n_p, "qp"), self.parameters, G, G_q)
        return G, G_q
