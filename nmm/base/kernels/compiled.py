"""Kernels: plain functions on arrays that run as they are or, compiled by numba, in a 1 kHz loop.

A *kernel* is a module-level function of a given signature in the subset of Python that numba compiles. The
decorator compiles it (cached on disk) and records its address, by which compiled programs call whatever
kernels a user combined: no code is generated, and no combination is compiled anew. `Kernel.plain` is the
undecorated function, for programs in plain Python (`NUMBA_DISABLE_JIT=1`, or `program.py_func`).
"""

from __future__ import annotations

import functools
import logging
import math
import multiprocessing
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

from nmm.base.lazy_call import interrupts_wait

with interrupts_wait():
    import numba

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, is_jitted, lower_builtin, overload, type_callable

from nmm.base.kernels import numba_internals
from nmm.base.kernels.cache import KernelCache, cache_folder

if numba_internals.missing is None:
    from nmm.base.kernels.parts import KernelDispatcher

Plain = Callable[..., Any]

#: qp_dot = G(qp) up: (qp, parameters, G, G_q) with G_q[i, j, k] = dG[i, j] / dqp[k]
PLATFORM = types.void(types.float64[::1], types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1])


class Kernel:
    """A function in two forms: `plain` Python, and `compiled`, which is used when the kernel is called.

    It is compiled, or read from the cache, when it is first called or its `address` is first requested: a run
    pays only for the kernels that it uses.

    Examples
    --------
    >>> kernel = nmm.Unicycle().velocity_map
    >>> G, G_q = np.zeros((3, 2)), np.zeros((3, 2, 3))
    >>> kernel(np.zeros(3), np.zeros(0), G, G_q)
    >>> isinstance(kernel, nmm.extending.Kernel), G[0].tolist(), callable(kernel.plain)
    (True, [1.0, 0.0], True)
    """

    def __init__(self, plain: Plain, signature: Any) -> None:
        self.plain = plain
        self.signature = signature

    def __call__(self, *arguments: Any) -> Any:
        return self.compiled(*arguments)

    @cached_property
    def compiled(self) -> Any:
        """The compiled form; it counts references to arrays only if the kernel creates some."""
        made = compiled(self.plain)
        if is_jitted(made):
            try:
                made.compile(self.signature.args)
            except numba.TypingError:
                made = allocating(self.plain)
                made.compile(self.signature.args)
        return made

    @cached_property
    def address(self) -> int:
        """The address of its machine code, by which compiled programs call it."""
        if numba.config.DISABLE_JIT:
            address = id(self.plain)
        elif problem() is None:
            result = self.compiled.overloads[self.signature.args]
            address = int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
        else:
            made = functools.partial(numba.cfunc, self.signature, error_model="numpy")
            address = int(_kept_by_numba(made, self.plain).address)
        _plain_by_address[address] = self.plain
        return address


_plain_by_address: dict[int, Plain] = {}


def compiled(function: Callable[..., Any], **options: bool) -> Any:
    """`numba.njit` with nmm's options and nmm's cache folder; `.py_func` is the plain function.

    Divisions by zero give inf and nan as in numpy (`error_model`): resolvers report a singular matrix;
    compiled code raises no exception. Arrays are neither created (but see `scratch`) nor returned, as
    counting references to them would take half of a control step. The options are those below.
    """
    if numba.config.DISABLE_JIT:
        return function
    if problem() is not None:
        nogil = options.get("nogil", False)
        return _kept_by_numba(functools.partial(numba.njit, error_model="numpy", nogil=nogil), function)
    return _whole_with_parts(function, **options)


def _whole_with_parts(
    function: Plain, allocates: bool = False, vectorized: bool = False, **options: bool
) -> Any:
    """A function both whole, as `njit` makes it, and as a part of its callers."""
    given = {"nopython": True, "error_model": "numpy", "_nrt": allocates, **options}
    made = KernelDispatcher(function, given, vectorized)
    made._cache = KernelCache(function)  # in place of `enable_caching`
    return made


