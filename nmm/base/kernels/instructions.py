"""All that nmm uses of numba beyond its documented names: a function's instructions, without machine code.

numba makes optimised machine code of each function that a compiled one calls, although the caller links in
its instructions and optimises them again; of a control step's hundred functions Python calls three. Here
`compile_extra` writes instructions into a library that leaves it at that. All else is documented: LLVM's part
by llvmlite (`machine_code`), types and calls by `numba.extending` (`compiled`).

Where a name below is missing, or `compiled.problem` finds a fault, nmm compiles by `numba.njit` and
`numba.cfunc`: the same numbers, but a first run takes twice the time, and large steps are slower.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba.core import cgutils

#: What is not as expected; None where all works.
missing: str | None = None

try:
    from numba.core.codegen import CodeLibrary
    from numba.core.compiler import Flags, compile_extra
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import cpu_target
except ImportError as error:
    missing = str(error)
    CodeLibrary = Flags = object


class _Instructions(CodeLibrary):
    """Instructions that callers link in, optimise and compile."""

    def __init__(self, name: str) -> None:
        super().__init__(cpu_target.target_context.codegen(), name)
        self.module: Any = None
        self._linked: list[Any] = []

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            if not function.is_declaration:
                function.linkage = "linkonce_odr"
        module = binding.parse_assembly(str(ir_module))
        if self.module is None:  # linked into an empty module, nothing would refer to it
            self.module = module
        else:
            self.module.link_in(module)

    def add_linking_library(self, library: Any) -> None:
        if library not in self._linked:
            self._linked.append(library)

    def finalize(self) -> None:
        for library in self._linked:
            self.module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        self._ensure_finalized()
        return self.module

    def get_function(self, name: str) -> Any:
        return self.module.get_function(name)

    def get_llvm_str(self) -> str:
        return str(self.module)

    def get_asm_str(self) -> str:
        raise NotImplementedError  # there is no machine code yet; numba asks for it to print it only


class _Flags(Flags):
    """Options that are compared by identity; numba compares all of them, one by one, at each operator."""

    __slots__ = ()

    def copy(self) -> _Flags:
        return self


def _flags(inlined: bool) -> _Flags:
    flags = _Flags()
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    flags.error_model, flags.forceinline = "numpy", inlined
    return flags


_FLAGS = {} if missing else {inlined: _flags(inlined) for inlined in (False, True)}


def written(function: Any, arguments: tuple[Any, ...], inlined: bool) -> Any:
    """A function's instructions for these types of arguments, without counting references: `signature`, and
    what the functions below take."""
    typing, target = cpu_target.typing_context, cpu_target.target_context
    library, flags = _Instructions(function.__qualname__), _FLAGS[inlined]
    return compile_extra(typing, target, function, arguments, None, flags, {}, library=library)


def call(context: Any, builder: Any, made: Any, values: Any) -> Any:
    """A call in compiled code of what was `written`."""
    context.active_code_library.add_linking_library(made.library)
    return context.call_internal(builder, made.fndesc, made.signature, values)


def call_address(context: Any, builder: Any, signature: Any, address: Any, values: Any) -> Any:
    """A call in compiled code of a `whole` function by its address."""
    convention, returned = context.call_conv, signature.return_type
    pointer_type = convention.get_function_type(returned, signature.args).as_pointer()
    function = builder.inttoptr(address, pointer_type)
    status, result = convention.call_function(builder, function, returned, signature.args, values)
    with cgutils.if_unlikely(builder, status.is_error):
        convention.return_status_propagate(builder, status)
    return result


def whole(function: Any, arguments: tuple[Any, ...], add_door: Any) -> tuple[Any, str]:
    """The instructions of a function and of all that it calls, with a door, and the function's name in them.

    add_door : (context, module, signature, call) -> None, where call(builder, values) -> (result, whether the
        function has raised an exception)
    """
    with global_compiler_lock:
        cpu_target.typing_context.refresh()
        cpu_target.target_context.refresh()
        made = written(function, arguments, inlined=False)
        context, signature, name = made.target_context, made.signature, made.fndesc.mangled_name
        module = made.library._get_module_for_linking().clone()
        door = _Instructions(name).create_ir_module(name)
        native = context.declare_function(door, made.fndesc)

        def call_native(builder: Any, values: Any) -> tuple[Any, Any]:
            status, result = context.call_conv.call_function(
                builder, native, signature.return_type, signature.args, values
            )
            return result, status.is_error

        add_door(context, door, signature, call_native)
        module.link_in(binding.parse_assembly(str(door)))
        return module, name
