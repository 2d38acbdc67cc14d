"""Kernels: plain functions on arrays that run as they stand and, fused by numba, in a 1 kHz loop.

A *kernel* is a module-level function with one of the signatures below, written in the subset of
Python that numba compiles. The decorator compiles it (cached on disk) and notes its address, so
that a compiled program can call whatever kernels a user combined, as a C program calls through
function pointers: no code is generated, no combination is compiled anew, and a new kernel is one
new function in one new file.

The same function runs as it stands: `Kernel.plain` is the undecorated function, and a program run
in plain Python (`NUMBA_DISABLE_JIT=1`, or `program.py_func`) calls the plain kernels.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError
from numba.extending import intrinsic, lower_builtin, overload, type_callable

from nmm.kernels.cache import KernelCache
from nmm.kernels.parts import KernelDispatcher

Plain = Callable[..., Any]


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]

#: qp_dot = G(qp) up: (qp, parameters, G, G_q) with G_q[i, j, k] = dG[i, j] / dqp[k]
PLATFORM = types.void(_vector, _vector, _matrix, _stack)


class Kernel:
    """A function in its two forms: `plain` Python, and `compiled`, which calling the kernel calls.

    It is compiled (or its compiled form read from the cache) when first called or when its
    `address` is first asked for: a run pays for the kernels that it uses.

    Examples
    --------
    >>> kernel = nmm.Unicycle().velocity_map
    >>> G, G_q = np.zeros((3, 2)), np.zeros((3, 2, 3))
    >>> kernel(np.zeros(3), np.zeros(0), G, G_q)
    >>> isinstance(kernel, nmm.Kernel), G[0].tolist(), callable(kernel.plain)
    (True, [1.0, 0.0], True)
    """

    def __init__(self, plain: Plain, signature: Any) -> None:
        self.plain = plain
        self.signature = signature

    def __call__(self, *arguments: Any) -> Any:
        return self.compiled(*arguments)

    @cached_property
    def compiled(self) -> Any:
        """The compiled form; with numba's bookkeeping of arrays only if the kernel makes some of its own."""
        made = compiled(self.plain)
        if isinstance(made, Dispatcher):
            try:
                made.compile(self.signature.args)
            except TypingError:
                made = allocating(self.plain)
                made.compile(self.signature.args)
        return made

    @cached_property
    def address(self) -> int:
        """Where the machine code of the compiled form begins: what compiled programs call it by."""
        if isinstance(self.compiled, Dispatcher):
            result = self.compiled.overloads[self.signature.args]
            address = int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
        else:  # NUMBA_DISABLE_JIT=1: run as it stands
            address = id(self.plain)
        _plain_by_address[address] = self.plain
        return address


_plain_by_address: dict[int, Plain] = {}


def compiled(
    function: Callable[..., Any],
    allocates: bool = False,
    nogil: bool = False,
    vectorized: bool = False,
    forceinline: bool = False,
) -> Any:
    """`numba.njit` with nmm's options and nmm's cache folder; `.py_func` is the plain function.

    Divisions by zero give inf and nan as in numpy (`error_model`): a singular matrix is a case
    that the resolvers report, not an exception out of compiled code. Arrays are neither made (but see
    `scratch`) nor returned: counting references to them would take half of a control step.

    vectorized : for innermost loops that run over many alike; those over three or seven numbers lose by it
    forceinline : callers take in its instructions, with what is constant there
    """
    if numba.config.DISABLE_JIT:
        return function
    options = {"nopython": True, "error_model": "numpy", "_nrt": allocates, "nogil": nogil}
    if forceinline:
        options["forceinline"] = True
    made = KernelDispatcher(function, options, vectorized)
    made._cache = KernelCache(function)  # as `enable_caching` does with numba's own
    return made


#: Decorator for functions that make or return arrays.
allocating = functools.partial(compiled, allocates=True)

#: Decorator for functions that run for so long that other threads should, too.
compiled_without_gil = functools.partial(compiled, nogil=True)

#: Decorator for such functions whose innermost loops run over many matrices side by side.
vectorized_without_gil = functools.partial(compiled_without_gil, vectorized=True)

#: Decorator for functions that are written into each caller, for its constants.
inlined_in_callers = functools.partial(compiled, forceinline=True)

#: Decorator for helpers of compiled functions that stay plain Python when called from Python.
inlined = numba.extending.register_jitable


def checked_by_caller(function: Any, signature: Any) -> Callable[..., Any]:
    """A compiled function for arguments of one signature, which it no longer looks at: a third of a µs less.

    An argument of another type is read as if it were of this one, or crashes.
    """
    if not isinstance(function, Dispatcher):
        return function  # NUMBA_DISABLE_JIT=1: as it stands
    function.compile(signature.args)
    return function.overloads[signature.args].entry_point


def kernel(signature: Any) -> Callable[[Plain], Kernel]:
    """Decorator: make a function of one of this module's signatures a `Kernel`."""

    def decorate(function: Plain) -> Kernel:
        return Kernel(function, signature)

    return decorate


def view(memory: Any, first: int, shape: tuple[int, ...]) -> Any:
    """A view of contiguous `memory` from its element `first` on, of the given shape.

    Compiled, it is a pointer, a shape and strides, and no more: no bounds are checked and no
    references counted, which slices and `reshape` do, at half the cost of a control step. Whoever
    calls the compiled code holds the memory while it runs.
    """
    return memory.reshape(-1)[first : first + math.prod(shape)].reshape(shape)


def generated_in_callers(function: Any, type_of: Any, generate: Any, *kinds: tuple[Any, ...]) -> None:
    """Give a plain function a compiled form that is no function: instructions written where it is called.

    What a function called would hand back is then possible: room on the caller's stack, arrays that nobody
    owns. `type_of` maps the arguments' types to a type or a signature, `kinds` are those it is for.
    """
    type_callable(function)(lambda context: type_of)
    for arguments in kinds:
        lower_builtin(function, *arguments)(generate)


def scratch(extents: Any) -> Any:
    """Room for numbers that a kernel needs while it runs: `np.empty(extents)`, on the stack when compiled.

    Extents are an integer or a tuple. To be called outside of loops; neither returned nor kept.
    """
    return np.empty(extents)


def integer_scratch(extent: int) -> Any:
    """`scratch` for as many integers."""
    return np.empty(extent, dtype=np.int64)


def _on_the_stack(function: Callable[..., Any], number: Any) -> None:
    """Register the compiled form of `scratch`."""

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
    """For intrinsics: the contiguous array at a pointer; no references are counted."""
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
    result = types.Array(memory.dtype, len(shape), "C")
    return result(memory, types.int64, types.UniTuple(types.int64, len(shape)))


def _generate_view(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    owner = context.make_array(signature.args[0])(context, builder, values[0])
    extents = cgutils.unpack_tuple(builder, values[2])
    return array_at(context, builder, signature.return_type, builder.gep(owner.data, [values[1]]), extents)


generated_in_callers(view, _type_of_view, _generate_view, (types.Array, types.int64, types.UniTuple))


@inlined
def clear(array: Any) -> None:
    """Zeros everywhere."""
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
            convention = context.call_conv
            pointer_type = convention.get_function_type(returned, signature.args).as_pointer()
            function = builder.inttoptr(values[0], pointer_type)
            unpacked = cgutils.unpack_tuple(builder, values[1])
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
