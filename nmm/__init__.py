"""nmm: modelling and redundancy resolution for nonholonomic mobile manipulators, on Pinocchio.

Names are loaded when first used, so that `import nmm` costs nothing (`lazy_loader`; the list of
names is `__init__.pyi`).
"""

import lazy_loader

from nmm.lazy_call import interrupts_wait

__version__ = "1.0.0"

#: Names that authors need, which were in front before.
_EXTENDING = """
    AddedJoint AnswerArrays Dimensions Evaluation Event Function Kernel Layout LimitReport LiveNumbers
    Objective PiecewisePolynomial PinocchioModels Pivot Platform ProblemArrays Quantity Residuals
    Resolver RollingJoint Rollouts Row Semantics Setup Shape Shapes Shown Stage State SteeredAxle
    SteeringPivot Step Table Wheel WheelDescription WheelRate
"""
#: Names that were in front before, and where they are now.
MOVED = {name: f"extending.{name}" for name in _EXTENDING.split()} | {
    "Coordinates": "LinearCoordinates",
    "Fixed": "FixedBase",
    "Follower": "extending.MimicJoint",
    "Mesh": "ConvexMesh",
    "Plane": "HalfSpace",
    "Postures": "extending.NamedPostures",
    "Signal": "LiveTarget",
    "Speed": "WheelSpeed",
    "Spin": "WheelSpin",
    "Spins": "WeightedSpins",
    "Square": "QuadraticTerm",
    "Swept": "extending.SweepResult",
    "Turn": "SteadyTurn",
    "Velocity": "VelocityOf",
    "WeighedManipulability": "WeightedManipulability",
}

_loaded, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name in MOVED:
        raise AttributeError(f"nmm.{name} is now nmm.{MOVED[name]}")
    with interrupts_wait():
        return _loaded(name)
