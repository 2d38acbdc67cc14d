"""J of many configurations in chunks, scaled and weighted, and the measures of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypedDict

import numpy as np

from nmm.analysis.maps.measures import Spectra, chosen, volume
from nmm.analysis.singular.jacobians import Jacobians, Subject
from nmm.analysis.singular.parts import WHOLE, expect_inputs, groups, ranks, some_columns
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.arrays import Array, Integers, scalar
from nmm.errors import InputError
from nmm.progress import Progress, between
from nmm.resolvers.problem import Dimensions
from nmm.resolvers.weights import Weights, weight_diagonal

#: So many configurations' J are held at a time.
CHUNK = 1 << 14


class Smallness(NamedTuple):
    """How near a part's J is to losing rank, at N configurations.

    sigma, volume, rank : smallest singular value, product of all, and rank, (N,); the rank is judged beside
    the whole J, as in `analyse`
    """

    sigma: Array
    volume: Array
    rank: Integers


class Evaluated(NamedTuple):
    """What is known at N configurations.

    values : measures (N,), by name; NaN where there is no J
    own : of the part's J
    arm : of the arm's; None where it was not asked for
    """

    values: dict[str, Array]
    own: Smallness
    arm: Smallness | None


class Judged(TypedDict, total=False):
    """What is judged, and how, on every map: the options of `Evaluator`, which says what each of them means.

    Attributes
    ----------
    t, measures, part, alpha, weights, length, sizes : see `Evaluator`; each has its default there

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> judged = nmm.analysis.Judged(measures="manipulability", part="arm")
    >>> found = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20, **judged)
    >>> list(found.values), found.about.part
    (['manipulability'], 'arm')
    """

    t: float
    measures: str | Sequence[str]
    part: str
    alpha: float
    weights: Weights | None
    length: float | None
    sizes: Mapping[str, float] | None


class Evaluator:
    """Measures at any configurations.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    t : s
    measures : names of `measures.MEASURES`
    part : whose columns of J: "robot", "platform", "arm" or an arm's name
    alpha : the arm's share in the measure "weighted", in [0, 1]
    weights : W > 0 of the inputs by input or group ("platform", "arm"): the measures are of J W^(-1/2), as
        though an input of weight 4 went at half the speed
    length, sizes : as `analyse`

    Raises
    ------
    InputError : what is wrong with any of these; a part without inputs, or a measure of one; a task of more
        rows than inputs
    """

    def __init__(
        self,
        subject: Subject,
        *,
        t: float = 0.0,
        measures: str | Sequence[str] = ("sigma_min",),
        part: str = WHOLE,
        alpha: float = 0.5,
        weights: Weights | None = None,
        length: float | None = None,
        sizes: Mapping[str, float] | None = None,
    ) -> None:
        self.jacobians = Jacobians(subject)
        self.robot = robot = self.jacobians.robot
        self.t = scalar(t, "t")
        self.measures = chosen(measures)
        self.columns = groups(robot)
        expect_inputs(robot, part)
        for name, measure in self.measures.items():
            if measure.needs:
                expect_inputs(robot, measure.needs, f"measure {name}")
        self.part = part
        self.alpha = scalar(alpha, "alpha")
        if not 0.0 <= self.alpha <= 1.0:
            raise InputError(f"alpha: expected a number from 0 to 1, got {self.alpha:g}")
        self.length, self.sizes = length, dict(sizes or {})
        rows, _, inputs = self.jacobians.sizes(length, sizes)
        dimensions = Dimensions(len(rows), 0, robot.u_names, robot.groups)
        self.weights = np.ones(robot.n_u) if weights is None else weight_diagonal(weights, dimensions)
        self._natural = self.jacobians.natural(rows)
        self._factors = inputs / np.sqrt(self.weights) / rows[:, np.newaxis]
        self.scaled = length is not None or bool(self.sizes)

    @property
    def arm_beside(self) -> bool:
        """Whether the arm's singularities are a set of their own beside the whole robot's."""
        too_few = len(self.columns["arm"]) < len(self.jacobians.rows)
        return self.part == WHOLE and bool(self.columns["platform"]) and not too_few

    def J(self, q: Array, progress: Progress | None = None) -> Array:
        """Scaled J (N, s, m) at q (N, n)."""
        J = self.jacobians.batch(q, self.t, progress)
        J *= self._factors
        return J

    def part_of(self, part: str) -> Callable[[Array], Array]:
        """q (N, n) -> the part's columns of the scaled J."""
        columns = self.columns[part]
        return lambda q: some_columns(self.J(q), columns)

    def __call__(self, q: Array, progress: Progress | None = None, *, arm: bool = False) -> Evaluated:
        """All measures at q (N, n), chunk after chunk; what is the arm's only if it is asked for."""
        found = [
            self._chunk(q[first : first + CHUNK], between(progress, first / len(q), CHUNK / len(q)), arm)
            for first in range(0, len(q), CHUNK)
        ]
        return Evaluated(
            {name: np.concatenate([part.values[name] for part in found]) for name in self.measures},
            _joined([part.own for part in found]),
            _joined([part.arm for part in found if part.arm is not None]) if arm else None,
        )

    def _chunk(self, q: Array, progress: Progress | None, arm: bool) -> Evaluated:
        spectra = Spectra(self.J(q, progress), self.columns)
        largest = np.nan_to_num(spectra.of(WHOLE)[:, 0])
        # The rank of NaN would be 0: a singularity where there is only no J.
        full = len(self.jacobians.rows)

        def smallness(name: str) -> Smallness:
            values = spectra.of(name)
            rank = np.where(spectra.undefined, full, ranks(values, largest, TOLERANCE, self._natural))
            return Smallness(values[:, -1], volume(spectra, name), rank)

        values = {name: measure.of(spectra, self.part, self.alpha) for name, measure in self.measures.items()}
        # Much of the time goes into singular values: the arm's are computed where someone asks for them.
        return Evaluated(values, smallness(self.part), smallness("arm") if arm else None)


def _joined(parts: Sequence[Smallness]) -> Smallness:
    """Chunks in one."""
    sigma, volume, rank = (np.concatenate(pieces) for pieces in zip(*parts, strict=True))
    return Smallness(sigma, volume, rank)
