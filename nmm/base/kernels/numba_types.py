"""The types of `signatures` as numba's, and back; imported when something is compiled."""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
from numba import types

from nmm.base.kernels import signatures
from nmm.base.kernels.signatures import Array, Other, RecordPlace, Signature, Tuple, Type
from nmm.base.lazy_call import lazy_call

_NUMBERS = {
    signatures.float64: types.float64,
    signatures.int64: types.int64,
    signatures.boolean: types.boolean,
    signatures.void: types.void,
}
_KNOWN = {kind: number for number, kind in _NUMBERS.items()}


@cache
def to_numba(kind: Any) -> Any:
    """numba's type or signature."""
    if isinstance(kind, Signature):
        return to_numba(kind.return_type)(*map(to_numba, kind.args))
    if isinstance(kind, Array):
        return types.Array(to_numba(kind.dtype), kind.ndim, kind.layout, readonly=not kind.mutable)
    if isinstance(kind, Tuple):
        return types.BaseTuple.from_types([to_numba(part) for part in kind.types], kind.record or tuple)
    if isinstance(kind, RecordPlace):
        return lazy_call("nmm.base.kernels.record_lowering:LaidOutRecord")(kind.record)
    return kind.numba_type if isinstance(kind, Other) else _NUMBERS[kind]


def from_numba(kind: Any) -> Type:
    """The type whose `to_numba` is this."""
    if isinstance(kind, types.Array) and kind.dtype in _KNOWN and kind.aligned:
        return Array(_KNOWN[kind.dtype], kind.ndim, kind.layout, kind.mutable)
    if isinstance(kind, types.BaseTuple):
        return Tuple(tuple(map(from_numba, kind.types)), getattr(kind, "instance_class", None))
    return _KNOWN[kind] if kind in _KNOWN else Other(kind)


def type_of(value: Any) -> Type:
    """`numba.typeof`."""
    return from_numba(numba.typeof(value))
