"""How well a matrix J moves its task, as one number: a table of measures, and what evaluates them.

Manipulability of the whole robot (w) and of its arm alone (w_b), and the two weighed by α, are those of
B. Bayle, J.-Y. Fourquet and M. Renaud, "Manipulability of Wheeled Mobile Manipulators: Application to Motion
Generation", IJRR 22(7-8), 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple, TypedDict

import numpy as np

from nmm.analysis.singular.jacobians import Jacobians, Subject
from nmm.analysis.singular.parts import WHOLE, expect_inputs, groups, ranks, singular_values, some_columns
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array, Integers, scalar
from nmm.base.errors import expect, expect_known
from nmm.base.progress import Progress, between
from nmm.base.text_format import superscript
from nmm.control.resolvers.base import Weights, weight_diagonal
from nmm.control.resolvers.problem import Dimensions

#: So many configurations' J are held at a time.
CHUNK = 1 << 14


def spectra_of(J: Array, columns: Mapping[str, Sequence[int]]) -> dict[str, Array]:
    """Singular values (N, s) of J (N, s, m) by part; 0 where inputs are missing, NaN where there is no J."""
    undefined = np.asarray(~np.isfinite(J).all(axis=(1, 2)))
    J = np.where(undefined[:, np.newaxis, np.newaxis], 0.0, J) if undefined.any() else J
    by_part = {part: singular_values(some_columns(J, own)) for part, own in columns.items()}
    for values in by_part.values():
        values[undefined] = np.nan
    return by_part


def volume(values: Array) -> Array:
    """sqrt(det J Jᵀ), Yoshikawa's w, as the product of the singular values; 0 with too few inputs."""
    return np.asarray(np.prod(values, axis=-1))


def inverse_condition(values: Array) -> Array:
    """σ_min / σ_max, from 0 (lost rank, also where J = 0) to 1 (moves alike in every direction)."""
    largest = values[:, 0]
    return np.asarray(values[:, -1] / np.where(largest == 0.0, 1.0, largest))


def eccentricity(values: Array) -> Array:
    """sqrt(1 - (σ_min / σ_max)²), from 0 (a ball of velocities) to 1 (a flat one: lost rank)."""
    ratio = inverse_condition(values)
    return np.asarray(np.sqrt((1.0 - ratio) * (1.0 + ratio)))


class MapMeasure(NamedTuple):
    """One number for each J, `of` (alpha, singular values (N, s) of each part) -> (N,), as in "sigma" or
    "volume" `unit`s.

    parts : those it always describes, whichever was asked for; empty if it describes that one
    where_singular : its value where the part's J loses rank; with `parts`, where the whole robot's does
    """

    symbol: str
    about: str
    unit: Literal["sigma", "volume", ""]
    of: Callable[..., Array]
    parts: tuple[str, ...] = ()
    better: float = 1.0
    where_singular: float = 0.0


#: The measures by name. A new one is a line here.
MEASURES: Mapping[str, MapMeasure] = {
    "sigma_min": MapMeasure(
        "σ_min", "the task's slowest velocity for inputs of size 1", "sigma", lambda _, own: own[:, -1]
    ),
    "inverse_condition": MapMeasure(
        "σ_min / σ_max",
        "inverse condition number: 1 isotropic, 0 singular",
        "",
        lambda _, own: inverse_condition(own),
    ),
    "manipulability": MapMeasure("w", "manipulability sqrt(det J Jᵀ)", "volume", lambda _, own: volume(own)),
    "arm_manipulability": MapMeasure(
        "w_b", "manipulability of the arm alone", "volume", lambda _, arm: volume(arm), ("arm",)
    ),
    "platform_manipulability": MapMeasure(
        "w_p", "manipulability of the platform alone", "volume", lambda _, own: volume(own), ("platform",)
    ),
    "weighted": MapMeasure(
        "α w_b + (1 − α) w",
        "manipulability of arm and whole robot, weighed",
        "volume",
        lambda alpha, arm, whole: alpha * volume(arm) + (1.0 - alpha) * volume(whole),
        ("arm", WHOLE),
    ),
    "eccentricity": MapMeasure(
        "w_5",
        "eccentricity sqrt(1 − (σ_min/σ_max)²): 0 isotropic, 1 singular",
        "",
        lambda _, own: eccentricity(own),
        better=-1.0,
        where_singular=1.0,
    ),
}


