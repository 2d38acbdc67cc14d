"""Kernels: plain functions on arrays that run as they are or, compiled by numba, in a 1 kHz loop.

A *kernel* is a module-level function of a given signature in the subset of Python that numba compiles. The
decorator compiles it (cached on disk) and records its address, by which compiled programs call whatever
kernels a user combined: no code is generated, and no combination is compiled anew. `Kernel.plain` is the
undecorated function, for programs in plain Python (`NUMBA_DISABLE_JIT=1`, or `program.py_func`).
"""

from __future__ import annotations

import functools
import importlib
import inspect
import logging
import math
import multiprocessing
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np

from nmm.base.kernels.cache import works_marker
from nmm.base.kernels.declared import declare
from nmm.base.kernels.entries import PLAIN_OPTIONS, CompileOptions, Entry, entry
from nmm.base.kernels.signatures import (
    Array,
    RecordPlace,
    Tuple,
    Type,
    boolean,
    float64,
    int64,
    signature_of,
    types_of,
    void,
)
from nmm.base.lazy_call import interrupts_wait, lazy_call
from nmm.base.machine import numba_version

Plain = Callable[..., Any]
_LOWERING = "nmm.base.kernels.lowering"

#: qp_dot = G(qp) up: (qp, parameters, G, G_q) with G_q[i, j, k] = dG[i, j] / dqp[k]
PLATFORM = void(float64[::1], float64[::1], float64[:, ::1], float64[:, :, ::1])


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
        self.signature = signature_of(signature)

    def __call__(self, *arguments: Any) -> Any:
        return self._call(*arguments)

    @cached_property
    def _call(self) -> Callable[..., Any]:
        if any(isinstance(kind, RecordPlace) for kind in self.signature.args):
            return self.compiled  # compiled again, for Python's records, which are tuples
        call = checked_by_caller(self.compiled, self.signature)
        return _expecting(self.signature.args, call) if isinstance(self.compiled, Compiled) else call

    @cached_property
    def compiled(self) -> Any:
        """The compiled form; it counts references to arrays only if the kernel creates some."""
        made = compiled(self.plain)
        if isinstance(made, Compiled):
            try:
                made.compile(self.signature.args)
            except _typing_error():
                return _by_numba("compiled_by_numba")(self.plain)
        return made

    @cached_property
    def address(self) -> int:
        """The address of its machine code, by which compiled programs call it."""
        if _disabled():
            address = id(self.plain)
        elif isinstance(self.compiled, Compiled):
            address = self.compiled.entry(self.signature.args).address
        else:
            self._callback = _by_numba("callback")(self.plain, self.signature)
            address = int(self._callback.address)
            if problem() is None:
                call = _by_numba("passing_on")(self.signature, address)
                address = Compiled(call).entry(self.signature.args).address
        _plain_by_address[address] = self.plain
        return address


_plain_by_address: dict[int, Plain] = {}


def _by_numba(name: str) -> Callable[..., Any]:
    """A function of `lowering`, which imports numba."""
    with interrupts_wait():
        return lazy_call(f"{_LOWERING}:{name}")


def _typing_error() -> Any:
    """What numba raises for a function that cannot be compiled so; numba has been imported then."""
    return lazy_call("numba:TypingError")


def _disabled() -> bool:
    """`numba.config.DISABLE_JIT`; numba is imported for it only where a file in this folder may set it."""
    numba = sys.modules.get("numba")
    if hasattr(numba, "config") or os.path.exists(".numba_config.yaml"):
        return bool(importlib.import_module("numba").config.DISABLE_JIT)
    try:
        return bool(int(os.environ.get("NUMBA_DISABLE_JIT", "0")))
    except ValueError:
        return False


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
    if isinstance(kind, Array):
        dtype, ndim = np.dtype(str(kind.dtype)), kind.ndim

        def same(value: Any) -> bool:
            fits = isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == ndim
            return fits and (kind.layout != "C" or bool(value.flags.c_contiguous))

        return same
    if isinstance(kind, Tuple):
        parts = [_check(part) for part in kind.types]

        def all_same(values: Any) -> bool:
            fits = isinstance(values, tuple) and len(values) == len(parts)
            return fits and all(part(value) for part, value in zip(parts, values, strict=True))

        return all_same
    numbers = (int, np.integer) if kind is int64 else (int, float, np.number, np.bool_)
    return lambda value: isinstance(value, numbers)


#: The types of arrays, by what determines them.
_array_types: dict[tuple[Any, ...], Type] = {}
_NUMBERS: dict[type, Type] = {float: float64, int: int64, bool: boolean}
_NUMBERS |= {np.float64: float64, np.int64: int64, np.bool_: boolean}


def _type_of(value: Any) -> Type:
    """The type of an argument from Python."""
    kind = type(value)
    if kind is np.ndarray:
        flags = value.flags
        key = value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable
        if key not in _array_types:
            _array_types[key] = _type_of_array(value)
        return _array_types[key]
    if kind in _NUMBERS:
        return _NUMBERS[kind]
    if isinstance(value, tuple):
        return Tuple(tuple(map(_type_of, value)), kind if kind is not tuple else None)
    return void if value is None else _by_numba("type_of")(value)


