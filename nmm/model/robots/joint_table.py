"""A model's joints and frames as compiled kinematics read them."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import NmmError
from nmm.base.kernels.kinematics import FrameTable, Joints


def joint_table(model: pin.Model, turned: Sequence[pin.SE3]) -> Joints:
    """The joints of a model whose joints have one number each (`Robot.model`), in their `own_axes`."""
    count = len(model.joints)
    placements, turns, slide = np.zeros((count, 12)), np.zeros(count), np.zeros((count, 3))
    for i in range(count):
        placements[i] = as_row(turned[model.parents[i]].inverse() * model.jointPlacements[i] * turned[i])
        if i:
            linear, angular = twist(model.joints[i], pin.neutral(model))
            turns[i] = float(angular.any())
            slide[i] = turned[i].rotation.T @ linear
    return Joints(
        parent=np.array(list(model.parents), dtype=np.int64),
        coordinate=np.array([0, *(joint.idx_q for joint in list(model.joints)[1:])], dtype=np.int64),
        placement=placements,
        turns=turns,
        slide=slide,
    )


def own_axes(model: pin.Model) -> list[pin.SE3]:
    """For each joint its axes as `joint_table` turns them, in its axes as Pinocchio has them."""
    axes = [pin.SE3.Identity()]
    for i in range(1, len(model.joints)):
        _, angular = twist(model.joints[i], pin.neutral(model))
        rotation = np.eye(3)
        if angular.any():
            rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), angular).toRotationMatrix()
        axes.append(pin.SE3(rotation, np.zeros(3)))
    return axes


def frame_table(model: pin.Model, turned: Sequence[pin.SE3], frames: Sequence[int | None]) -> FrameTable:
    """Frames of a model by their numbers, None for the centre of mass; joints in their `own_axes`."""
    carrier = [-1 if k is None else model.frames[k].parentJoint for k in frames]
    places = [pin.SE3.Identity() if k is None else model.frames[k].placement for k in frames]
    chains = [[] if i < 0 else list(model.supports[i])[1:] for i in carrier]
    masses = np.zeros((len(model.joints), 4))
    for i, inertia in enumerate(model.inertias):
        masses[i] = [inertia.mass, *(turned[i].rotation.T @ inertia.lever)]
    return FrameTable(
        carrier=np.array(carrier, dtype=np.int64),
        placement=np.array(
            [as_row(turned[max(i, 0)].inverse() * place) for i, place in zip(carrier, places, strict=True)]
        ).reshape(-1, 12),
        first=np.cumsum([0, *map(len, chains)], dtype=np.int64),
        chain=np.array([i for chain in chains for i in chain], dtype=np.int64),
        masses=masses,
    )


def as_row(placement: pin.SE3) -> Array:
    """(12,): R column by column, then p."""
    return np.concatenate([placement.rotation.ravel(order="F"), placement.translation])


def placement_rows(placements: pin.StdVec_SE3) -> Array:
    """Placements (count, 12), R column by column, then p: a view that follows Pinocchio's own memory;
    `NmmError` should Pinocchio ever store placements in another way."""
    if not len(placements):
        return np.zeros((0, 12))
    first, last = placements[0], placements[len(placements) - 1]
    start, end = (_address(placement.rotation) for placement in (first, last))
    stride = (end - start) // (len(placements) - 1) if len(placements) > 1 else 96
    rows = np.lib.stride_tricks.as_strided(first.rotation, (len(placements), 12), (stride, 8))
    for placement, row in ((first, rows[0]), (last, rows[-1])):
        places = _address(placement.rotation), _address(placement.translation)
        if places != (_address(row), _address(row[9:])) or not placement.rotation.flags.f_contiguous:
            raise NmmError("this version of Pinocchio keeps placements in another way than nmm expects")
    return rows


def _address(array: Array) -> int:
    return int(array.__array_interface__["data"][0])


def twist(joint: pin.JointModel, q: Array) -> tuple[Array, Array]:
    """How a joint moves at q, any configuration of its model, in its own axes: linear, angular."""
    data = joint.createData()
    joint.calc(data, q)  # the only way to the axis that all joint types offer
    linear, angular = np.array(data.S, dtype=np.float64).reshape(2, 3)
    return linear, angular
