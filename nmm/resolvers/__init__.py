"""Resolvers, one file each; `nmm.base.kinds` lists them by name."""

from nmm.resolvers.answer import Answer as Answer
from nmm.resolvers.answer import Status as Status
from nmm.resolvers.base import Resolver as Resolver
from nmm.resolvers.base import Setup as Setup
from nmm.resolvers.base import State as State
from nmm.resolvers.callable_resolver import CallableResolver as CallableResolver
from nmm.resolvers.damped_least_squares import DampedLeastSquares as DampedLeastSquares
from nmm.resolvers.extended_jacobian import ExtendedJacobian as ExtendedJacobian
from nmm.resolvers.problem import Dimensions as Dimensions
from nmm.resolvers.problem import Problem as Problem
from nmm.resolvers.projected_gradient import ProjectedGradient as ProjectedGradient
from nmm.resolvers.reduced_gradient import ReducedGradient as ReducedGradient
