"""The centre of mass, with one vector a joint: the first moment of what it carries."""

from __future__ import annotations

import numpy as np

from nmm.analysis.formulas.chain import ChainJoint, chain_joint
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.kinematics import Step, carried
from nmm.analysis.formulas.turning import Vector
from nmm.robots.robot import Robot


def center(robot: Robot, geometry: Geometry) -> Vector:
    """Position of the whole robot's centre of mass in world axes.

    The mass is in the symbols: `x_com_q1` is, along x of joint q1's frame, the first moment of all that q1
    carries, as if every joint behind it were there where it is attached, over the robot's mass (m).
    """
    model = robot.model
    masses = np.array([inertia.mass for inertia in model.inertias])
    weights = masses.copy()  # of all that a joint carries
    for index in range(model.njoints - 1, 0, -1):
        weights[model.parents[index]] += weights[index]
    first = [mass * np.array(inertia.lever) for mass, inertia in zip(masses, model.inertias, strict=True)]
    for index in range(1, model.njoints):
        offset = np.array(model.jointPlacements[index].translation)
        first[model.parents[index]] = first[model.parents[index]] + weights[index] * offset
    names = ["com", *(f"com_{name}" for name in list(model.names)[1:])]
    moments = [geometry.vector(vector / weights[0], name) for vector, name in zip(first, names, strict=True)]
    for index in range(model.njoints - 1, 0, -1):
        joint, parent = chain_joint(robot, index), model.parents[index]
        behind = _behind(joint, moments[index], weights[index] / weights[0], geometry)
        moments[parent] = [a + b for a, b in zip(moments[parent], behind, strict=True)]
    return moments[0]


def _behind(joint: ChainJoint, moment: Vector, share: float, geometry: Geometry) -> Vector:
    """A joint's moment in the axes before the joint, without its offset."""
    placement = Step(joint.name, np.zeros(3), joint.rotation)
    motion = Step(joint.name, np.zeros(3), np.eye(3), joint)
    moved = carried(motion, moment, geometry)
    if joint.kind == "prismatic" and share != 1.0:
        weight = geometry.length(share, f"share_{joint.name}")
        moved = [a + weight * (b - a) for a, b in zip(moment, moved, strict=True)]
    return carried(placement, moved, geometry)
