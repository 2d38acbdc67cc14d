"""Functions that Python calls at an address, by Python's C interface: a call takes some 50 ns, where numba's
dispatcher takes 500.
"""

from __future__ import annotations

import ctypes
from typing import Any

_METH_FASTCALL = 0x80


class _Method(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_new_function = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
    ("PyCFunction_NewEx", ctypes.pythonapi)
)
_methods: list[_Method] = []


def python_function(name: str, address: int) -> Any:
    """The function that Python calls at an address of a door (`doors`)."""
    _methods.append(_Method(name.encode(), address, _METH_FASTCALL, None))  # as long as the function
    return _new_function(ctypes.addressof(_methods[-1]), RuntimeError, None)
