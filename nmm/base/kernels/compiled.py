"""Kernels: plain functions on arrays that run as they are or, compiled by numba, in a 1 kHz loop.

A *kernel* is a module-level function of a given signature in the subset of Python that numba compiles. The
decorator compiles it (cached on disk) and records its address, by which compiled programs call whatever
kernels a user combined: no code is generated, and no combination is compiled anew. `Kernel.plain` is the
undecorated function, for programs in plain Python (`NUMBA_DISABLE_JIT=1`, or `program.py_func`).
"""

from __future__ import annotations

import functools
import inspect
import logging
import math
import multiprocessing
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
from numba.extending import lower_builtin, register_jitable, type_callable

from nmm.base.kernels import instructions
from nmm.base.kernels.cache import cache_folder, works_marker
from nmm.base.kernels.entries import PLAIN_OPTIONS, UNCACHED, Entry, Options, entry

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
        return self._call(*arguments)

    @cached_property
    def _call(self) -> Callable[..., Any]:
        call = checked_by_caller(self.compiled, self.signature)
        return _expecting(self.signature.args, call) if isinstance(self.compiled, Compiled) else call

    @cached_property
    def compiled(self) -> Any:
        """The compiled form; it counts references to arrays only if the kernel creates some."""
        made = compiled(self.plain)
        if isinstance(made, Compiled):
            try:
                made.compile(self.signature.args)
            except numba.TypingError:
                return _compiled_by_numba(numba.njit, self.plain)
        return made

    @cached_property
    def address(self) -> int:
        """The address of its machine code, by which compiled programs call it."""
        if numba.config.DISABLE_JIT:
            address = id(self.plain)
        elif isinstance(self.compiled, Compiled):
            address = self.compiled.entry(self.signature.args).address
        else:
            self._callback = _compiled_by_numba(functools.partial(numba.cfunc, self.signature), self.plain)
            address = int(self._callback.address)
            if problem() is None:
                address = Compiled(_passing_on(self.signature, address)).entry(self.signature.args).address
        _plain_by_address[address] = self.plain
        return address


_plain_by_address: dict[int, Plain] = {}


def _expecting(kinds: tuple[Any, ...], call: Callable[..., Any]) -> Callable[..., Any]:
    """The same function with a check of its arguments, `TypeError` for others."""
    checks = [(k, _check(kind), kind) for k, kind in enumerate(kinds)]

    def checked(*arguments: Any) -> Any:
        if len(arguments) != len(checks):
            raise TypeError(f"expected {len(checks)} arguments, got {len(arguments)}")
        for k, agrees, kind in checks:
            if not agrees(arguments[k]):
                raise TypeError(f"argument {k + 1}: expected {kind}, got {type(arguments[k]).__name__}")
        return call(*arguments)

    return checked


def _check(kind: Any) -> Callable[[Any], bool]:
    """Whether a value from Python is of this type."""
    if isinstance(kind, types.Array):
        dtype, ndim = np.dtype(str(kind.dtype)), kind.ndim

        def same(value: Any) -> bool:
            fits = isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == ndim
            return fits and (kind.layout != "C" or bool(value.flags.c_contiguous))

        return same
    if isinstance(kind, types.BaseTuple):
        parts = [_check(part) for part in kind.types]

        def all_same(values: Any) -> bool:
            fits = isinstance(values, tuple) and len(values) == len(parts)
            return fits and all(part(value) for part, value in zip(parts, values, strict=True))

        return all_same
    numbers = (int, np.integer) if isinstance(kind, types.Integer) else (int, float, np.number, np.bool_)
    return lambda value: isinstance(value, numbers)


#: The numba types of arrays, by what determines them; to ask numba takes several µs.
_array_types: dict[tuple[Any, ...], Any] = {}
_number_types = {float: types.float64, int: types.int64, bool: types.boolean, np.float64: types.float64}


def _type_of(value: Any) -> Any:
    """`numba.typeof`, faster."""
    if type(value) is np.ndarray:
        flags = value.flags
        key = value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable
        if key not in _array_types:
            _array_types[key] = numba.typeof(value)
        return _array_types[key]
    return _number_types.get(type(value)) or numba.typeof(value)


class Compiled:
    """A function that is compiled where it is called: into its compiled callers, and as a whole for Python.

    py_func : the plain function
    entries : what has been compiled or read, by the arguments' types
    """

    def __init__(self, function: Plain, inlined: bool = False, options: Options = PLAIN_OPTIONS) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self.entries: dict[tuple[Any, ...], Entry] = {}
        _into_callers(self, function, inlined)

    def entry(self, arguments: tuple[Any, ...]) -> Entry:
        """The machine code for these types of arguments, compiled or from the cache."""
        if arguments not in self.entries:
            self.entries[arguments] = entry(self.py_func, arguments, self._options)
        return self.entries[arguments]

    def compile(self, arguments: tuple[Any, ...]) -> None:
        self.entry(tuple(arguments))

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named or len(arguments) != self.py_func.__code__.co_argcount:
            bound = inspect.signature(self.py_func).bind(*arguments, **named)
            bound.apply_defaults()
            arguments = bound.args
        return self.entry(tuple(map(_type_of, arguments))).call(*arguments)


def _into_callers(key: Any, function: Plain, inlined: bool = False) -> None:
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

    type_of.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    generated_in_callers(key, type_of, generate, (types.VarArg(types.Any),))


