"""A function and all that it calls, compiled to an object file."""

from __future__ import annotations

from functools import partial
from typing import Any

from nmm.base.kernels import instructions
from nmm.base.kernels.declared import register
from nmm.base.kernels.doors import write_door
from nmm.base.kernels.machine_code import object_file
from nmm.base.kernels.numba_types import to_numba
from nmm.base.kernels.signatures import Type


def compile_whole(
    function: Any, arguments: tuple[Type, ...], nogil: bool, vectorized: bool
) -> tuple[tuple[str, str], bytes, bool]:
    """The names of the function and of its door, the object file, and whether other processes can use it."""
    register()
    door = f"nmm_door_{function.__name__}"
    known = tuple(map(to_numba, arguments))
    module, name = instructions.whole(function, known, partial(write_door, door, nogil))
    code = object_file(module, (name, door), vectorized)
    lasting = not any(map(_only_here, (*module.global_variables, *module.functions)))
    return (name, door), code, lasting


def _only_here(part: Any) -> bool:
    """Whether other processes lack it: functions that numba registers, and addresses in this process."""
    if part.is_declaration:
        return "numba" in part.name or part.name.startswith("NRT_")
    return bool(part.name.startswith("numba.dynamic.globals"))
