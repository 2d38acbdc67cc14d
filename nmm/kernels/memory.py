"""Where numbers lie: records of named arrays, in one block of integers and one of floats.

A compiled call costs about 0.1 µs an array, so all that a control step reads and writes travels as these two.
What lies where in them is worked out here and nowhere else. A *record* is a NamedTuple whose fields say what
they are:

    class Problem(NamedTuple):
        J: Matrix                  # a view, (s, m)
        rate: Vector               # a view, (s,)
        state: IntegerVector       # a view of the integers
        residual: Cell             # a view of one number: problem.residual[()] = 0.0
        kernel: int                # a number, to be read only
        answer: Answer             # a record in the record

It is laid out by an example that holds the values to begin with, and read by name, compiled or not:

    memory = Memory()
    place = memory.add(Problem(np.zeros((s, m)), np.zeros(s), ...))
    integers, floats = memory.blocks()
    problem = views(Problem, integers, floats, place)

The contract:

1. A record's header begins at `integers[place]`: for each array [where its numbers begin in its block, its
   extents...], for each `int` the number itself, for a record in the record its own header. Its length is
   `header_length(Problem)`, the same for all shapes: what is added first has place 0, the next one the length
   of the first, and compiled code may hold such places as constants. A list of records is an IntegerVector of
   their places.
2. `views` costs nothing in compiled code: a record is there the blocks and its place (`LaidOutRecord`), and a
   field read of it is a pointer and extents, without bounds checked or references counted. Whoever calls the
   compiled code holds the blocks while it runs, and changes no header.
3. The numbers of a record lie one behind the other in the order of its fields, records in the order in which
   they were added. Nothing but this file may rely on it.
4. Records are also what kernels take as arguments (`record_type`), where a field may be a `float`. Fields are
   read by name, never by position or by unpacking, so that a field more touches no reader.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import lower_cast, lower_getattr_generic, register_model

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import array_at, generated_in_callers, view


class Kind(NamedTuple):
    """What an array of a record holds: the type of its numbers and how many extents it has."""

    dtype: type
    ndim: int


Cell: TypeAlias = Annotated[Array, Kind(np.float64, 0)]
Vector: TypeAlias = Annotated[Array, Kind(np.float64, 1)]
Matrix: TypeAlias = Annotated[Array, Kind(np.float64, 2)]
Matrices: TypeAlias = Annotated[Array, Kind(np.float64, 3)]
Tensors: TypeAlias = Annotated[Array, Kind(np.float64, 4)]
IntegerCell: TypeAlias = Annotated[Integers, Kind(np.int64, 0)]
IntegerVector: TypeAlias = Annotated[Integers, Kind(np.int64, 1)]
IntegerMatrix: TypeAlias = Annotated[Integers, Kind(np.int64, 2)]

R = TypeVar("R", bound=tuple[Any, ...])


class Blocks(NamedTuple):
    """The two arrays that compiled code is called with."""

    integers: Integers
    floats: Array


class Memory:
    """Records collected, then laid out in two blocks.

    Raises
    ------
    TypeError : a field that is none of this module's kinds, or an array of another kind than its field's
    """

    def __init__(self) -> None:
        self._fields: list[tuple[Any, Any]] = []
        self._length = 0

    def add(self, record: tuple[Any, ...]) -> int:
        """Lay out a record like this one, beginning with its values; returns its place."""
        place = self._length
        self._fields += _flat(type(record), record)
        self._length += header_length(type(record))
        return place

    def blocks(self) -> Blocks:
        """The blocks, with copies of all values."""
        header: list[int] = []
        parts: dict[type, list[Any]] = {np.int64: [], np.float64: []}
        ends = {np.int64: self._length, np.float64: 0}
        for field, value in self._fields:
            if field is int:
                header.append(value)
                continue
            numbers = np.asarray(value, dtype=field.dtype)
            header += [ends[field.dtype], *numbers.shape]
            parts[field.dtype].append(numbers.ravel())
            ends[field.dtype] += numbers.size
        integers = np.concatenate([np.array(header, dtype=np.int64), *parts[np.int64]])
        return Blocks(integers, np.concatenate([np.zeros(0), *parts[np.float64]]))


def views(record: type[R], integers: Integers, floats: Array, place: int) -> R:
    """The record whose header begins at `integers[place]`, its arrays as views of the blocks."""
    parts: list[Any] = []
    for field in _fields(record):
        if isinstance(field, Kind):
            block: Any = integers if field.dtype is np.int64 else floats
            extents = tuple(int(extent) for extent in integers[place + 1 : place + 1 + field.ndim])
            parts.append(view(block, int(integers[place]), extents))
        else:
            parts.append(int(integers[place]) if field is int else views(field, integers, floats, place))
        place += _length(field)
    return record(*parts)


@cache
def header_length(record: type) -> int:
    """How many integers the header of such a record takes."""
    return sum(_length(field) for field in _fields(record))


def record_type(record: type) -> Any:
    """The type that numba knows such a record by."""
    parts = []
    for field in _fields(record):
        if isinstance(field, Kind):
            parts.append(_array_type(field))
        else:
            parts.append({int: types.int64, float: types.float64}.get(field) or record_type(field))
    return types.BaseTuple.from_types(parts, record)


def _array_type(field: Kind) -> Any:
    return types.Array(types.int64 if field.dtype is np.int64 else types.float64, field.ndim, "C")


@cache
def _fields(record: type) -> tuple[Any, ...]:
    """What the fields are, in order: a `Kind`, `int`, `float` or another record."""
    found: list[Any] = []
    for name, hint in get_type_hints(record, include_extras=True).items():
        kind = get_args(hint)[-1] if get_origin(hint) is Annotated else hint
        if not (isinstance(kind, Kind) or kind in (int, float) or hasattr(kind, "_fields")):
            raise TypeError(
                f"{record.__name__}.{name}: expected a kind of array, int or a record, got {hint}"
            )
        found.append(kind)
    return tuple(found)


def _length(field: Any) -> int:
    if field is float:
        raise TypeError("a float of a record is handed over, not laid out: expected a Cell")
    if isinstance(field, Kind):
        return 1 + field.ndim
    return 1 if field is int else header_length(field)


def _flat(record: type, values: tuple[Any, ...]) -> Iterator[tuple[Any, Any]]:
    """The fields that are no records, with their values."""
    for name, field, value in zip(record._fields, _fields(record), values, strict=True):  # type: ignore[attr-defined]  # records are NamedTuples
        if field is not int and not isinstance(field, Kind):
            yield from _flat(field, value)
            continue
        if isinstance(field, Kind) and np.ndim(value) != field.ndim:
            raise TypeError(f"{record.__name__}.{name}: expected {field.ndim} extents, got {np.shape(value)}")
        yield field, value


class LaidOutRecord(types.Type):
    """A record in memory, to compiled code: both blocks and its place. What is read of it is looked up there.

    Handed on as a tuple of all its arrays it would be hundreds of numbers at each call, which numba writes
    down one by one and LLVM removes again.
    """

    def __init__(self, record: type) -> None:
        self.record = record
        super().__init__(f"LaidOutRecord({record.__module__}.{record.__qualname__})")

    def can_convert_to(self, _: Any, other: Any) -> Any:
        return Conversion.safe if other == record_type(self.record) else None


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
        """The type of a field; None for what is none."""
        if name not in kind.record._fields:
            return None
        field = _fields(kind.record)[kind.record._fields.index(name)]
        if isinstance(field, Kind):
            return _array_type(field)
        return types.int64 if field is int else LaidOutRecord(field)


@lower_getattr_generic(LaidOutRecord)
def _generate_field(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """Instructions that read a field: no others than a reader needs."""
    blocks = cgutils.create_struct_proxy(kind)(context, builder, value)
    fields, index = _fields(kind.record), kind.record._fields.index(name)
    field, before = fields[index], sum(_length(one) for one in fields[:index])
    place = builder.add(blocks.place, context.get_constant(types.int64, before))

    def read(k: int) -> Any:
        at = builder.add(place, context.get_constant(types.int64, k))
        loaded = builder.load(builder.gep(blocks.integers, [at]))
        # Headers stand while compiled code runs: LLVM need not read them again after each number written.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(field, Kind):
        block = blocks.integers if field.dtype is np.int64 else blocks.floats
        extents = [read(k + 1) for k in range(field.ndim)]
        return array_at(context, builder, _array_type(field), builder.gep(block, [read(0)]), extents)
    if field is int:
        return read(0)
    part = cgutils.create_struct_proxy(LaidOutRecord(field))(context, builder)
    part.integers, part.floats, part.place = blocks.integers, blocks.floats, place
    return part._getvalue()


@lower_cast(LaidOutRecord, types.BaseTuple)
def _generate_tuple(context: Any, builder: Any, kind: Any, whole: Any, value: Any) -> Any:
    """The record as kernels that are called by their addresses take it."""
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


generated_in_callers(
    views, _type_of_views, _generate_views, (types.NamedTupleClass, types.Array, types.Array, types.int64)
)