def compiled(
    function: Callable[..., Any], *, nogil: bool = False, vectorized: bool = False, inlined: bool = False
) -> Any:
    """Decorator: a function compiled by numba, cached in nmm's folder; `.py_func` is the plain function.

    Divisions by zero give inf and nan as in numpy (`error_model`): resolvers report a singular matrix;
    compiled code raises no exception. Arrays are neither created (but see `scratch`) nor returned, as
    counting references to them would take half of a control step. The options are those below.
    """
    if numba.config.DISABLE_JIT:
        return function
    if problem() is not None:
        return _compiled_by_numba(functools.partial(numba.njit, nogil=nogil), function)
    return Compiled(function, inlined, Options(nogil, vectorized))


def _compiled_by_numba(decorator: Callable[..., Any], function: Plain) -> Any:
    """A function made by numba's own decorator, cached in nmm's folder where that is writable."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(cache_folder())
    try:
        return decorator(cache=True, error_model="numpy")(function)
    except RuntimeError:  # it cannot be cached
        return decorator(error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before


#: What the trial below calls.
_part: Any = None
_through: Any = None


def _root(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")
    return math.sqrt(x)


def _both(address: int, x: float) -> float:
    return float(_through(address, x) + _part(x))


def _trial() -> str | None:
    """What does not work of `instructions`, or None."""
    global _part, _through
    signature = types.float64(types.float64)
    try:
        _part, _through = Compiled(_root, options=UNCACHED), caller(signature)
        root, both = _part, Compiled(_both, options=UNCACHED)
        if root(9.0) != 3.0:
            return "a function called from Python answers wrongly"
        if both(root.entry(signature.args).address, 4.0) != 4.0:
            return "a function with parts answers wrongly"
        with suppress(RuntimeError):
            both(root.entry(signature.args).address, -1.0)
            return "errors are lost"
    except Exception as error:  # other internals may raise anything
        return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
    return None


@functools.cache
def problem() -> str | None:
    """Why `instructions` does not work with this numba, or None; logged once, tried once for each cache
    folder.
    """
    works = works_marker()
    if instructions.missing is None and not works.is_dir():
        instructions.missing = _trial()
        if instructions.missing is None:
            with suppress(OSError):  # then it is tried again
                works.mkdir(parents=True)
    if instructions.missing is not None and multiprocessing.parent_process() is None:
        logging.getLogger("nmm").warning(
            "numba %s: %s; nmm compiles by numba's njit alone: the same numbers, later and more slowly",
            numba.__version__,
            instructions.missing,
        )
    return instructions.missing


#: Decorator for long-running functions, beside which other threads should run.
compiled_without_gil = functools.partial(compiled, nogil=True)

#: Decorator for such functions with innermost loops over many matrices; short loops would become slower.
vectorized_without_gil = functools.partial(compiled_without_gil, vectorized=True)

#: Decorator for functions inlined into each caller, where some arguments are constant.
inlined_in_callers = functools.partial(compiled, inlined=True)


def inlined(function: Plain) -> Plain:
    """Decorator for helpers of compiled functions that are plain Python when called from Python."""
    if numba.config.DISABLE_JIT:
        return function
    if problem() is not None:
        return register_jitable(function)
    _into_callers(function, function)
    return function


def checked_by_caller(function: Any, signature: Any) -> Callable[..., Any]:
    """A compiled function that skips the check of its arguments, which saves a third of a µs; arguments that
    do not have this signature are misread or crash the process."""
    if isinstance(function, Compiled):
        return function.entry(signature.args).call
    if hasattr(function, "compile"):  # numba's own
        function.compile(signature.args)
    return function


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


def caller(signature: Any) -> Callable[..., Any]:
    """A function `call(address, *arguments)` for kernels of one signature, plain and compiled."""

    def call(address: int, *arguments: Any) -> Any:
        return _plain_by_address[address](*arguments)

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        if instructions.missing is None:
            return instructions.call_address(context, builder, signature, values[0], values[1:])
        return _call_by_c(context, builder, signature, values[0], values[1:])

    _generated_for(call, signature, generate)
    return call


def _generated_for(function: Any, signature: Any, generate: Any) -> None:
    """The compiled form of a function (address, *arguments), the arguments being those of a signature."""

    def type_of(*_: Any) -> Any:
        return signature.return_type(types.int64, *signature.args)

    names = ("address", *(f"argument_{k}" for k in range(len(signature.args))))
    positional = inspect.Parameter.POSITIONAL_OR_KEYWORD
    type_of.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [inspect.Parameter(name, positional) for name in names]
    )
    generated_in_callers(function, type_of, generate, (types.VarArg(types.Any),))


def _call_by_c(context: Any, builder: Any, signature: Any, address: Any, values: Any) -> Any:
    """A call of what `numba.cfunc` compiled."""
    kinds = [context.get_value_type(kind) for kind in signature.args]
    pointer_type = ir.FunctionType(context.get_value_type(signature.return_type), kinds).as_pointer()
    return builder.call(builder.inttoptr(address, pointer_type), values)


def _passing_on(signature: Any, address: int) -> Plain:
    """A function to compile that calls what `numba.cfunc` compiled."""

    def call(address: int, *arguments: Any) -> Any:
        return _plain_by_address[address](*arguments)

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        return _call_by_c(context, builder, signature, values[0], values[1:])

    _generated_for(call, signature, generate)
    names = ", ".join(f"argument_{k}" for k in range(len(signature.args)))
    scope = {"call": call, "address": address}
    exec(f"def passing_on({names}):\n    return call(address, {names})", scope)
    return scope["passing_on"]  # type: ignore[return-value]


call_platform = caller(PLATFORM)


@inlined
def clear(array: Any) -> None:
    """Set all elements to zero."""
    numbers = view(array, 0, (array.size,))
    for i in range(array.size):
        numbers[i] = 0.0
