"""All that nmm uses of numba beyond its documented names (by file), and the fallback without it.

A function in two forms, called from Python and a part of its compiled callers; else `numba.njit` (parts):
    CPUDispatcher, its _compiler, _cache and _numba_type_
Parts: instructions that callers link in and optimise once; else machine code for each function (parts):
    JITCodeLibrary, NativeLowering, register_pass, make_function, lookup_environment, compiler's Flags,
    CompilerBase and DefaultPassBuilder
Passes for features that kernels do not use are skipped; else they run (parts):
    WithLifting, InlineInlinables, FindLiterallyCalls, LiteralUnroll, LiteralPropagationSubPipelinePass
A file for each signature, checked when read; else numba's own files, in the same folder (cache):
    FunctionCache, dumps, CompileResult's _reduce and _rebuild
Cached code is read before numba loads all that it can compile; else after (cache):
    rtsys, numba.np's linalg.ensure_blas and arraymath.ensure_blas
Child processes compile what is not cached; else one process compiles all (ahead):
    cpu_target
References are not counted, and a function is inlined in its callers; else not (compiled):
    the options _nrt and forceinline
Kernels are called by their addresses; else by those of `numba.cfunc`, compiled once more; exceptions in a
kernel (nmm's raise none) are then printed, not raised (compiled):
    overloads[...].library and fndesc, context.call_conv
Calls without a check of the arguments; else with (compiled):
    overloads[...].entry_point
All of it or none is used: with an untested version, where a name below is missing, or where `tried` finds a
fault, `numba.njit(cache=True)` compiles everything: the same numbers, but a first start takes three times as
long, and steps are slower, too. One warning says so (`compiled.problem`). Needed in any case, as by all who
extend numba: `numba.extending`, `numba.core.cgutils`, llvmlite's `ir`, and, for records, `AttributeTemplate`
and `Conversion` (memory).
"""

import math
import tempfile
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from numba import types

#: The numba versions with these internals, as in pyproject.toml.
TESTED = ("0.68",)

#: What is not as expected; None where all names exist.
missing: str | None = None

try:
    from numba._dynfunc import make_function as make_function
    from numba.core import compiler as compiler
    from numba.core.caching import FunctionCache as FunctionCache
    from numba.core.caching import dumps as dumps
    from numba.core.codegen import JITCodeLibrary as JITCodeLibrary
    from numba.core.compiler import CompileResult as CompileResult
    from numba.core.compiler_machinery import register_pass as register_pass
    from numba.core.environment import lookup_environment as lookup_environment
    from numba.core.registry import CPUDispatcher as CPUDispatcher
    from numba.core.registry import cpu_target as cpu_target
    from numba.core.runtime import rtsys as rtsys
    from numba.core.typed_passes import NativeLowering as NativeLowering
    from numba.core.untyped_passes import FindLiterallyCalls as FindLiterallyCalls
    from numba.core.untyped_passes import InlineInlinables as InlineInlinables
    from numba.core.untyped_passes import (
        LiteralPropagationSubPipelinePass as LiteralPropagationSubPipelinePass,
    )
    from numba.core.untyped_passes import LiteralUnroll as LiteralUnroll
    from numba.core.untyped_passes import WithLifting as WithLifting
except ImportError as error:
    missing = str(error)
    FunctionCache: Any = object  # type: ignore[no-redef]  # a base that is never used then

if numba.__version__.rpartition(".")[0] not in TESTED:
    missing = f"it is none of the versions tested ({', '.join(TESTED)})"


#: What the functions below call: set by `tried`.
_part: Any = None
_through: Any = None


def _root(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")
    return math.sqrt(x)


def _both(address: int, x: float) -> float:
    return float(_through(address, x) + _part(x))


def tried(make: Callable[[Any], Any], caller: Callable[[Any], Any]) -> str | None:
    """What does not work, or None. `make` decorates functions that are parts of each other, cached on disk;
    `caller` makes, from a signature, what calls functions by their addresses."""
    global _part, _through
    signature, pair = types.float64(types.float64), (types.int64, types.float64)
    try:
        with tempfile.TemporaryDirectory(prefix="nmm-numba-") as folder:
            _part, _through = make(_root), caller(signature)
            _part._cache.cache_path = folder
            _part.compile(signature.args)
            root = _part.overloads[signature.args]
            if root.entry_point(9.0) != 3.0:
                return "a function called without a check of its arguments answers wrongly"
            address = int(root.library.get_pointer_to_function(root.fndesc.llvm_func_name))
            for _ in range(2):  # the second time from disk
                both = make(_both)
                both._cache.cache_path = folder
                there = both._cache.path_of(pair, cpu_target.target_context.codegen()).exists()
                if both(address, 4.0) != 4.0:
                    return "a function with parts answers wrongly"
                if there and not both.stats.cache_hits:
                    return "what is on disk is not read"
                with suppress(ValueError):
                    both(address, -1.0)
                    return "errors are lost"
    except Exception as error:  # other internals may raise anything
        return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
    return None
