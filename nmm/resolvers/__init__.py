"""Resolvers: one file each. `RESOLVERS` finds them by name."""

from nmm.resolvers.base import Resolution, Resolver, Setup, Shape, Status
from nmm.resolvers.callable_resolver import CallableResolver
from nmm.resolvers.extended_jacobian import ExtendedJacobian
from nmm.resolvers.projected_gradient import ProjectedGradient
from nmm.resolvers.reduced_gradient import ReducedGradient

RESOLVERS: dict[str, type[Resolver]] = {
    kind.name: kind for kind in (ReducedGradient, ProjectedGradient, ExtendedJacobian)
}

__all__ = [
    "RESOLVERS",
    "CallableResolver",
    "ExtendedJacobian",
    "ProjectedGradient",
    "ReducedGradient",
    "Resolution",
    "Resolver",
    "Setup",
    "Shape",
    "Status",
]
