"""Objectives H(t, q), minimised in the null space of the task, one idea a file."""

from nmm.functions.objectives.alignment import Alignment
from nmm.functions.objectives.base import Objective, Sum
from nmm.functions.objectives.callable_objective import CallableObjective
from nmm.functions.objectives.clearance import Clearance
from nmm.functions.objectives.directional_manipulability import DirectionalManipulability
from nmm.functions.objectives.inverse_condition import InverseCondition
from nmm.functions.objectives.joint_range import JointRange
from nmm.functions.objectives.limit_barrier import LimitBarrier
from nmm.functions.objectives.manipulability import Manipulability, WeighedManipulability
from nmm.functions.objectives.potential_energy import PotentialEnergy
from nmm.functions.objectives.preferred_posture import PreferredPosture
from nmm.functions.objectives.quadratic import Quadratic, Square

__all__ = [
    "Alignment",
    "CallableObjective",
    "Clearance",
    "DirectionalManipulability",
    "InverseCondition",
    "JointRange",
    "LimitBarrier",
    "Manipulability",
    "Objective",
    "PotentialEnergy",
    "PreferredPosture",
    "Quadratic",
    "Square",
    "Sum",
    "WeighedManipulability",
]
