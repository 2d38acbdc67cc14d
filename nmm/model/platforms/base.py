"""What a platform is: the velocities that its wheels admit, `qp_dot = G(qp) up` (paper, eq. 2)."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import PLATFORM, Kernel, checked_by_caller
from nmm.model.platforms.steering import SteeredAxle
from nmm.model.platforms.wheel_layout import AddedJoint, Layout

#: The coordinates that every platform begins with.
PLANAR = ("x", "y", "theta")
#: Given and measured lengths that differ by less, m, or by a smaller share are the same.
CLOSE_LENGTH, CLOSE_SHARE = 1e-3, 0.01
#: The methods `pfaffian` that `of_many` marked.
_of_many: set[Callable[[Any, Array], Array]] = set()


def of_many(pfaffian: Callable[[Any, Array], Array]) -> Callable[[Any, Array], Array]:
    """Marks a `pfaffian` that takes qp (..., n_p), A (..., n_p - p, n_p); overrides are not marked."""
    _of_many.add(pfaffian)
    return pfaffian


def coordinates_with(platform: str, joints: Sequence[str]) -> tuple[str, ...]:
    """x, y, theta and the joints; `InputError` for a name that is none, is x, y or theta, or comes twice."""
    names = list(PLANAR)
    where = f"{platform}: joints"
    for joint in joints:
        expect(isinstance(joint, str) and joint, where, "the name of a joint", joint)
        expect(joint not in PLANAR, where, "a joint's name other than x, y, theta", joint)
        expect(joint not in names, where, "a name of its own for each", joint)
        names.append(joint)
    return tuple(names)


class Platform(ABC):
    """A driftless platform. To add one, write a subclass with

    1. `name`, `coordinates` (none, or x, y, theta first), `inputs` and `input_units`, as class attributes or,
       when they depend on the platform's parameters, set in `__init__`;
    2. `velocity_map`, a kernel of signature `compiled.PLATFORM`;
    3. `pfaffian`, the constraint rows with `A(qp) G(qp) = 0`, written independently of G (from the rolling of
       the wheels): the tests check the one against the other.

    It may have more: `parameters` (the numbers that the kernel reads) and their `parameter_names`, `fit` (how
    to measure them in a robot's file) and `lengths` (what a file is compared with), `coordinate_limits`,
    `problem` (where its wheels cannot roll, and why), `roller`, `rolls_at` and `sliding` (of wheels that do
    more than roll), `steered_axle` (what turns it where no task does), `added_joint` (one that files lack).

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
    coordinates: tuple[str, ...] = PLANAR
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    #: The attributes that `fit` measures, m.
    _fitted: tuple[str, ...] = ()
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
        """The platform with its parameters, if any, measured in a robot's file; `InputError` where the file
        lacks what they need (a steering joint, two wheels on one axle, ...)."""
        return cls()

    @property
    def lengths(self) -> Mapping[str, float]:
        """What `fit` measures, by name, m; nothing by default."""
        return {name: getattr(self, name) for name in self._fitted}

    def measured(self, layout: Layout) -> Mapping[str, float]:
        """`lengths` as a robot's file has them, m; `InputError` where it lacks what the platform needs."""
        return type(self).fit(layout).lengths

    def compared(self, layout: Layout) -> tuple[Finding, ...]:
        """What a robot's file says against this platform, with both numbers (1 mm or 1 % may differ); nothing
        without wheels or `lengths`. `InputError` where its joints cannot be those of the file."""
        if not layout.wheels or not self.lengths:
            return ()
        try:
            measured = self.measured(layout)
        except InputError as error:
            return (Finding("platform_misfit", {"platform": self.name, "reason": str(error)}),)
        findings = []
        for name, length in self.lengths.items():
            own = measured.get(name, length)
            if abs(length - own) > max(CLOSE_LENGTH, CLOSE_SHARE * abs(own)):
                values = {"platform": self.name, "name": name, "given": length, "measured": own}
                findings.append(Finding("platform_length_differs", values))
        return tuple(findings)

    def added_joint(self, layout: Layout) -> AddedJoint | None:
        """A coordinate of its own that the file lacks, or limits of one that the file's others imply."""
        return None

    @property
    @abstractmethod
    def velocity_map(self) -> Kernel:
        """Kernel that writes G (n_p, p) and G_q (n_p, p, n_p), G_q[i, j, k] = dG[i, j]/dqp[k], into zeros."""

    @abstractmethod
    def pfaffian(self, qp: Array) -> Array:
        """Constraint rows A(qp), shape (n_p - p, n_p), with A(qp) qp_dot = 0."""

    @property
    def parameters(self) -> Array:
        """The numbers that `velocity_map` reads (lengths in m, angles in rad); none by default."""
        return np.zeros(0)

    @property
    def parameter_names(self) -> Mapping[str, str]:
        """What the lengths in `parameters` are called in formulas, in order, each with what it is where its
        name does not say so ("" otherwise); without names, formulas have the numbers."""
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
        """Angle γ (rad) of the rollers of the wheel at (x, y) m on the root's body: it grips along its
        rolling direction turned by γ about z. 0 without rollers or where they turn about the rolling
        direction, ±π/4 for a mecanum wheel."""
        return 0.0

    def rolls_at(self, x: float, y: float) -> tuple[float, float]:
        """The point (m) of the root's body whose motion turns the wheel at (x, y) m: its own centre, unless
        the wheel slides along the direction in which it rolls."""
        return x, y

    def sliding(self, up: Array) -> Array:
        """Speed (...,), m/s, at inputs (..., p), of the wheel that slides fastest by design; 0 if none."""
        return np.zeros(up.shape[:-1])

    def steered_axle(self, body: str) -> SteeredAxle | None:
        """What steers a body where, at first order, only the speed moves it; None where nothing needs to. The
        coordinate `body` turns it: "theta" for the main body, a hitch's joint for a trailer."""
        return None

    def described(self) -> dict[str, str]:
        """The parameters in words, with their units, for people; by default the `lengths`."""
        return {name: f"{length:g} m" for name, length in self.lengths.items()}

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
        A = self.pfaffian(qp) if at_once else np.array([self.pfaffian(row) for row in qp])
        return np.einsum("kij,kj->ki", A.reshape(len(qp), -1, self.n_p), qp_dot)

    def velocity_maps(self, qp: Array) -> tuple[Array, Array]:
        """G (N, n_p, p) and its derivatives by the coordinates (N, n_p, p, n_p) at N samples (N, n_p)."""
        N, n_p, p = len(qp), self.n_p, self.p
        G, G_q = np.zeros((N, n_p, p)), np.zeros((N, n_p, p, n_p))
        kernel = checked_by_caller(self.velocity_map.compiled, PLATFORM)
        samples, parameters = (np.ascontiguousarray(part, np.float64) for part in (qp, self.parameters))
        for k in range(N):
            kernel(samples[k], parameters, G[k], G_q[k])
        return G, G_q

    def _evaluate(self, qp: ArrayLike) -> tuple[Array, Array]:
        G, G_q = self.velocity_maps(vector(qp, self.n_p, "qp")[np.newaxis])
        return G[0], G_q[0]