def _type_of_array(value: Any) -> Type:
    number = _NUMBERS.get(value.dtype.type) if value.dtype.isnative else None
    if number is None:
        return _by_numba("type_of")(value)
    layout = "C" if value.flags.c_contiguous else "F" if value.flags.f_contiguous else "A"
    return Array(number, value.ndim, layout, bool(value.flags.writeable))


class Compiled:
    """A function that is compiled where it is called: into its compiled callers, and as a whole for Python.

    py_func : the plain function
    entries : what has been compiled or read, by the arguments' types
    """

    def __init__(
        self, function: Plain, inlined: bool = False, options: CompileOptions = PLAIN_OPTIONS
    ) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self.entries: dict[tuple[Type, ...], Entry] = {}
        declare(f"{_LOWERING}:into_callers", self, function, inlined)

    def entry(self, arguments: tuple[Type, ...]) -> Entry:
        """The machine code for these types of arguments, compiled or from the cache."""
        if arguments not in self.entries:
            self.entries[arguments] = entry(self.py_func, arguments, self._options)
        return self.entries[arguments]

    def compile(self, arguments: tuple[Any, ...]) -> None:
        self.entry(types_of(tuple(arguments)))

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named or len(arguments) != self.py_func.__code__.co_argcount:
            bound = inspect.signature(self.py_func).bind(*arguments, **named)
            bound.apply_defaults()
            arguments = bound.args
        return self.entry(tuple(map(_type_of, arguments))).call(*arguments)


def compiled(
    function: Callable[..., Any], *, nogil: bool = False, vectorized: bool = False, inlined: bool = False
) -> Any:
    """Decorator: a function compiled by numba, cached in nmm's folder; `.py_func` is the plain function.

    Divisions by zero give inf and nan as in numpy (`error_model`): resolvers report a singular matrix;
    compiled code raises no exception. Arrays are neither created (but see `scratch`) nor returned, as
    counting references to them would take half of a control step. The options are those below.
    """
    if _disabled():
        return function
    if problem() is not None:
        return _by_numba("compiled_by_numba")(function, nogil)
    return Compiled(function, inlined, CompileOptions(nogil, vectorized))


@functools.cache
def problem() -> str | None:
    """Why `instructions` does not work with this numba, or None; logged once, tried once for each cache
    folder.
    """
    works = works_marker()
    if works.is_dir():
        return None
    with interrupts_wait():
        trial = lazy_call("nmm.base.kernels.trial:fault")
    fault: str | None = trial()
    if fault is None:
        with suppress(OSError):  # then it is tried again
            works.mkdir(parents=True)
    elif multiprocessing.parent_process() is None:
        logging.getLogger("nmm").warning(
            "numba %s: %s; nmm compiles by numba's njit alone: the same numbers, later and more slowly",
            numba_version(),
            fault,
        )
    return fault


#: Decorator for long-running functions, beside which other threads should run.
compiled_without_gil = functools.partial(compiled, nogil=True)

#: Decorator for such functions with innermost loops over many matrices; short loops would become slower.
vectorized_without_gil = functools.partial(compiled_without_gil, vectorized=True)

#: Decorator for functions inlined into each caller, where some arguments are constant.
inlined_in_callers = functools.partial(compiled, inlined=True)


def inlined(function: Plain) -> Plain:
    """Decorator for helpers of compiled functions that are plain Python when called from Python."""
    if _disabled():
        return function
    if problem() is not None:
        return _by_numba("register_jitable")(function)
    declare(f"{_LOWERING}:into_callers", function, function)
    return function


def checked_by_caller(function: Any, signature: Any) -> Callable[..., Any]:
    """A compiled function that skips the check of its arguments, which saves a third of a µs; arguments that
    do not have this signature are misread or crash the process."""
    if isinstance(function, Compiled):
        return function.entry(signature_of(signature).args).call
    if hasattr(function, "compile"):  # numba's own
        function.compile(_by_numba("to_numba")(signature_of(signature)).args)
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


def scratch(extents: Any) -> Any:
    """Memory for a kernel while it runs: `np.empty(extents)`, on the stack when compiled.

    extents is an integer or a tuple. Call it outside loops; the array must be neither returned nor kept.
    """
    return np.empty(extents)


def integer_scratch(extent: int) -> Any:
    """`scratch` for integers."""
    return np.empty(extent, dtype=np.int64)


declare(f"{_LOWERING}:on_the_stack", scratch, float64)
declare(f"{_LOWERING}:on_the_stack", integer_scratch, int64)
declare(f"{_LOWERING}:as_view", view)


def caller(signature: Any) -> Callable[..., Any]:
    """A function `call(address, *arguments)` for kernels of one signature, plain and compiled."""

    def call(address: int, *arguments: Any) -> Any:
        return _plain_by_address[address](*arguments)

    declare(f"{_LOWERING}:by_address", call, signature_of(signature))
    return call


call_platform = caller(PLATFORM)


@inlined
def clear(array: Any) -> None:
    """Set all elements to zero."""
    numbers = view(array, 0, (array.size,))
    for i in range(array.size):
        numbers[i] = 0.0
