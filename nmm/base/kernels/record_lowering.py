"""Records in compiled code, by `numba.extending`; imported when something is compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import lower_cast, lower_getattr_generic, register_model

from nmm.base.kernels.lowering import array_at, generated_in_callers
from nmm.base.kernels.numba_types import to_numba
from nmm.base.kernels.record_layout import Kind, fields_of, length_of, record_type, type_of_field


class LaidOutRecord(types.Type):
    """A record in compiled code: both blocks and its place. Fields are looked up when read, as a tuple of all
    arrays would pass hundreds of numbers at each call."""

    def __init__(self, record: type) -> None:
        self.record = record
        super().__init__(f"LaidOutRecord({record.__module__}.{record.__qualname__})")

    def can_convert_to(self, _: Any, other: Any) -> Any:
        return Conversion.safe if other == to_numba(record_type(self.record)) else None


def _type_of_field(field: Any) -> Any:
    """numba's type of a field, a nested record laid out, too."""
    if isinstance(field, Kind) or field in (int, float):
        return to_numba(type_of_field(field, record_type))
    return LaidOutRecord(field)


@register_model(LaidOutRecord)
class _LaidOutModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        members = [
            ("integers", types.CPointer(types.int64)),
            ("floats", types.CPointer(types.float64)),
            ("place", types.int64),
        ]
        super().__init__(manager, kind, members)


@infer_getattr
class _FieldTypes(AttributeTemplate):
    key = LaidOutRecord

    def generic_resolve(self, kind: Any, name: str) -> Any:
        """The type of a field; None for an unknown name."""
        field = fields_of(kind.record).get(name)
        return None if field is None else _type_of_field(field)


@lower_getattr_generic(LaidOutRecord)
def _generate_field(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """Instructions that read one field."""
    blocks = cgutils.create_struct_proxy(kind)(context, builder, value)
    fields, index = fields_of(kind.record), kind.record._fields.index(name)
    field, before = fields[name], sum(map(length_of, [*fields.values()][:index]))
    place = builder.add(blocks.place, context.get_constant(types.int64, before))

    def read(k: int) -> Any:
        at = builder.add(place, context.get_constant(types.int64, k))
        loaded = builder.load(builder.gep(blocks.integers, [at]))
        # Headers are constant while compiled code runs, so LLVM need not reread them after each write.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(field, Kind):
        block = blocks.integers if field.dtype is np.int64 else blocks.floats
        extents = [read(k + 1) for k in range(field.ndim)]
        return array_at(context, builder, _type_of_field(field), builder.gep(block, [read(0)]), extents)
    if field is int:
        return read(0)
    part = cgutils.create_struct_proxy(LaidOutRecord(field))(context, builder)
    part.integers, part.floats, part.place = blocks.integers, blocks.floats, place
    return part._getvalue()


@lower_cast(LaidOutRecord, types.BaseTuple)
def _generate_tuple(context: Any, builder: Any, kind: Any, whole: Any, value: Any) -> Any:
    """The record as a tuple, for kernels that are called by their addresses."""
    parts = []
    for name, part in zip(kind.record._fields, whole.types, strict=True):
        read = _generate_field(context, builder, kind, value, name)
        inner = _FieldTypes(None).generic_resolve(kind, name)
        parts.append(_generate_tuple(context, builder, inner, part, read) if inner != part else read)
    return context.make_tuple(builder, whole, parts)


def _type_of_views(record: Any, integers: Any, floats: Any, place: Any) -> Any:
    return LaidOutRecord(record.instance_class)(record, integers, floats, types.int64)


def _generate_views(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    made = cgutils.create_struct_proxy(signature.return_type)(context, builder)
    made.integers, made.floats = (
        context.make_array(kind)(context, builder, value).data
        for kind, value in zip(signature.args[1:3], values[1:3], strict=True)
    )
    made.place = values[3]
    return made._getvalue()


def as_views(function: Any) -> None:
    """The function `record_layout.views`."""
    kinds = (types.NamedTupleClass, types.Array, types.Array, types.int64)
    generated_in_callers(function, _type_of_views, _generate_views, kinds)
