"""What a platform is: the velocities that its wheels admit, `qp_dot = G(qp) up` (paper, eq. 2)."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, vector
from nmm.errors import InputError, expect_known
from nmm.kernels.compiled import Kernel
from nmm.platforms.layout import NEAR, AddedJoint, Layout
from nmm.platforms.steering import SteeredAxle

#: Given and measured lengths that differ by a smaller share are the same.
CLOSE = 0.01
#: The methods `pfaffian` that `of_many` marked: an overriding one counts as of one configuration.
_of_many: set[Callable[[Any, Array], Array]] = set()


def of_many(pfaffian: Callable[[Any, Array], Array]) -> Callable[[Any, Array], Array]:
    """Decorator of a `pfaffian` that takes several configurations, too: (..., n_p), A (..., n_p - p, n_p)."""
    _of_many.add(pfaffian)
    return pfaffian


class Platform(ABC):
    """A driftless platform. To add one, write a subclass in a file of its own that:

    1. sets `name`, `coordinates` (none, or x, y, theta first), `inputs` and `input_units`, as class
       attributes or, when they depend on the platform's parameters, in `__init__`;
    2. implements `velocity_map`, a kernel of signature `compiled.PLATFORM`;
    3. implements `pfaffian`, the constraint rows with `A(qp) G(qp) = 0`, written independently
       of G (from the rolling of the wheels): the tests check the one against the other.

    It may say more: `parameters` (the numbers that the kernel reads) and their `parameter_names`, `fit` (how
    to measure them in a robot's file) and `lengths` (what a file is compared with), `coordinate_limits`,
    `problem` (where its wheels cannot roll, and why), `roller`, `rolls_at` and `sliding` (of wheels that do
    more than roll), `steered_axle` (what turns it where no task feels that), `added_joint` (a coordinate that
    files lack).

    Parameters
    ----------
    limits : largest absolute value of each input, by name, in its unit; those not named have none

    Attributes
    ----------
    coordinates : names of qp, length n_p (m and rad)
    inputs : names of the pseudovelocities up, length p <= n_p
    input_units : their units

    Examples
    --------
    >>> platform = nmm.load("car_base").platform
    >>> platform.name, platform.coordinates, platform.inputs
    ('car', ('x', 'y', 'theta', 'steering'), ('v', 'steering_rate'))
    >>> qp = [0, 0, 0, 0.3]
    >>> np.allclose(platform.A(qp) @ platform.G(qp), 0)
    True
    """

    name: str
    coordinates: tuple[str, ...] = ("x", "y", "theta")
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    _limits: Mapping[str, float] = {}

    def __init__(self, *, limits: Mapping[str, float] | None = None) -> None:
        self._limits = self._checked(limits or {})

    def with_limits(self, limits: Mapping[str, float]) -> Self:
        """The same platform with other limits for the inputs named."""
        limited = copy.copy(self)
        limited._limits = {**self._limits, **self._checked(limits)}
        return limited

    def _checked(self, limits: Mapping[str, float]) -> dict[str, float]:
        for name in limits:
            expect_known("input", name, self.inputs, f"limits of platform {self.name}")
        return {name: positive(value, f"limit of {name}") for name, value in limits.items()}

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """The platform with its parameters measured in a robot's file; without parameters, the platform.

        Raises
        ------
        InputError : the file lacks what the platform needs (a steering joint, two wheels on one axle, ...)
        """
        return cls()

    @property
    def lengths(self) -> Mapping[str, float]:
        """What `fit` measures, by name, m; nothing by default."""
        return {}

    def measured(self, layout: Layout) -> Mapping[str, float]:
        """`lengths` as a robot's file has them, m; `InputError` where it lacks what the platform needs."""
        return type(self).fit(layout).lengths

    def compared(self, layout: Layout) -> tuple[str, ...]:
        """What a robot's file says against this platform, a sentence each, with both numbers.

        Nothing where the file has no wheels or the platform no `lengths`, which may differ by 1 mm or 1 %.

        Raises
        ------
        InputError : its joints cannot be those of the file
        """
        if not layout.wheels or not self.lengths:
            return ()
        try:
            measured = self.measured(layout)
        except InputError as error:
            return (f"given by hand, and not what its file holds: {error}",)
        return tuple(
            f"platform {self.name}: {name} is {given:g} m as given, and {measured[name]:.6g} m in the file"
            for name, given in self.lengths.items()
            if name in measured and abs(given - measured[name]) > max(NEAR, CLOSE * abs(measured[name]))
        )

    def added_joint(self, layout: Layout) -> AddedJoint | None:
        """A coordinate of its own that the file lacks, or limits of one that the file's others imply."""
        return None

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
    def parameter_names(self) -> Mapping[str, str]:
        """What the lengths in `parameters` are called in formulas, in their order, each with what it is where
        its name does not say so ("" otherwise); without names, formulas have the numbers."""
        return {}

    @property
    def input_limits(self) -> Array:
        """Largest absolute value of each input, (p,), infinite where there is none."""
        return np.array([self._limits.get(name, np.inf) for name in self.inputs])

    @property
    def coordinate_limits(self) -> Array:
        """Lower and upper limit of each coordinate, (n_p, 2); infinite by default."""
        return np.tile([-np.inf, np.inf], (self.n_p, 1))

    def problem(self, qp: ArrayLike) -> str | None:
        """Why the wheels cannot roll at qp (a steering angle of 90 degrees, say), or None when they can."""
        return None

    def roller(self, x: float, y: float) -> float:
        """Angle γ of the rollers of the wheel at (x, y) m on the root's body: the wheel grips along the
        direction in which it rolls, turned by γ (rad) about z. 0 for a wheel without rollers and for one
        whose rollers turn about its rolling direction; ±π/4 for a mecanum wheel."""
        return 0.0

    def rolls_at(self, x: float, y: float) -> tuple[float, float]:
        """The point (m) of the root's body whose motion turns the wheel at (x, y) m: its own centre, unless
        the wheel slides along the direction in which it rolls."""
        return x, y

    def sliding(self, up: Array) -> Array:
        """How fast its wheels slide over the ground by design at the inputs (..., p): (...,) m/s, of the one
        that slides fastest. 0 where all roll."""
        return np.zeros(up.shape[:-1])

    def steered_axle(self, body: str) -> SteeredAxle | None:
        """What steers a body where, at first order, only the speed moves it; None where nothing needs to.

        Parameters
        ----------
        body : the coordinate that turns it: "theta" for the main body, a hitch's joint for a trailer
        """
        return None

    def described(self) -> dict[str, str]:
        """The parameters in words, with their units, for people."""
        return {}

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
        return np.asarray(self._evaluate(qp)[1] @ vector(qp_dot, self.n_p, "qp_dot"))

    def A(self, qp: ArrayLike) -> Array:
        """Pfaffian constraint rows, shape (n_p - p, n_p): A(qp) qp_dot = 0, so A(qp) G(qp) = 0."""
        return self.pfaffian(vector(qp, self.n_p, "qp"))

    def sideways(self, qp: Array, qp_dot: Array) -> Array:
        """A(qp) qp_dot at N samples (N, n_p), shape (N, n_p - p): what their constraints forbid, m/s."""
        if self.n_p == self.p:
            return np.zeros((len(qp), 0))
        at_once = type(self).pfaffian in _of_many
        A = self.pfaffian(qp) if at_once else np.array([self.pfaffian(one) for one in qp])
        return np.einsum("kij,kj->ki", A.reshape(len(qp), -1, self.n_p), qp_dot)

    def _evaluate(self, qp: ArrayLike) -> tuple[Array, Array]:
        G = np.zeros((self.n_p, self.p))
        G_q = np.zeros((self.n_p, self.p, self.n_p))
        self.velocity_map(vector(qp, self.n_p, "qp"), self.parameters, G, G_q)
        return G, G_q
