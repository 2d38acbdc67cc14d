"""Memory layout: records of named arrays, in one block of integers and one of floats.

A compiled call costs about 0.1 µs per array, so all that a control step reads and writes is passed as these
two. Their layout is determined here only. A *record* is a NamedTuple with annotated fields:

    class Problem(NamedTuple):
        J: Matrix                  # a view, (s, m)
        rate: Vector               # a view, (s,)
        state: IntegerVector       # a view of the integers
        residual: Cell             # a view of one number: problem.residual[()] = 0.0
        kernel: int                # a number, read-only
        answer: Answer             # a nested record

It is laid out from an example with the initial values, and read by name, compiled or not:

    memory = Memory()
    place = memory.add(Problem(np.zeros((s, m)), np.zeros(s), ...))
    integers, floats = memory.blocks()
    problem = views(Problem, integers, floats, place)

1. A record's header begins at `integers[place]`: for each array [its start in its block, its extents...], for
   each `int` the number, for a record its header. `header_length` does not depend on shapes, so compiled code
   may hold places as constants. A list of records is an IntegerVector of their places.
2. `views` costs nothing in compiled code, where a record is the blocks and its place (`RecordPlace`), and a
   field is read as a pointer and extents, without checks of bounds or reference counting. The caller of
   compiled code holds the blocks while it runs, and changes no header.
3. Numbers lie in the order of records and of their fields, except those of 5; only this file relies on it.
4. Kernels also take records as arguments (`record_type`), where a field may be a `float`. Fields are read by
   name, never by position or by unpacking, so a new field changes no reader.
5. Fields that a controller's samples change are of sampled kinds (`SampledVector`, ...). Their numbers lie
   together at the end of their block: `sampled` gives both ranges, `keep` and `put_back` copy them.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from itertools import islice
from math import prod
from typing import Annotated, Any, NamedTuple, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, view
from nmm.base.kernels.declared import declare
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.signatures import Array as ArrayType
from nmm.base.kernels.signatures import Tuple, float64, int64


class Kind(NamedTuple):
    """The content of a record's array; sampled : whether a controller's samples change it (5. above)."""

    dtype: type
    ndim: int
    sampled: bool = False


Cell: TypeAlias = Annotated[Array, Kind(np.float64, 0)]
Vector: TypeAlias = Annotated[Array, Kind(np.float64, 1)]
Matrix: TypeAlias = Annotated[Array, Kind(np.float64, 2)]
Matrices: TypeAlias = Annotated[Array, Kind(np.float64, 3)]
Tensors: TypeAlias = Annotated[Array, Kind(np.float64, 4)]
IntegerCell: TypeAlias = Annotated[Integers, Kind(np.int64, 0)]
IntegerVector: TypeAlias = Annotated[Integers, Kind(np.int64, 1)]
IntegerMatrix: TypeAlias = Annotated[Integers, Kind(np.int64, 2)]
SampledCell: TypeAlias = Annotated[Array, Kind(np.float64, 0, sampled=True)]
SampledVector: TypeAlias = Annotated[Array, Kind(np.float64, 1, sampled=True)]
SampledMatrix: TypeAlias = Annotated[Array, Kind(np.float64, 2, sampled=True)]
SampledIntegerCell: TypeAlias = Annotated[Integers, Kind(np.int64, 0, sampled=True)]
SampledIntegerVector: TypeAlias = Annotated[Integers, Kind(np.int64, 1, sampled=True)]

R = TypeVar("R", bound=tuple[Any, ...])


class Blocks(NamedTuple):
    """The two arrays of compiled code; the last two integers are where the sampled numbers of each begin."""

    integers: Integers
    floats: Array


#: The type of `Blocks` in signatures.
BLOCKS = Tuple((int64[::1], float64[::1]), Blocks)


class Memory:
    """Collects records, then lays them out in two blocks; `TypeError` for fields or arrays of other kinds."""

    def __init__(self) -> None:
        self._fields: list[tuple[Any, Any]] = []
        self._length = 0

    def add(self, record: tuple[Any, ...]) -> int:
        """Lay out a record like this one, with its values; returns its place."""
        place = self._length
        self._fields += _flat(type(record), record)
        self._length += header_length(type(record))
        return place

    def blocks(self) -> Blocks:
        """The blocks, with copies of all values."""
        header: list[int] = []
        begins: list[tuple[int, tuple[type, bool]]] = []
        sizes: Counter[tuple[type, bool]] = Counter()
        parts: defaultdict[tuple[type, bool], list[Any]] = defaultdict(list)
        for field, value in self._fields:
            if field is int:
                header.append(value)
                continue
            key, numbers = (field.dtype, field.sampled), np.asarray(value, dtype=field.dtype)
            begins.append((len(header), key))
            header += [sizes[key], *numbers.shape]
            sizes[key] += numbers.size
            parts[key].append(numbers.ravel())
        first: dict[type, int] = {np.int64: self._length, np.float64: 0}
        for place, (dtype, sampled) in begins:
            header[place] += first[dtype] + sampled * sizes[dtype, False]
        ends = [begin + sizes[dtype, False] for dtype, begin in first.items()]
        places, last = np.array(header, dtype=np.int64), np.array(ends, dtype=np.int64)
        integers = np.concatenate([places, *parts[np.int64, False], *parts[np.int64, True], last])
        floats = np.concatenate([np.zeros(0), *parts[np.float64, False], *parts[np.float64, True]])
        return Blocks(integers, floats)


def sampled(integers: Integers, floats: Array) -> tuple[Integers, Array]:
    """Views of the numbers in both blocks that samples change."""
    return integers[integers[-2] : -2], floats[integers[-1] :]


@compiled
def kept(integers: Integers, floats: Array) -> tuple[int, int]:
    """How many integers and floats samples change."""
    count = integers.shape[0] - 2
    return int(count - integers[count]), int(floats.shape[0] - integers[count + 1])


@compiled
def keep(integers: Integers, floats: Array, own_integers: Integers, own: Array) -> None:
    """Copy the numbers that samples change, for `put_back`."""
    count = integers.shape[0] - 2
    copied(view(integers, integers[count], (own_integers.shape[0],)), own_integers)
    copied(view(floats, integers[count + 1], (own.shape[0],)), own)


@compiled
def put_back(integers: Integers, floats: Array, own_integers: Integers, own: Array) -> None:
    """Restore what `keep` copied."""
    count = integers.shape[0] - 2
    copied(own_integers, view(integers, integers[count], (own_integers.shape[0],)))
    copied(own, view(floats, integers[count + 1], (own.shape[0],)))


def views(record: type[R], integers: Integers, floats: Array, place: int) -> R:
    """The record whose header begins at `integers[place]`, its arrays as views of the blocks."""
    header = integers[place : place + header_length(record)].tolist()
    return record(*_parts(record, integers, floats, iter(header)))


def _parts(record: type, integers: Integers, floats: Array, header: Iterator[int]) -> Iterator[Any]:
    for field in fields_of(record).values():
        if isinstance(field, Kind):
            block, first = integers if field.dtype is np.int64 else floats, next(header)
            extents = tuple(islice(header, field.ndim))
            numbers = block[first : first + prod(extents)]
            yield numbers if field.ndim == 1 else numbers.reshape(extents)
        else:
            yield next(header) if field is int else field(*_parts(field, integers, floats, header))


@cache
def header_length(record: type) -> int:
    """The number of integers in such a record's header."""
    return sum(map(length_of, fields_of(record).values()))


