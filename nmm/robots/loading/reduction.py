"""Joints fixed at given values: frames and shapes stay, on the body above."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray


def told_apart(model: pin.Model, tag: str) -> tuple[pin.Model, dict[str, str]]:
    """A copy in which every frame that is no joint's has a name of its own, and the names by these.

    Pinocchio's reduction and composition look frames up by their names alone, and raise where a link and a
    joint have the same.
    """
    copied, names = model.copy(), {}
    for index, frame in enumerate(copied.frames):
        if index and frame.type != pin.FrameType.JOINT:
            names[f"{tag}{index}"] = frame.name
            frame.name = f"{tag}{index}"
    return copied, names


def at_zero(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joints: Collection[str]
) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """The models with the joints of these names fixed at zero; as they are without any."""
    if not joints:
        return model, tuple(geometries)
    return reduced(model, geometries, [model.getJointId(name) for name in joints], np.zeros(model.nq))


def reduced(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joints: Sequence[int], q: NDArray
) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """The models with some joints fixed at their values in q; frames and shapes in the same order."""
    lean, shapes = pin.buildReducedModel(told_apart(model, "&")[0], list(geometries), list(joints), q)
    # Pinocchio makes the frame of a fixed joint its own parent (whoever climbs up from it never arrives), and
    # does not find it again as the frame of a shape.
    for frame, original in zip(lean.frames, model.frames, strict=True):
        frame.name, frame.parentFrame = original.name, original.parentFrame
    for geometry, before in zip(shapes, geometries, strict=True):
        for shape, original in zip(geometry.geometryObjects, before.geometryObjects, strict=True):
            shape.parentFrame = original.parentFrame
    return lean, tuple(shapes)
