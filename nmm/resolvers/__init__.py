"""Resolvers: one file each. `RESOLVERS` finds them by name; `nmm.kinds` lists them."""

from nmm.kinds import RESOLVERS
from nmm.resolvers.answer import Answer, Status
from nmm.resolvers.base import Resolver, Setup
from nmm.resolvers.callable_resolver import CallableResolver
from nmm.resolvers.damped_least_squares import DampedLeastSquares
from nmm.resolvers.extended_jacobian import ExtendedJacobian
from nmm.resolvers.problem import Dimensions, Problem
from nmm.resolvers.projected_gradient import ProjectedGradient
from nmm.resolvers.reduced_gradient import ReducedGradient
from nmm.resolvers.state import State

__all__ = [
    "RESOLVERS",
    "Answer",
    "CallableResolver",
    "DampedLeastSquares",
    "Dimensions",
    "ExtendedJacobian",
    "Problem",
    "ProjectedGradient",
    "ReducedGradient",
    "Resolver",
    "Setup",
    "State",
    "Status",
]
