"""What Pinocchio and Coal found, read where they keep it: no Python call a pair."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.errors import NmmError

#: A result's numbers: d, the normal from the first shape to the second, the nearest points of both.
RESULT = 10


def result_view(model: pin.Model, shapes: pin.GeometryModel, found: pin.GeometryData) -> Array:
    """(pairs, 10) = [d, n, p1, p2] of every pair's last query, as a view; m, world axes.

    Coal keeps these numbers one behind the other; should that ever change, this raises instead of reading
    something else.
    """
    count = len(found.distanceResults)
    if not count:
        return np.zeros((0, RESULT))
    data = model.createData()
    pin.computeDistances(model, data, shapes, found, pin.neutral(model))
    first = found.distanceResults[0].normal
    stride = 8 * RESULT
    if count > 1:
        stride = _address(found.distanceResults[1].normal) - _address(first)
    moved = np.lib.stride_tricks.as_strided(first, (count, RESULT - 1), (stride, 8), writeable=False)
    start = _at(_address(first) - 8, (count, RESULT), (stride, 8), owner=moved)
    for i in range(count):
        one = found.distanceResults[i]
        said = [one.min_distance, *one.normal, *one.getNearestPoint1(), *one.getNearestPoint2()]
        if not np.array_equal(start[i], said, equal_nan=True):
            raise NmmError("this version of Coal keeps distances in another way than nmm expects")
    return start


def placement_view(found: pin.GeometryData) -> Array:
    """(shapes, 12): of every shape R column by column, then p; m, world axes; a view."""
    count = len(found.oMg)
    if not count:
        return np.zeros((0, 12))
    rotation = found.oMg[0].rotation
    stride = 96
    if count > 1:
        stride = _address(found.oMg[1].rotation) - _address(rotation)
    view = _at(_address(rotation), (count, 12), (stride, 8), owner=rotation)
    for i in range(count):
        if _address(found.oMg[i].rotation) != view[i].__array_interface__["data"][0] or (
            _address(found.oMg[i].translation) != view[i, 9:].__array_interface__["data"][0]
        ):
            raise NmmError("this version of Pinocchio keeps placements in another way than nmm expects")
    return view


def _address(array: Array) -> int:
    return int(array.__array_interface__["data"][0])


class _Memory:
    """Memory at an address, and what has to live for it to be there."""

    def __init__(self, address: int, shape: tuple[int, ...], strides: tuple[int, ...], owner: Any) -> None:
        self.__array_interface__ = {
            "data": (address, False),
            "shape": shape,
            "strides": strides,
            "typestr": "<f8",
            "version": 3,
        }
        self.owner = owner


def _at(address: int, shape: tuple[int, ...], strides: tuple[int, ...], owner: Any) -> Array:
    return np.asarray(_Memory(address, shape, strides, owner))
