"""Compiled functions as parts of other compiled functions, without machine code of their own.

numba makes machine code for each function that a compiled one calls, although the caller links in its
instructions and optimises them again. Python calls three of a control step's hundred functions; compiling
unused machine code of the others took most of a first run.
"""

import gc
from typing import Any

from numba import types

from nmm.base.kernels import numba_internals as internals

_NO_DOORS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _PartLibrary(internals.JITCodeLibrary):
    """Instructions for callers to link in, optimise and compile."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


class _WholeLibrary(internals.JITCodeLibrary):
    """A function and its parts, optimised at once, without vectorisation, which slows down short loops."""

    vectorized = False

    def _optimize_final_module(self) -> None:
        passes = {"loop_vectorize": self.vectorized, "slp_vectorize": False}
        manager, builder = self._codegen._module_pass_manager(**passes)
        with self._recorded_timings.record("nmm's module passes", builder):
            manager.run(self._final_module, builder)


@internals.register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(internals.NativeLowering):
    _name = "nmm_part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        result = state["cr"]
        name = result.fndesc.qualname
        # numba refers to the part by this entry, which is never called.
        module, parts = result.fndesc.lookup_module(), (state.library,)
        entry = internals.make_function(module, name, name, 0, result.env, parts)
        state.targetctx.insert_user_function(entry, result.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = result._replace(cfunc=entry)
        return True


@internals.register_pass(mutates_CFG=True, analysis_only=False)
class _WholeLowering(internals.NativeLowering):
    _name = "nmm_whole_lowering"
    _vectorized = False

    def run_pass(self, state: Any) -> bool:
        state.library = _WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.vectorized = self._vectorized
        state.library.enable_object_caching()
        super().run_pass(state)
        for one in state.library._final_module.global_variables:
            if one.name.startswith("_ZN08NumbaEnv"):
                environment = internals.lookup_environment(one.name)
                if environment is not None:
                    state.library.codegen.set_env(one.name, environment)
        return True


@internals.register_pass(mutates_CFG=True, analysis_only=False)
class _VectorLowering(_WholeLowering):
    """The same with vectorisation, for long innermost loops."""

    _name = "nmm_vector_lowering"
    _vectorized = True


#: Passes for features that kernels do not use (`with`, `literal_unroll`, inlining by source); each would
#: process the whole function, and numba would analyse it again.
_NOT_NEEDED = {
    internals.WithLifting,
    internals.InlineInlinables,
    internals.FindLiterallyCalls,
    internals.LiteralUnroll,
    internals.LiteralPropagationSubPipelinePass,
}


class _Flags(internals.compiler.Flags):
    """numba's flags, compared by what was set; numba compares all of them, one by one, at each operator."""

    _SAME = hash(internals.compiler.Flags())  # as numba's own hash ignores what is set

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, internals.compiler.Flags):
            return NotImplemented
        return bool(self._values == other._values or self.values() == other.values())

    def __hash__(self) -> int:
        return self._SAME


def _compiler(lowering: type[internals.NativeLowering]) -> type[internals.compiler.CompilerBase]:
    class Compiler(internals.compiler.CompilerBase):
        def define_pipelines(self) -> list[Any]:
            passes = internals.compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [
                (lowering if which is internals.NativeLowering else which, reason)
                for which, reason in passes.passes
                if which not in _NOT_NEEDED
            ]
            return [passes]

    return Compiler


_PART, _WHOLE, _VECTORS = map(_compiler, (_PartLowering, _WholeLowering, _VectorLowering))


class KernelDispatcher(internals.CPUDispatcher):
    """A function's machine code for Python, and its instructions for compiled callers."""

    def __init__(self, function: Any, options: dict[str, Any], vectorized: bool = False) -> None:
        whole = _VECTORS if vectorized else _WHOLE
        super().__init__(function, targetoptions=dict(options), pipeline_class=whole)
        self._part = internals.CPUDispatcher(
            function, targetoptions={**options, **_NO_DOORS}, pipeline_class=_PART
        )
        for dispatcher in (self, self._part):
            dispatcher._compiler._customize_flags = _Flags

    def compile(self, sig: Any) -> Any:
        """numba's, without garbage collection, which would find nothing: a ninth faster."""
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
