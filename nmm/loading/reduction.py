"""Joints fixed at given values: frames and shapes stay, on the body above."""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin
from numpy.typing import NDArray


def reduced(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joints: Sequence[int], q: NDArray
) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """The models with some joints fixed at their values in q; frames and shapes in the same order."""
    lean, shapes = pin.buildReducedModel(model, list(geometries), list(joints), q)
    # Pinocchio makes the frame of a fixed joint its own parent (whoever climbs up from it never arrives), and
    # does not find it again as the frame of a shape.
    for frame, original in zip(lean.frames, model.frames, strict=True):
        frame.parentFrame = original.parentFrame
    for geometry, before in zip(shapes, geometries, strict=True):
        for shape, original in zip(geometry.geometryObjects, before.geometryObjects, strict=True):
            shape.parentFrame = original.parentFrame
    return lean, tuple(shapes)
