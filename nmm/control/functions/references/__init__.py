"""References g(t, q), which a task's function follows, one file per idea."""

from nmm.control.functions.callbacks import CallableReference as CallableReference
from nmm.control.functions.references.circle import Bearing as Bearing
from nmm.control.functions.references.circle import Circle as Circle
from nmm.control.functions.references.circle import VelocityOf as VelocityOf
from nmm.control.functions.references.live_target import LiveTarget as LiveTarget
from nmm.control.functions.references.orientation import PoseReference as PoseReference
from nmm.control.functions.references.orientation import Slerp as Slerp
from nmm.control.functions.references.orientation import SteadyTurn as SteadyTurn
from nmm.control.functions.references.orientation import rotation_vector as rotation_vector
from nmm.control.functions.references.polynomial import Constant as Constant
from nmm.control.functions.references.polynomial import Line as Line
from nmm.control.functions.references.polynomial import PiecewisePolynomial as PiecewisePolynomial
from nmm.control.functions.references.polynomial import Polynomial as Polynomial
from nmm.control.functions.references.polynomial import Spline as Spline
