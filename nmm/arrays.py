"""The arrays that users give: turned into float64, checked once, with errors that name them."""

from __future__ import annotations

import math
from numbers import Integral
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nmm.errors import InputError
from nmm.words import quoted

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
Numbers = TypeVar("Numbers", Array, Integers, Flags)


def array(value: ArrayLike, name: str) -> Array:
    """A C-contiguous float64 copy of `value`; `InputError` if it holds anything but finite numbers."""
    try:
        result = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected numbers, got {quoted(value)}") from None
    if not np.isfinite(result).all():
        raise InputError(f"{name}: expected finite numbers, got {one_line(result)}")
    return result


def interpolated(times: Array | float, t: Array, values: Array) -> Array:
    """Columns of values (N, k), given at t (N,), linear in between at the times: (k,), or (T, k) for (T,)."""
    columns = np.array([np.interp(times, t, column) for column in values.T])
    return np.ascontiguousarray(columns.T).reshape(*np.shape(times), values.shape[1])


def one_line(value: Array) -> str:
    """An array for an error message."""
    return " ".join(np.array2string(value, threshold=20).split())


def vector(value: ArrayLike, length: int | None, name: str) -> Array:
    """A finite float64 vector of `length` numbers (any length when None)."""
    result = array(value, name)
    if result.ndim != 1 or (length is not None and result.size != length):
        expected = "a vector" if length is None else f"{length} numbers"
        raise InputError(f"{name}: expected {expected}, got shape {result.shape}")
    return result


def scalar(value: ArrayLike, name: str) -> float:
    """A finite number."""
    if isinstance(value, float) and math.isfinite(value):
        return float(value)
    if isinstance(value, bool | np.bool_):
        raise InputError(f"{name}: expected a number, got {value}")
    result = array(value, name)
    if result.ndim != 0:
        raise InputError(f"{name}: expected a number, got shape {result.shape}")
    return float(result)


def positive(value: ArrayLike, name: str) -> float:
    """A finite number above zero."""
    result = scalar(value, name)
    if result <= 0.0:
        raise InputError(f"{name}: expected a number above 0, got {result:g}")
    return result


def counted(value: object, name: str, least: int = 1) -> int:
    """A whole number, at least `least`; one that is written 2.0 is 2, as in a scenario."""
    whole = isinstance(value, Integral) or (isinstance(value, float) and value.is_integer())
    if not whole or isinstance(value, bool) or int(value) < least:  # type: ignore[call-overload]  # a number
        expected = "above 0" if least == 1 else f"from {least}"
        raise InputError(f"{name}: expected a whole number {expected}, got {quoted(value)}")
    return int(value)  # type: ignore[call-overload]  # likewise


def matrix(value: ArrayLike, shape: tuple[int, int], name: str) -> Array:
    """A finite float64 matrix of the given shape."""
    result = array(value, name)
    if result.shape != shape:
        raise InputError(f"{name}: expected a matrix of shape {shape}, got {result.shape}")
    return result


def unwritable(values: Numbers) -> Numbers:
    """The very array, which nobody can change from now on."""
    values.flags.writeable = False
    return values