def _kept_by_numba(decorator: Callable[..., Any], function: Plain) -> Any:
    """A function made by numba's own decorator, cached in nmm's folder where that is writable."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(cache_folder())
    try:
        return decorator(cache=True)(function)
    except RuntimeError:  # it cannot be cached
        return decorator()(function)
    finally:
        numba.config.CACHE_DIR = before


@functools.cache
def problem() -> str | None:
    """What differs from the expected numba internals, or None; logged once, tested once for each cache
    folder.
    """
    works = cache_folder() / f"works_{sys.implementation.cache_tag}"
    if numba_internals.missing is None and not works.is_dir():
        numba_internals.missing = numba_internals.tried(_whole_with_parts, caller)
        if numba_internals.missing is None:
            with suppress(OSError):  # then it is tested again
                works.mkdir(parents=True)
    found = numba_internals.missing
    if found is not None and multiprocessing.parent_process() is None:
        logging.getLogger("nmm").warning(
            "numba %s: %s; nmm compiles by numba's njit alone: the same numbers, later and more slowly",
            numba.__version__,
            found,
        )
    return found


#: Decorator for functions that create or return arrays.
allocating = functools.partial(compiled, allocates=True)

#: Decorator for long-running functions, beside which other threads should run.
compiled_without_gil = functools.partial(compiled, nogil=True)

#: Decorator for such functions with innermost loops over many matrices; short loops would become slower.
vectorized_without_gil = functools.partial(compiled_without_gil, vectorized=True)

#: Decorator for functions inlined into each caller, where some arguments are constant.
inlined_in_callers = functools.partial(compiled, forceinline=True)

#: Decorator for helpers of compiled functions that are plain Python when called from Python.
inlined = numba.extending.register_jitable


def checked_by_caller(function: Any, signature: Any) -> Callable[..., Any]:
    """A compiled function that skips the check of its arguments, which saves a third of a µs; arguments that
    do not have this signature are misread or crash the process."""
    if not is_jitted(function):
        return function  # NUMBA_DISABLE_JIT=1
    function.compile(signature.args)
    return function if problem() is not None else function.overloads[signature.args].entry_point


def kernel(signature: Any) -> Callable[[Plain], Kernel]:
    """Decorator: make a function of one of this module's signatures a `Kernel`."""

    def decorate(function: Plain) -> Kernel:
        return Kernel(function, signature)

    return decorate


def view(memory: Any, first: int, shape: tuple[int, ...]) -> Any:
    """A view of contiguous `memory` from its element `first` on, of the given shape.

    Compiled, it is just a pointer, a shape and strides: slices and `reshape` would also check bounds and
    count references, at half the cost of a control step. The caller of compiled code holds the memory
    meanwhile.
    """
    return memory.reshape(-1)[first : first + math.prod(shape)].reshape(shape)


def generated_in_callers(function: Any, type_of: Any, generate: Any, *kinds: tuple[Any, ...]) -> None:
    """Give a plain function a compiled form, generated in its callers, that may return memory on their stack;
    type_of maps the arguments' types to a type or a signature, kinds are the types for which it is made."""
    type_callable(function)(lambda context: type_of)
    for arguments in kinds:
        lower_builtin(function, *arguments)(generate)


def scratch(extents: Any) -> Any:
    """Memory for a kernel while it runs: `np.empty(extents)`, on the stack when compiled.

    extents is an integer or a tuple. Call it outside loops; the array must be neither returned nor kept.
    """
    return np.empty(extents)


def integer_scratch(extent: int) -> Any:
    """`scratch` for integers."""
    return np.empty(extent, dtype=np.int64)


def _on_the_stack(function: Callable[..., Any], number: Any) -> None:
    def type_of(extents: Any) -> Any:
        return types.Array(number, getattr(extents, "count", 1), "C")

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        several = isinstance(signature.args[0], types.UniTuple)
        extents = cgutils.unpack_tuple(builder, values[0]) if several else [values[0]]
        size = functools.reduce(builder.mul, extents)
        data = builder.alloca(context.get_value_type(number), size=size)
        return array_at(context, builder, signature.return_type, data, extents)

    generated_in_callers(function, type_of, generate, (types.Integer,), (types.UniTuple,))


_on_the_stack(scratch, types.float64)
_on_the_stack(integer_scratch, types.int64)


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


generated_in_callers(view, _type_of_view, _generate_view, (types.Array, types.int64, types.UniTuple))


@inlined
def clear(array: Any) -> None:
    """Set all elements to zero."""
    numbers = view(array, 0, (array.size,))
    for i in range(array.size):
        numbers[i] = 0.0


def caller(signature: Any) -> Callable[..., Any]:
    """A function `call(address, *arguments)` for kernels of one signature, plain and compiled."""
    returned = signature.return_type

    def call(address: int, *arguments: Any) -> Any:
        return _plain_by_address[address](*arguments)

    @intrinsic
    def through_pointer(context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature_here: Any, values: Any) -> Any:
            convention, unpacked = context.call_conv, cgutils.unpack_tuple(builder, values[1])
            if numba_internals.missing is not None:  # the calling convention of `numba.cfunc`
                kinds = [context.get_value_type(kind) for kind in signature.args]
                pointer_type = ir.FunctionType(context.get_value_type(returned), kinds).as_pointer()
                return builder.call(builder.inttoptr(values[0], pointer_type), unpacked)
            pointer_type = convention.get_function_type(returned, signature.args).as_pointer()
            function = builder.inttoptr(values[0], pointer_type)
            status, result = convention.call_function(builder, function, returned, signature.args, unpacked)
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return result

        return returned(types.int64, types.Tuple(signature.args)), generate

    @overload(call)
    def call_compiled(address: Any, *arguments: Any) -> Any:
        def through(address: Any, *arguments: Any) -> Any:
            return through_pointer(address, arguments)

        return through

    return call


call_platform = caller(PLATFORM)
