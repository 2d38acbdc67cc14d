"""The resolvers of a scenario: how the redundancy is resolved, with keys of their own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from nmm.scenario.keys import Part, kind_of
from nmm.scenario.numbers import Nested, Positive, integer, number, numbers, shown
from nmm.scenario.tasks import TaskList, listed

if TYPE_CHECKING:
    from nmm.resolvers import Resolver


class ResolverPart(Part):
    """How the redundancy is resolved."""

    kind: str
    tolerance: Positive = Field(
        1e-10, description="a matrix counts as singular below this ratio of smallest to largest pivot"
    )

    @abstractmethod
    def make(self) -> Resolver:
        """The library's object."""

    def build(self) -> Resolver:
        """`make`; errors know their key."""
        with self.own_keys():
            return self.make()

    def explicit(self) -> dict[str, Any]:
        """The keys, with what the library chooses where the file leaves it open."""
        return self.model_dump()


def _partitions(value: object) -> object:
    if isinstance(value, str):
        if value != "automatic":
            raise ValueError(f"expected automatic, or a list of lists of inputs, got {shown(value)}")
        return value
    if not isinstance(value, list | tuple) or not all(isinstance(item, list | tuple) for item in value):
        raise ValueError(
            f"expected automatic, or a list of lists of inputs ([[v, q1], [v, omega]]), got {shown(value)}"
        )
    return [
        [item if isinstance(item, str) and not item.isdecimal() else integer(item) for item in p]
        for p in value
    ]


def _weights(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(name): number(weight) for name, weight in value.items()}
    return value if value is None else numbers(value)


class ReducedGradientPart(ResolverPart):
    """Reduced gradient: J T = [Ja Jb], the columns in Ja do the task, the others descend the objective."""

    kind: Literal["rg"]
    alpha: Positive = Field(10.0, description="step size α, above 0")
    partitions: Annotated[str | list[list[str | int]], BeforeValidator(_partitions)] = Field(
        "automatic",
        description="inputs whose columns may form Ja: automatic, or lists ([[v, q1], [v, omega]])",
    )
    threshold: Positive | None = Field(
        None,
        description="Θ, the measure of Ja below which the partition is chosen anew: of |det Ja| for given "
        "partitions (0.01 when not given), of |det Ja| / sqrt(det J Jᵀ) for automatic ones (0.05)",
    )

    weights: Annotated[dict[str, float] | list[Nested] | None, BeforeValidator(_weights)] = Field(
        None,
        description="what each input costs: by name or group ({platform: 10, q1: 2}; 1 for the rest), or a "
        "number an input: a heavy one does the task less often and descends the objective more slowly",
    )

    def make(self) -> Resolver:
        from nmm.resolvers import ReducedGradient

        partitions: Any = self.partitions
        weights: Any = self.weights
        return ReducedGradient(self.alpha, partitions, self.threshold, self.tolerance, weights)

    def explicit(self) -> dict[str, Any]:
        from nmm.resolvers import ReducedGradient

        resolver = self.build()
        threshold = resolver.threshold if isinstance(resolver, ReducedGradient) else self.threshold
        return self.model_dump() | {"threshold": threshold}


class ProjectedGradientPart(ResolverPart):
    """Projected gradient: the minimum-norm solution and the objective's gradient in J's null space."""

    kind: Literal["pg"]
    alpha: Positive = Field(10.0, description="step size α, above 0")
    weights: Annotated[dict[str, float] | list[Nested] | None, BeforeValidator(_weights)] = Field(
        None,
        description="what each input costs in the norm: by name or group ({platform: 10, q1: 2}; 1 for the "
        "rest), a number an input, or a symmetric positive definite matrix",
    )

    def make(self) -> Resolver:
        from nmm.resolvers import ProjectedGradient

        weights: Any = self.weights
        return ProjectedGradient(self.alpha, weights, self.tolerance)


def _listed_or_none(value: object) -> object:
    return value if value is None else listed(value)


class ExtendedJacobianPart(ResolverPart):
    """Extended Jacobian: as many constraint rows y = h(q) as there is redundancy, then one inverse."""

    kind: Literal["ej"]
    constraint: Annotated[TaskList | None, BeforeValidator(_listed_or_none)] = Field(
        None,
        description="tasks that take up the redundancy, p + n_m - s rows; when not given and the objective "
        "is quadratic with so many terms, each term's combination is driven to its target",
    )
    gain: Positive = Field(
        10.0, description="feedback gain K_y, 1/s, of the constraint made from the objective"
    )

    def make(self) -> Resolver:
        from nmm.resolvers import ExtendedJacobian

        return ExtendedJacobian(self.tolerance)


PARTS: dict[str, type[ResolverPart]] = {
    "rg": ReducedGradientPart,
    "pg": ProjectedGradientPart,
    "ej": ExtendedJacobianPart,
}
ResolverKind = Annotated[
    Annotated[
        ReducedGradientPart | ProjectedGradientPart | ExtendedJacobianPart, Field(discriminator="kind")
    ],
    kind_of(*PARTS.values()),
]
