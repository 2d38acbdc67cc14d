"""How much room a robot takes while it moves: what the camera and the ground have to hold."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.playback.placements import Placements
from nmm.playback.rolling import Rolling
from nmm.playback.sticks import appearance
from nmm.robots.robot import Robot

_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


def corners(boxes: Array) -> Array:
    """The eight corners (…, 8, 3) of boxes (…, 2, 3) given by their lowest and highest point."""
    return np.stack([boxes[..., _CORNERS[:, axis], axis] for axis in range(3)], axis=-1)


def robot_boxes(robot: Robot, q: Array, wheels: Array) -> Array:
    """Boxes along the world's axes around everything visible, (K, 2, 3) m, for q (K, n) and wheels (K, D)."""
    placements = Placements(robot)
    model, visuals = robot.display_model, appearance(robot).shapes
    data, geometry_data = model.createData(), visuals.createData()
    local = {
        i: box for i, geometry in enumerate(visuals.geometryObjects) if (box := _local(geometry)) is not None
    }
    boxes = np.empty((len(q), 2, 3))
    for k in range(len(q)):
        pin.updateGeometryPlacements(
            model, data, visuals, geometry_data, placements.configuration(q[k], wheels[k])
        )
        points = [
            box @ placement.rotation.T + placement.translation
            for i, box in local.items()
            for placement in [geometry_data.oMg[i]]
        ]
        # A robot of shapes without bounds is as large as its skeleton.
        everything = np.vstack(points or [data.oMi[i].translation for i in range(model.njoints)])
        boxes[k] = everything.min(axis=0), everything.max(axis=0)
    return boxes


def extent_of(robot: Robot, q: Array) -> float:
    """Diagonal of the box around a robot at q (n,), m."""
    box = robot_boxes(robot, q[np.newaxis], Rolling(robot).settled(q)[np.newaxis])[0]
    return float(np.linalg.norm(np.ptp(box, axis=0)))


def _local(geometry: pin.GeometryObject) -> Array | None:
    """Corners of a geometry's own box, (8, 3); None when it has no bounds (planes, half-spaces)."""
    shape = geometry.geometry
    shape.computeLocalAABB()
    box = np.array([shape.aabb_local.min_, shape.aabb_local.max_])
    return corners(box) if np.all(np.isfinite(box)) and np.all(np.abs(box) < 1e6) else None
