"""References g(t, q): what a task's function shall follow, one idea a file."""

from nmm.functions.references.bearing import Bearing
from nmm.functions.references.callable_reference import CallableReference
from nmm.functions.references.circle import Circle
from nmm.functions.references.orientation import Slerp, Turn, rotation_vector
from nmm.functions.references.polynomial import Constant, Line, PiecewisePolynomial, Polynomial, Spline
from nmm.functions.references.pose import PoseReference
from nmm.functions.references.signal import Signal
from nmm.functions.references.velocity import Velocity

__all__ = [
    "Bearing",
    "CallableReference",
    "Circle",
    "Constant",
    "Line",
    "PiecewisePolynomial",
    "Polynomial",
    "PoseReference",
    "Signal",
    "Slerp",
    "Spline",
    "Turn",
    "Velocity",
    "rotation_vector",
]
