"""References g(t, q): what a task's function shall follow, one idea a file."""

from nmm.references.bearing import Bearing
from nmm.references.callable_reference import CallableReference
from nmm.references.circle import Circle
from nmm.references.orientation import Slerp, Turn, rotation_vector
from nmm.references.polynomial import Constant, Line, PiecewisePolynomial, Polynomial, Spline
from nmm.references.pose import PoseReference

__all__ = [
    "Bearing",
    "CallableReference",
    "Circle",
    "Constant",
    "Line",
    "PiecewisePolynomial",
    "Polynomial",
    "PoseReference",
    "Slerp",
    "Spline",
    "Turn",
    "rotation_vector",
]
