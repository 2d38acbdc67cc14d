"""Objectives H(q), minimised in the null space of the task, one idea a file."""

from nmm.objectives.base import Objective, Sum
from nmm.objectives.callable_objective import CallableObjective
from nmm.objectives.manipulability import Manipulability
from nmm.objectives.quadratic import JointRange, Quadratic, Square

__all__ = ["CallableObjective", "JointRange", "Manipulability", "Objective", "Quadratic", "Square", "Sum"]
