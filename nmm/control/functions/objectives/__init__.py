"""Objectives H(t, q), minimised in the null space of the task, one file per idea."""

from nmm.control.functions.objectives.alignment import Alignment as Alignment
from nmm.control.functions.objectives.base import CallableObjective as CallableObjective
from nmm.control.functions.objectives.base import Objective as Objective
from nmm.control.functions.objectives.base import WeightedSum as WeightedSum
from nmm.control.functions.objectives.clearance import Clearance as Clearance
from nmm.control.functions.objectives.coordinates import JointRange as JointRange
from nmm.control.functions.objectives.coordinates import LimitBarrier as LimitBarrier
from nmm.control.functions.objectives.coordinates import PreferredPosture as PreferredPosture
from nmm.control.functions.objectives.coordinates import Quadratic as Quadratic
from nmm.control.functions.objectives.coordinates import QuadraticTerm as QuadraticTerm
from nmm.control.functions.objectives.manipulability import (
    DirectionalManipulability as DirectionalManipulability,
)
from nmm.control.functions.objectives.manipulability import InverseCondition as InverseCondition
from nmm.control.functions.objectives.manipulability import Manipulability as Manipulability
from nmm.control.functions.objectives.manipulability import WeightedManipulability as WeightedManipulability
from nmm.control.functions.objectives.potential_energy import PotentialEnergy as PotentialEnergy