def unit_of(measure: MapMeasure, row_units: Sequence[str], input_units: Sequence[str]) -> str:
    """A measure's unit: "m/rad", "(m/rad)²"; "mixed units" where rows or inputs have several; "" for none."""
    if not measure.unit or not input_units:
        return ""
    if len(set(row_units)) > 1 or len(set(input_units)) > 1:
        return "mixed units"
    row, per = row_units[0], input_units[0].removesuffix("/s")
    if row == per:
        return ""
    base, s = f"{row}/{per}", len(row_units)
    if measure.unit == "sigma" or s == 1:
        return base
    return f"({base}){superscript(s)}"


class Smallness(NamedTuple):
    """Smallest singular value, product of all, and rank (N,) of a part's J, as judged beside the whole J."""

    sigma: Array
    volume: Array
    rank: Integers


class Evaluated(NamedTuple):
    """Measures (N,) by name, NaN where there is no J, and the smallness of the part's J and the arm's."""

    values: dict[str, Array]
    own: Smallness
    arm: Smallness | None


class Judged(TypedDict, total=False):
    """The options that all maps share: what is measured, and how.

    Attributes
    ----------
    t, measures, part, alpha, weights, length, sizes : see `singularity_map`

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> judged = nmm.analysis.Judged(measures="manipulability", part="arm")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20, **judged)
    >>> list(result.values), result.about.part
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
    """Measures at any configurations; the options are those of `singularity_map`."""

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
        names = [measures] if isinstance(measures, str) else list(measures)
        expect(names, "measures", f"at least one of {', '.join(MEASURES)}")
        for name in names:
            expect_known("measure", name, MEASURES, "measures")
        self.measures = {name: MEASURES[name] for name in names}
        self.columns = groups(robot)
        expect_inputs(robot, part)
        for name, measure in self.measures.items():
            for needed in measure.parts:
                expect_inputs(robot, needed, f"measure {name}")
        self.part = part
        self.alpha = scalar(alpha, "alpha")
        expect(0.0 <= self.alpha <= 1.0, "alpha", "a number from 0 to 1", self.alpha)
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
        """All measures at q (N, n); the arm's only if it is asked for: singular values take long."""
        parts = {WHOLE, self.part}.union(*(measure.parts for measure in self.measures.values()))
        columns = {name: self.columns[name] for name in (parts | {"arm"} if arm else parts)}
        chunks = []
        for first in range(0, len(q), CHUNK):
            J = self.J(q[first : first + CHUNK], between(progress, first / len(q), CHUNK / len(q)))
            chunks.append(self._evaluated(spectra_of(J, columns), arm))
        return Evaluated(
            {name: np.concatenate([chunk.values[name] for chunk in chunks]) for name in self.measures},
            Smallness(*map(np.concatenate, zip(*(chunk.own for chunk in chunks), strict=True))),
            Smallness(*map(np.concatenate, zip(*(chunk.arm for chunk in chunks if chunk.arm), strict=True)))
            if arm
            else None,
        )

    def _evaluated(self, spectra: Mapping[str, Array], arm: bool) -> Evaluated:
        largest = np.nan_to_num(spectra[WHOLE][:, 0])

        def smallness(name: str) -> Smallness:
            values = spectra[name]
            # Where there is no J, the rank is not lost.
            rank = ranks(values, largest, TOLERANCE, self._natural)
            rank[np.isnan(values[:, -1])] = len(self.jacobians.rows)
            return Smallness(values[:, -1], volume(values), rank)

        values = {
            name: measure.of(self.alpha, *(spectra[part] for part in measure.parts or (self.part,)))
            for name, measure in self.measures.items()
        }
        return Evaluated(values, smallness(self.part), smallness("arm") if arm else None)
