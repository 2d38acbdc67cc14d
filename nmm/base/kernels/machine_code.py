"""From LLVM's instructions to machine code in an object file, and from it into the process."""

from __future__ import annotations

import functools
from collections.abc import Collection
from typing import Any

from llvmlite import binding


@functools.cache
def _machine() -> Any:
    """This processor, for code that stays in the process."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(binding.get_process_triple())
    return target.create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=binding.get_host_cpu_features().flatten(),
        opt=3,
        reloc="static" if target.name.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


@functools.cache
def processor() -> str:
    """What machine code depends on."""
    machine = binding.get_process_triple(), binding.get_host_cpu_name()
    return ",".join((*machine, binding.get_host_cpu_features().flatten()))


def object_file(module: Any, names: Collection[str], vectorized: bool) -> bytes:
    """Optimise a module of which these functions are called, and compile it.

    Loops are vectorised on request only, as that slows down short ones.
    """
    for part in (*module.functions, *module.global_variables):
        if not part.is_declaration:
            part.linkage = "external" if part.name in names else "internal"
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization, options.slp_vectorization = vectorized, False
    builder = binding.create_pass_builder(_machine(), options)
    builder.getModulePassManager().run(module, builder)
    return bytes(_machine().emit_object(module))


#: Keeps machine code in the process.
_engines: list[Any] = []


def load(code: bytes, names: Collection[str]) -> list[int]:
    """The addresses of these functions of an object file, in the process from now on."""
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    return [engine.get_function_address(name) for name in names]
