"""Which shapes can meet: the pairs whose distance a robot's collision model holds."""

from __future__ import annotations

from itertools import combinations

import pinocchio as pin


def may_meet(model: pin.Model, first: int, second: int) -> bool:
    """Whether shapes on these two joints' bodies make a pair: not on one body, nor on two that a joint
    connects (these touch by design)."""
    apart = first != second
    return apart and model.parents[first] != second and model.parents[second] != first


def add_pairs(model: pin.Model, geometry: pin.GeometryModel, split: int | None = None) -> None:
    """Add every pair that may meet; with `split`, only pairs of a shape before that index with one after."""
    joints = [shape.parentJoint for shape in geometry.geometryObjects]
    for i, j in combinations(range(len(joints)), 2):
        if (split is None or i < split <= j) and may_meet(model, joints[i], joints[j]):
            geometry.addCollisionPair(pin.CollisionPair(i, j))
