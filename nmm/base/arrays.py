"""The arrays that users give: turned into float64, checked once, with errors that name them."""

import math
from numbers import Integral
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nmm.base.errors import InputError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
Numbers = TypeVar("Numbers", Array, Integers, Flags)


def array(value: ArrayLike, name: str) -> Array:
    """A C-contiguous float64 copy of `value`; `InputError` if it holds anything but finite numbers."""
    try:
        result = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError(where=name, expected="numbers", got=value) from None
    if not np.isfinite(result).all():
        raise InputError(where=name, expected="finite numbers", got=result)
    return result


def interpolated(times: Array | float, t: Array, values: Array) -> Array:
    """Columns of values (N, k), given at t (N,), linear in between at the times: (k,), or (T, k) for (T,)."""
    columns = np.array([np.interp(times, t, column) for column in values.T])
    return np.ascontiguousarray(columns.T).reshape(*np.shape(times), values.shape[1])


def finite(value: Any) -> Any:
    """Plain data for JSON: arrays and tuples as lists, numpy's numbers as Python's, infinity and NaN None."""
    if isinstance(value, np.ndarray | np.generic):
        return finite(value.tolist())
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def infinite(value: ArrayLike, name: str, expected: str) -> Array:
    """A float64 array of at most one axis as one of one axis; infinite numbers may be among them."""
    try:
        result = np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError):
        result = np.array([np.nan])
    if result.ndim != 1 or np.any(np.isnan(result)):
        raise InputError(where=name, expected=expected, got=value)
    return result


def vector(value: ArrayLike, length: int | tuple[int, ...] | None, name: str) -> Array:
    """A finite float64 vector of `length` numbers, or of one of several lengths (any when None)."""
    result = array(value, name)
    lengths = (length,) if isinstance(length, int) else length
    if result.ndim != 1 or (lengths is not None and result.size not in lengths):
        numbers = "a vector" if lengths is None else f"{' or '.join(map(str, lengths))} numbers"
        raise InputError(where=name, expected=numbers, got=result)
    return result


def nonzero_vector(value: ArrayLike, length: int | None, name: str) -> Array:
    result = vector(value, length, name)
    if np.linalg.norm(result) == 0.0:
        raise InputError(where=name, expected="a vector that is not zero", got=result)
    return result


def scalar(
    value: ArrayLike,
    name: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    below: float = math.inf,
    most: float = math.inf,
) -> float:
    """A finite number within the bounds given."""
    if not (isinstance(value, float) and math.isfinite(value)):
        if isinstance(value, bool | np.bool_):
            raise InputError(where=name, expected="a number", got=value)
        result = array(value, name)
        if result.ndim != 0:
            raise InputError(where=name, expected="a number", got=result)
        value = float(result)
    if above < value < below and least <= value <= most:
        return float(value)
    bounds = {"above": above, "from": least, "below": below, "to": most}
    texts = [f"{word} {bound:g}" for word, bound in bounds.items() if math.isfinite(bound)]
    joined = (" " if "to" in texts[-1] else " and ").join(texts)
    raise InputError(where=name, expected=f"a number {joined}", got=float(value))


def positive(value: ArrayLike, name: str) -> float:
    return scalar(value, name, above=0.0)


def counted(value: object, name: str, least: int = 1) -> int:
    """A whole number, at least `least`; one that is written 2.0 is 2, as in a scenario."""
    whole = isinstance(value, Integral) or (isinstance(value, float) and value.is_integer())
    if not whole or isinstance(value, bool) or int(value) < least:  # type: ignore[call-overload]  # a number
        expected = f"a whole number {'above 0' if least == 1 else f'from {least}'}"
        raise InputError(where=name, expected=expected, got=value)
    return int(value)  # type: ignore[call-overload]  # likewise


def matrix(value: ArrayLike, shape: tuple[int, int], name: str) -> Array:
    result = array(value, name)
    if result.shape != shape:
        raise InputError(where=name, expected=f"a matrix of shape {shape}", got=result)
    return result


def increasing(values: Array, name: str) -> None:
    if np.any(np.diff(values) <= 0.0):
        raise InputError(where=name, expected="numbers that increase", got=values)


def unwritable(values: Numbers) -> Numbers:
    values.flags.writeable = False
    return values
