"""How Python calls machine code: a C function that reads its arguments from Python's objects.

Arguments are arrays, numbers and tuples of these, as a signature of numba says; they are not checked. By
Python's C interface (`METH_FASTCALL`) and numpy's (`PyArrayObject`).
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

_INT, _LONG = ir.IntType(32), ir.IntType(64)
_POINTER = ir.IntType(8).as_pointer()
#: What precedes the fields data, nd, dimensions, strides of an array object, bytes.
_HEAD = object.__basicsize__


def write_door(name: str, nogil: bool, context: Any, module: Any, signature: Any, call: Any) -> None:
    """Add to a module the C function of that name by which Python calls a function of that signature.

    call : (builder, values) -> (result, whether the function has raised an exception)
    """
    function = ir.Function(module, ir.FunctionType(_POINTER, [_POINTER, _POINTER.as_pointer(), _LONG]), name)
    builder = ir.IRBuilder(function.append_basic_block())
    door = _Door(context, builder, module)
    if not all(map(_known_to_python, (*signature.args, signature.return_type))):
        door.fail(function, f"only compiled code calls a function of type {signature}")
        return
    places = [builder.gep(function.args[1], [_LONG(k)]) for k in range(len(signature.args))]
    values = [door.native(*pair) for pair in zip(signature.args, map(builder.load, places), strict=True)]
    with builder.if_then(cgutils.is_not_null(builder, door.call(_POINTER, "PyErr_Occurred")), likely=False):
        builder.ret(_POINTER(None))
    thread = door.call(_POINTER, "PyEval_SaveThread") if nogil else None
    result, raised = call(builder, values)
    if nogil:
        door.call(ir.VoidType(), "PyEval_RestoreThread", thread)
    with builder.if_then(raised, likely=False):
        door.fail(function, "an exception in compiled code: NUMBA_DISABLE_JIT=1 shows which")
    builder.ret(door.python(signature.return_type, result))


def _known_to_python(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return all(map(_known_to_python, kind.types))
    return isinstance(kind, types.Array | types.Float | types.Integer | types.Boolean | types.NoneType)


class _Door:
    def __init__(self, context: Any, builder: Any, module: Any) -> None:
        self.context, self.builder, self.module = context, builder, module

    def call(self, returned: Any, name: str, *arguments: Any) -> Any:
        kind = ir.FunctionType(returned, [argument.type for argument in arguments])
        return self.builder.call(cgutils.get_or_insert_function(self.module, kind, name), arguments)

    def fail(self, function: Any, text: str) -> None:
        """Raise the exception that the function is made with (`python_function`)."""
        text = self.context.insert_const_string(self.module, text)
        self.call(ir.VoidType(), "PyErr_SetString", function.args[0], text)
        self.builder.ret(_POINTER(None))

    def variable(self, name: str) -> Any:
        """A variable of Python's, a pointer."""
        if name in self.module.globals:
            return self.module.globals[name]
        return ir.GlobalVariable(self.module, _POINTER, name)

    def _field(self, value: Any, offset: int, kind: Any) -> Any:
        place = self.builder.gep(value, [_LONG(offset)])
        return self.builder.load(self.builder.bitcast(place, kind.as_pointer()))

    def native(self, kind: Any, value: Any) -> Any:
        """A Python object's value in compiled code."""
        context, builder = self.context, self.builder
        if isinstance(kind, types.Array):
            data = self._field(value, _HEAD, _POINTER)
            extents, strides = (self._field(value, _HEAD + offset, _LONG.as_pointer()) for offset in (16, 24))
            shape, steps = (
                [builder.load(builder.gep(numbers, [_LONG(k)])) for k in range(kind.ndim)]
                for numbers in (extents, strides)
            )
            pointer = context.get_data_type(kind.dtype).as_pointer()
            size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
            array = context.make_array(kind)(context, builder)
            if kind.layout == "C":
                steps, step = [], size
                for extent in reversed(shape):
                    steps.insert(0, step)
                    step = builder.mul(step, extent)
            data = builder.bitcast(data, pointer)
            context.populate_array(array, data=data, shape=shape, strides=steps, itemsize=size, meminfo=None)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            items = [
                self.native(part, self.call(_POINTER, "PyTuple_GetItem", value, _LONG(k)))
                for k, part in enumerate(kind.types)
            ]
            return context.make_tuple(builder, kind, items)
        if isinstance(kind, types.Float):
            return context.cast(
                builder, self.call(ir.DoubleType(), "PyFloat_AsDouble", value), types.float64, kind
            )
        if isinstance(kind, types.Boolean):
            return builder.icmp_signed("!=", self.call(_INT, "PyObject_IsTrue", value), _INT(0))
        if isinstance(kind, types.Integer):
            return context.cast(builder, self.call(_LONG, "PyLong_AsLongLong", value), types.int64, kind)
        raise NotImplementedError(f"{kind} from Python")  # `_known_to_python` has refused it before

    def python(self, kind: Any, value: Any) -> Any:
        """A new Python object of a value."""
        context, builder = self.context, self.builder
        if isinstance(kind, types.NoneType):
            none = builder.bitcast(self.variable("_Py_NoneStruct"), _POINTER)
            self.call(ir.VoidType(), "Py_IncRef", none)
            return none
        if isinstance(kind, types.BaseTuple):
            made = self.call(_POINTER, "PyTuple_New", _LONG(len(kind.types)))
            for k, part in enumerate(kind.types):
                item = self.python(part, builder.extract_value(value, k))
                self.call(_INT, "PyTuple_SetItem", made, _LONG(k), item)
            return made
        if isinstance(kind, types.Float):
            value = context.cast(builder, value, kind, types.float64)
            return self.call(_POINTER, "PyFloat_FromDouble", value)
        if isinstance(kind, types.Boolean):
            return self.call(_POINTER, "PyBool_FromLong", builder.zext(value, _LONG))
        if isinstance(kind, types.Integer):
            return self.call(_POINTER, "PyLong_FromLongLong", context.cast(builder, value, kind, types.int64))
        raise NotImplementedError(f"{kind} to Python")  # likewise
