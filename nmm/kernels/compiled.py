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

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
from numba import types
from numba.core import cgutils
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic, overload

from nmm.kernels.cache import KernelCache

Plain = Callable[..., None]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]

#: qp_dot = G(qp) up: (qp, parameters, G, G_q) with G_q[i, j, k] = dG[i, j] / dqp[k]
PLATFORM = types.void(_vector, _vector, _matrix, _stack)


class Kernel:
    """A function in its two forms: `plain` Python, and `compiled`, which calling the kernel calls.

    It is compiled (or its compiled form read from the cache) when first called or when its
    `address` is first asked for: a run pays for the kernels that it uses.
    """

    def __init__(self, plain: Plain, signature: Any) -> None:
        self.plain = plain
        self.compiled = compiled(plain)
        self._signature = signature

    def __call__(self, *arguments: Any) -> None:
        self.compiled(*arguments)

    @cached_property
    def address(self) -> int:
        """Where the machine code of the compiled form begins: what compiled programs call it by."""
        if isinstance(self.compiled, Dispatcher):
            self.compiled.compile(self._signature.args)
            result = self.compiled.overloads[self._signature.args]
            address = int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
        else:  # NUMBA_DISABLE_JIT=1: run as it stands
            address = id(self.plain)
        _plain_by_address[address] = self.plain
        return address


_plain_by_address: dict[int, Plain] = {}


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit` with nmm's options and nmm's cache folder; `.py_func` is the plain function.

    Divisions by zero give inf and nan as in numpy (`error_model`): a singular matrix is a case
    that the resolvers report, not an exception out of compiled code.
    """
    made = numba.njit(error_model="numpy")(function)
    if isinstance(made, Dispatcher):  # the function itself with NUMBA_DISABLE_JIT=1
        made._cache = KernelCache(function)  # type: ignore[attr-defined]  # as `enable_caching` does with numba's own
    return made


#: Decorator for helpers of compiled functions that stay plain Python when called from Python.
inlined = numba.extending.register_jitable


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


@intrinsic
def _view_compiled(context: Any, memory: Any, first: Any, shape: Any) -> Any:
    result = types.Array(memory.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        owner = context.make_array(signature.args[0])(context, builder, values[0])
        extents = cgutils.unpack_tuple(builder, values[2])
        return array_at(context, builder, result, builder.gep(owner.data, [values[1]]), extents)

    return result(memory, types.int64, types.UniTuple(types.int64, len(shape))), generate


@overload(view)
def _view_overload(memory: Any, first: Any, shape: Any) -> Any:
    def through(memory: Any, first: Any, shape: Any) -> Any:
        return _view_compiled(memory, first, shape)

    return through


def caller(signature: Any) -> Callable[..., None]:
    """A function `call(address, *arguments)` for kernels of one signature, plain and compiled."""

    def call(address: int, *arguments: Any) -> None:
        _plain_by_address[address](*arguments)

    @intrinsic
    def through_pointer(context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature_here: Any, values: Any) -> Any:
            convention = context.call_conv
            pointer_type = convention.get_function_type(types.none, signature.args).as_pointer()
            function = builder.inttoptr(values[0], pointer_type)
            unpacked = cgutils.unpack_tuple(builder, values[1])
            status, _ = convention.call_function(builder, function, types.none, signature.args, unpacked)
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.void(types.int64, types.Tuple(signature.args)), generate

    @overload(call)
    def call_compiled(address: Any, *arguments: Any) -> Any:
        def through(address: Any, *arguments: Any) -> None:
            through_pointer(address, arguments)

        return through

    return call


call_platform = caller(PLATFORM)
