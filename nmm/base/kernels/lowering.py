"""Forms in compiled code of `compiled`'s functions, by `numba.extending`; imported to compile something."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable
from numba.extending import register_jitable as register_jitable  # for `compiled`

from nmm.base.kernels import instructions
from nmm.base.kernels.cache import cache_folder
from nmm.base.kernels.declared import register
from nmm.base.kernels.numba_types import to_numba as to_numba
from nmm.base.kernels.numba_types import type_of as type_of
from nmm.base.kernels.signatures import Signature, Type

Plain = Callable[..., Any]


def generated_in_callers(function: Any, type_of: Any, generate: Any, *kinds: tuple[Any, ...]) -> None:
    """Give a plain function a compiled form, generated in its callers, that may return memory on their stack;
    type_of maps the arguments' types to a type or a signature, kinds are the types for which it is made."""
    type_callable(function)(lambda context: type_of)
    for arguments in kinds:
        lower_builtin(function, *arguments)(generate)


def into_callers(key: Any, function: Plain, inlined: bool = False) -> None:
    """Have `key` in compiled code call the function, whose instructions become its callers' own."""
    defaults, count = function.__defaults__ or (), function.__code__.co_argcount
    parts: dict[tuple[Any, ...], Any] = {}

    def after(passed: int) -> tuple[Any, ...]:
        """The defaults of the arguments after so many."""
        return tuple(defaults[len(defaults) - count + passed :])

    def part(arguments: tuple[Any, ...]) -> Any:
        if arguments not in parts:
            whole = (*arguments, *map(numba.typeof, after(len(arguments))))
            parts[arguments] = instructions.written(function, whole, inlined)
        return parts[arguments]

    def type_of(*arguments: Any) -> Any:
        signature = part(tuple(map(types.unliteral, arguments))).signature
        return signature.return_type(*signature.args[: len(arguments)])

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        made = part(signature.args)
        for kind, value in zip(made.signature.args[len(values) :], after(len(values)), strict=True):
            values = [*values, context.get_constant(kind, value)]
        return instructions.call(context, builder, made, values)

    type_of.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]  # numba reads it
    generated_in_callers(key, type_of, generate, (types.VarArg(types.Any),))


def compiled_by_numba(function: Plain, nogil: bool = False) -> Any:
    """A function compiled by `numba.njit`."""
    register()
    return _cached(functools.partial(numba.njit, nogil=nogil), function)


def callback(function: Plain, signature: Signature) -> Any:
    """A function compiled by `numba.cfunc`: it has an address."""
    register()
    return _cached(functools.partial(numba.cfunc, to_numba(signature)), function)


def _cached(decorator: Callable[..., Any], function: Plain) -> Any:
    """A function made by numba's own decorator, cached in nmm's folder where that is writable."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(cache_folder())
    try:
        return decorator(cache=True, error_model="numpy")(function)
    except RuntimeError:  # it cannot be cached
        return decorator(error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before


def on_the_stack(function: Plain, number: Type) -> None:
    """A function (extents) -> array of such numbers, in memory on the caller's stack."""
    kind = to_numba(number)

    def type_of(extents: Any) -> Any:
        return types.Array(kind, getattr(extents, "count", 1), "C")

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        several = isinstance(signature.args[0], types.UniTuple)
        extents = cgutils.unpack_tuple(builder, values[0]) if several else [values[0]]
        size = functools.reduce(builder.mul, extents)
        data = builder.alloca(context.get_value_type(kind), size=size)
        return array_at(context, builder, signature.return_type, data, extents)

    generated_in_callers(function, type_of, generate, (types.Integer,), (types.UniTuple,))


def array_at(context: Any, builder: Any, kind: Any, data: Any, extents: Any) -> Any:
    """For intrinsics: the contiguous array at a pointer, without reference counting."""
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides: list[Any] = []
    stride = itemsize
    for extent in reversed(extents):
        strides.insert(0, stride)
        stride = builder.mul(stride, extent)
    array = context.make_array(kind)(context, builder)
    context.populate_array(array, data=data, shape=extents, strides=strides, itemsize=itemsize, meminfo=None)
    return array._getvalue()


def _type_of_view(memory: Any, first: Any, shape: Any) -> Any:
    extents = types.UniTuple(types.int64, len(shape))
    return types.Array(memory.dtype, len(shape), "C")(memory, types.int64, extents)


def _generate_view(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    owner = context.make_array(signature.args[0])(context, builder, values[0])
    extents = cgutils.unpack_tuple(builder, values[2])
    return array_at(context, builder, signature.return_type, builder.gep(owner.data, [values[1]]), extents)


def as_view(function: Plain) -> None:
    """The function `compiled.view`."""
    kinds = (types.Array, types.int64, types.UniTuple)
    generated_in_callers(function, _type_of_view, _generate_view, kinds)


def at_pointer(function: Plain, name: str) -> None:
    """A function (address, count) -> array of numbers of numba's type `name` that lie there."""
    kind = getattr(types, name)

    def type_of(address: Any, count: Any) -> Any:
        return types.Array(kind, 1, "C")(types.int64, types.int64)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = builder.inttoptr(values[0], context.get_data_type(kind).as_pointer())
        return array_at(context, builder, signature.return_type, data, [values[1]])

    generated_in_callers(function, type_of, generate, (types.int64, types.int64))


def by_address(function: Plain, signature: Signature) -> None:
    """A function (address, *arguments) that calls what lies there, with arguments of a signature."""
    known = to_numba(signature)

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        if instructions.missing is None:
            return instructions.call_address(context, builder, known, values[0], values[1:])
        return _call_by_c(context, builder, known, values[0], values[1:])

    _generated_for(function, known, generate)


def _generated_for(function: Any, signature: Any, generate: Any) -> None:
    """The compiled form of a function (address, *arguments), the arguments being those of a signature."""

    def type_of(*_: Any) -> Any:
        return signature.return_type(types.int64, *signature.args)

    names = ("address", *(f"argument_{k}" for k in range(len(signature.args))))
    positional = inspect.Parameter.POSITIONAL_OR_KEYWORD
    type_of.__signature__ = inspect.Signature(  # type: ignore[attr-defined]  # likewise
        [inspect.Parameter(name, positional) for name in names]
    )
    generated_in_callers(function, type_of, generate, (types.VarArg(types.Any),))


def _call_by_c(context: Any, builder: Any, signature: Any, address: Any, values: Any) -> Any:
    """A call of what `numba.cfunc` compiled."""
    kinds = [context.get_value_type(kind) for kind in signature.args]
    pointer_type = ir.FunctionType(context.get_value_type(signature.return_type), kinds).as_pointer()
    return builder.call(builder.inttoptr(address, pointer_type), values)


def passing_on(signature: Signature, address: int) -> Plain:
    """A function to compile that calls what `numba.cfunc` compiled."""

    known = to_numba(signature)

    def call(address: int, *arguments: Any) -> Any:
        raise NotImplementedError  # for compiled code alone, which `generate` writes

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        return _call_by_c(context, builder, known, values[0], values[1:])

    _generated_for(call, known, generate)
    names = ", ".join(f"argument_{k}" for k in range(len(signature.args)))
    scope = {"call": call, "address": address}
    exec(f"def passing_on({names}):\n    return call(address, {names})", scope)
    return scope["passing_on"]  # type: ignore[return-value]  # a function, defined in the line above
