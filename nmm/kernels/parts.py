"""Compiled functions that other compiled functions call: parts of them, without machine code of their own.

numba makes machine code of each function that a compiled one calls, with a door for Python and one for C,
though the caller takes in the function's instructions and optimises all of them again. Of a control step's
hundred functions Python calls three, and compiling for nobody took most of a first run.
"""

from __future__ import annotations

import gc
from typing import Any

from numba._dynfunc import make_function
from numba.core import compiler, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.untyped_passes import (
    FindLiterallyCalls,
    InlineInlinables,
    LiteralPropagationSubPipelinePass,
    LiteralUnroll,
    WithLifting,
)

_NO_DOORS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _PartLibrary(JITCodeLibrary):
    """Instructions to be linked into those of callers, which optimise them and make machine code."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


class _WholeLibrary(JITCodeLibrary):
    """A function and its parts, optimised at once, for loops that run over three or seven numbers.

    Vectorised, these take as long or, for TIAGo's seven joints, a tenth longer, and longer to compile.
    """

    vectorized = False

    def _optimize_final_module(self) -> None:
        manager, builder = self._codegen._module_pass_manager(
            loop_vectorize=self.vectorized, slp_vectorize=False
        )
        with self._recorded_timings.record("nmm's module passes", builder):
            manager.run(self._final_module, builder)


class _VectorLibrary(_WholeLibrary):
    """A function whose innermost loops run over many alike, side by side."""

    vectorized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """Lowering into a `_PartLibrary`."""

    _name = "nmm_part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        result = state["cr"]
        name = result.fndesc.qualname
        # What numba knows the part by; nobody calls it.
        entry = make_function(result.fndesc.lookup_module(), name, name, 0, result.env, (state.library,))
        state.targetctx.insert_user_function(entry, result.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = result._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _WholeLowering(NativeLowering):
    """Lowering of a function with its parts."""

    _name = "nmm_whole_lowering"
    _library = _WholeLibrary

    def run_pass(self, state: Any) -> bool:
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        super().run_pass(state)
        for one in state.library._final_module.global_variables:
            environment = lookup_environment(one.name) if one.name.startswith("_ZN08NumbaEnv") else None
            if environment is not None:
                state.library.codegen.set_env(one.name, environment)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _VectorLowering(_WholeLowering):
    """The same, vectorised."""

    _name = "nmm_vector_lowering"
    _library = _VectorLibrary


#: What kernels are not written in (`with`, `literal_unroll`, functions inlined by their source); each pass
#: goes over the whole function, and numba examines it anew after each.
_NOT_NEEDED = {
    WithLifting,
    InlineInlinables,
    FindLiterallyCalls,
    LiteralUnroll,
    LiteralPropagationSubPipelinePass,
}


class _Flags(compiler.Flags):
    """numba's flags, compared by what was set: it compares all of them, one by one, at each operator."""

    _SAME = hash(compiler.Flags())  # as numba's own, which do not hash what is set

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, compiler.Flags):
            return NotImplemented
        return bool(self._values == other._values or self.values() == other.values())

    def __hash__(self) -> int:
        return self._SAME


class _Compiler(compiler.CompilerBase):
    lowering: type[NativeLowering]

    def define_pipelines(self) -> list[Any]:
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (self.lowering if which is NativeLowering else which, told)
            for which, told in passes.passes
            if which not in _NOT_NEEDED
        ]
        return [passes]


class _PartCompiler(_Compiler):
    lowering = _PartLowering


class _WholeCompiler(_Compiler):
    lowering = _WholeLowering


class _VectorCompiler(_Compiler):
    lowering = _VectorLowering


class KernelDispatcher(CPUDispatcher):
    """A function's machine code for Python, and its instructions for compiled functions that call it."""

    def __init__(self, function: Any, options: dict[str, Any], vectorized: bool = False) -> None:
        super().__init__(
            function,
            targetoptions=dict(options),
            pipeline_class=_VectorCompiler if vectorized else _WholeCompiler,
        )
        self._part = CPUDispatcher(
            function, targetoptions={**options, **_NO_DOORS}, pipeline_class=_PartCompiler
        )
        for dispatcher in (self, self._part):
            dispatcher._compiler._customize_flags = _Flags

    def compile(self, sig: Any) -> Any:
        """numba's, without looks for garbage: what it makes is in use until it is through. A ninth less."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if collects:
                gc.enable()

    @property
    def _numba_type_(self) -> types.Dispatcher:
        return types.Dispatcher(self._part)
