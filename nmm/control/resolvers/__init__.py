"""Resolvers, one file each; `nmm.base.kinds` lists them by name."""

from nmm.control.resolvers.answer import Answer as Answer
from nmm.control.resolvers.answer import Status as Status
from nmm.control.resolvers.base import Resolver as Resolver
from nmm.control.resolvers.base import Setup as Setup
from nmm.control.resolvers.base import State as State
from nmm.control.resolvers.callable_resolver import CallableResolver as CallableResolver
from nmm.control.resolvers.damped_least_squares import DampedLeastSquares as DampedLeastSquares
from nmm.control.resolvers.extended_jacobian import ExtendedJacobian as ExtendedJacobian
from nmm.control.resolvers.problem import Dimensions as Dimensions
from nmm.control.resolvers.problem import Problem as Problem
from nmm.control.resolvers.projected_gradient import ProjectedGradient as ProjectedGradient
from nmm.control.resolvers.reduced_gradient import ReducedGradient as ReducedGradient
