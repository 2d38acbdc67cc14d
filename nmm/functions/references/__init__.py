"""References g(t, q), which a task's function follows, one file per idea."""

from nmm.functions.callbacks import CallableReference as CallableReference
from nmm.functions.references.circle import Bearing as Bearing
from nmm.functions.references.circle import Circle as Circle
from nmm.functions.references.circle import VelocityOf as VelocityOf
from nmm.functions.references.live_target import LiveTarget as LiveTarget
from nmm.functions.references.orientation import PoseReference as PoseReference
from nmm.functions.references.orientation import Slerp as Slerp
from nmm.functions.references.orientation import SteadyTurn as SteadyTurn
from nmm.functions.references.orientation import rotation_vector as rotation_vector
from nmm.functions.references.polynomial import Constant as Constant
from nmm.functions.references.polynomial import Line as Line
from nmm.functions.references.polynomial import PiecewisePolynomial as PiecewisePolynomial
from nmm.functions.references.polynomial import Polynomial as Polynomial
from nmm.functions.references.polynomial import Spline as Spline
