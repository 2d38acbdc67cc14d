"""Types of what compiled code takes and returns, made without numba, which is imported only to compile.

    STEP = float64(float64, float64[::1], int64[:, ::1])

is the signature of a function of a number, a contiguous vector and a contiguous matrix of integers. The text
of a type is numba's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from nmm.base.lazy_call import lazy_call


class Type:
    """A type in compiled code. Equal types are the same object, so tuples of them are found quickly."""

    _made: dict[tuple[Any, ...], Any] = {}  # noqa: RUF012  # of all classes together
    _parts: tuple[Any, ...]
    text: str

    def __new__(cls, *parts: Any) -> Any:
        key = (cls, *parts)
        if key not in cls._made:
            made = super().__new__(cls)
            made._parts = parts
            made._describe(*parts)
            cls._made.setdefault(key, made)
        return cls._made[key]

    def _describe(self, *parts: Any) -> None:
        """Set the attributes of a new type."""

    def __reduce__(self) -> Any:
        return type(self), self._parts

    def __repr__(self) -> str:
        return self.text

    def __call__(self, *arguments: Type) -> Signature:
        """The signature of a function of such arguments that returns this."""
        return Signature(self, arguments)

    def __getitem__(self, indices: Any) -> Array:
        """An array of such numbers: `float64[::1]` and `[:, ::1]` are contiguous, `[:, :]` need not be."""
        axes = indices if isinstance(indices, tuple) else (indices,)
        return Array(self, len(axes), "C" if axes[-1].step == 1 else "A")


class NumberType(Type):
    """A number, a truth value, or none: name is numba's."""

    def _describe(self, name: str) -> None:
        self.text = name


class Array(Type):
    """dtype : a `NumberType`; ndim; layout : C or F for contiguous arrays, else A; mutable"""

    dtype: Type
    ndim: int
    layout: str
    mutable: bool

    def __new__(cls, dtype: Type, ndim: int, layout: str, mutable: bool = True) -> Any:
        return super().__new__(cls, dtype, ndim, layout, mutable)

    def _describe(self, dtype: Type, ndim: int, layout: str, mutable: bool) -> None:
        self.dtype, self.ndim, self.layout, self.mutable = dtype, ndim, layout, mutable
        self.text = f"{'' if mutable else 'readonly '}array({dtype}, {ndim}d, {layout})"


class Tuple(Type):
    """types : those of its parts; record : the class of a named tuple, else None"""

    types: tuple[Type, ...]
    record: type | None

    def __new__(cls, types: tuple[Type, ...], record: type | None = None) -> Any:
        return super().__new__(cls, types, record)

    def _describe(self, types: tuple[Type, ...], record: type | None) -> None:
        self.types, self.record = types, record
        equal = len(types) > 0 and len({*types}) == 1
        name = ("UniTuple" if equal else "Tuple") if record is None else record.__name__
        parts = f"{types[0]} x {len(types)}" if equal else ", ".join(map(str, types))
        self.text = f"{name}({parts})"


class RecordPlace(Type):
    """record : that of a record in memory (`record_layout`), which compiled functions hand to each other"""

    def _describe(self, record: type) -> None:
        self.record, self.text = record, f"LaidOutRecord({record.__module__}.{record.__qualname__})"


class Other(Type):
    """Any other type of numba's, as it is."""

    def _describe(self, numba_type: Any) -> None:
        self.numba_type, self.text = numba_type, str(numba_type)


class Signature(NamedTuple):
    """The types of what a function returns and takes."""

    return_type: Type
    args: tuple[Type, ...]

    def __str__(self) -> str:
        return f"({', '.join(map(str, self.args))}) -> {self.return_type}"


float64, int64, boolean, void = map(NumberType, ("float64", "int64", "bool", "none"))


def signature_of(signature: Any) -> Signature:
    """A signature made here, of one of numba's."""
    if isinstance(signature, Signature):
        return signature
    return Signature(types_of((signature.return_type,))[0], types_of(signature.args))


def types_of(arguments: tuple[Any, ...]) -> tuple[Type, ...]:
    """Types made here, of numba's or these."""
    return tuple(one if isinstance(one, Type) else lazy_call(FROM_NUMBA)(one) for one in arguments)


FROM_NUMBA = "nmm.base.kernels.numba_types:from_numba"
