"""Objectives H(q), minimised in the null space of the task, one idea a file."""

from nmm.functions.objectives.base import Objective, Sum
from nmm.functions.objectives.callable_objective import CallableObjective
from nmm.functions.objectives.manipulability import Manipulability
from nmm.functions.objectives.quadratic import JointRange, Quadratic, Square

__all__ = ["CallableObjective", "JointRange", "Manipulability", "Objective", "Quadratic", "Square", "Sum"]
