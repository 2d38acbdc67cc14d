"""Numbers outside of the blocks of records (`record_layout`): large arrays that records only point to.

A record holds an array's address and its length, as integers; who makes the record holds the array. Blocks
are copied where a record is laid out, and a field of a room of 5 cm has a million numbers.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nmm.base.kernels.declared import declare


def address_of(array: NDArray[Any]) -> int:
    """Where the numbers of a contiguous array begin; `ValueError` for another one."""
    if not array.flags.c_contiguous:
        raise ValueError("expected a contiguous array")
    return int(array.ctypes.data)


def doubles_at(address: int, count: int) -> Any:
    """A view of `count` float64 numbers in memory; in compiled code just a pointer."""
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))


def singles_at(address: int, count: int) -> Any:
    """The same of float32."""
    return np.ctypeslib.as_array((ctypes.c_float * count).from_address(address))


def short_integers_at(address: int, count: int) -> Any:
    """The same of int32."""
    return np.ctypeslib.as_array((ctypes.c_int32 * count).from_address(address))


declare("nmm.base.kernels.lowering:at_pointer", doubles_at, "float64")
declare("nmm.base.kernels.lowering:at_pointer", singles_at, "float32")
declare("nmm.base.kernels.lowering:at_pointer", short_integers_at, "int32")