@cache
def record_type(record: type) -> Tuple:
    """The type of such a record in signatures."""
    return Tuple(tuple(type_of_field(field, record_type) for field in fields_of(record).values()), record)


def type_of_field(field: Any, of_record: Callable[[type], Any]) -> Any:
    """The type of a field; `of_record` makes that of a nested record."""
    if isinstance(field, Kind):
        return ArrayType(int64 if field.dtype is np.int64 else float64, field.ndim, "C")
    return {int: int64, float: float64}.get(field) or of_record(field)


@cache
def fields_of(record: type) -> dict[str, Any]:
    """The kinds of the fields by name, in order: a `Kind`, `int`, `float` or another record."""
    found: dict[str, Any] = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        kind = get_args(hint)[-1] if get_origin(hint) is Annotated else hint
        if not (isinstance(kind, Kind) or kind in (int, float) or hasattr(kind, "_fields")):
            raise TypeError(
                f"{record.__name__}.{name}: expected a kind of array, int or a record, got {hint}"
            )
        found[name] = kind
    return found


def length_of(field: Any) -> int:
    if field is float:
        raise TypeError("a float of a record is handed over, not laid out: expected a Cell")
    if isinstance(field, Kind):
        return 1 + field.ndim
    return 1 if field is int else header_length(field)


def _flat(record: type, values: tuple[Any, ...]) -> Iterator[tuple[Any, Any]]:
    """The fields of nested records in order, with their values."""
    for (name, field), value in zip(fields_of(record).items(), values, strict=True):
        if field is not int and not isinstance(field, Kind):
            yield from _flat(field, value)
            continue
        if isinstance(field, Kind) and np.ndim(value) != field.ndim:
            raise TypeError(f"{record.__name__}.{name}: expected {field.ndim} extents, got {np.shape(value)}")
        yield field, value


declare("nmm.base.kernels.record_lowering:as_views", views)
