"""Kernels run as plain Python on symbols: the function that computes a number computes its formula."""

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from nmm.plugins.symbolic.expansion import Expansion, exact
from nmm.plugins.symbolic.frames import SymbolicFrames
from nmm.plugins.symbolic.quotient import Linear, Quotient, Traced, Untraceable, quotient
from nmm.plugins.symbolic.written import Arc


def traced(kernel: Any, frames: SymbolicFrames) -> Callable[..., Any]:
    """A kernel's own code with `math` and `numpy` that take symbols, also in the functions that it calls;
    branches are taken as at `Ring.sample`."""
    modules = {module: _Module(module, frames) for module in (math, np)}
    known: dict[Any, FunctionType] = {}

    def copied(function: Any) -> Any:
        plain = getattr(function, "plain", getattr(function, "py_func", function))
        if not isinstance(plain, FunctionType):
            return function
        if plain not in known:
            names: dict[str, Any] = {"__builtins__": __builtins__}
            known[plain] = FunctionType(
                plain.__code__, names, plain.__name__, plain.__defaults__, plain.__closure__
            )
            for name in _names(plain.__code__):
                if name in plain.__globals__:
                    names[name] = replaced(plain.__globals__[name])
        return known[plain]

    def replaced(value: Any) -> Any:
        if isinstance(value, ModuleType):
            return modules.get(value, value)
        for module, own in modules.items():
            name = getattr(value, "__name__", "")
            if callable(value) and name and getattr(module, name, None) is value:
                return getattr(own, name)
        return copied(value)

    function: Callable[..., Any] = copied(kernel)
    return function


def _names(code: CodeType) -> Iterator[str]:
    """Names that a function, or one inside it, may look up outside."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


class _Module:
    """`math` or `numpy` for numbers and for symbols."""

    def __init__(self, module: ModuleType, frames: SymbolicFrames) -> None:
        self._module = module
        self._frames = frames

    def __getattr__(self, name: str) -> Any:
        """Everything else: `math` takes numbers alone, numpy asks the symbols."""
        attribute = getattr(self._module, name)
        if self._module is np or not callable(attribute):
            return attribute

        def plain(*arguments: Any) -> Any:
            if any(isinstance(argument, Traced) for argument in arguments) and not name.startswith("is"):
                raise Untraceable(f"it takes math.{name} of a formula")
            return attribute(*arguments)

        return plain

    def zeros(self, shape: Any, dtype: Any = None) -> Any:
        return np.full(shape, 0.0, dtype=object) if dtype is None else np.zeros(shape, dtype)

    empty = zeros

    def cos(self, x: Any) -> Any:
        return self._wave(x, 0) if isinstance(x, Traced) else math.cos(x)

    def sin(self, x: Any) -> Any:
        return self._wave(x, 1) if isinstance(x, Traced) else math.sin(x)

    def tan(self, x: Any) -> Any:
        return self.sin(x) / self.cos(x)

    def _wave(self, x: Any, part: int) -> Quotient:
        if not isinstance(x, Linear):
            raise Untraceable("it takes the cosine or sine of what is no combination of coordinates")
        return x.wave(self._frames.geometry)[part]

    def hypot(self, *parts: Any) -> Any:
        return self.sqrt(sum((part * part for part in parts[1:]), parts[0] * parts[0]))

    def sqrt(self, x: Any) -> Any:
        """The root of the square of what is not below 0; any other root gets a name."""
        if not isinstance(x, Traced):
            return math.sqrt(x)
        square = self._polynomial(x)
        root = self._root(square)
        if root is None:
            (name,) = self._frames.auxiliary(("rho", "root", [square]))
            root = x.ring.scalar(name)
        return Quotient(root)

    def log(self, x: Any) -> Any:
        """The logarithm; that of how far ahead a point is gets a name."""
        if not isinstance(x, Traced):
            return math.log(x)
        value = self._polynomial(x)
        for auxiliary in self._frames.auxiliaries:
            if auxiliary.kind == "ahead" and not value - x.ring.scalar(auxiliary.name):
                (name,) = self._frames.auxiliary(("lambda", "log", auxiliary.arguments))
                return Quotient(x.ring.scalar(name))
        raise Untraceable("it takes math.log of a formula")

    def _root(self, square: Expansion) -> Expansion | None:
        """The root of a number times squares of auxiliary lengths and of sines of angles between 0 and π."""
        if not square:
            return square
        size, rest = square.split()
        ((key, (number, _)),) = size.terms.items()
        root, ring = square.ring.number(1), square.ring
        for auxiliary in self._frames.auxiliaries:
            if auxiliary.kind == "off axis" and rest.variables():
                sine = ring.sin({ring.variable(auxiliary.name, True): 1})
                if (divided := rest.divided(sine * sine)) is not None and not divided.variables():
                    number, rest, root = number * divided.terms[()][0], ring.number(1), sine
        if rest.variables() or number < 0 or not size.variables() <= self._frames.positive():
            return None
        if any(n % 2 for _, n in key):
            return None
        halved = {tuple((i, n // 2) for i, n in key): (exact(math.sqrt(number)), Fraction(0))}
        return root * Expansion(ring, halved)

    def atan2(self, y: Any, x: Any) -> Any:
        """The angle itself where y and x are its sine and cosine, times a positive factor."""
        if not isinstance(y, Traced) and not isinstance(x, Traced):
            return math.atan2(y, x)
        ring = y.ring if isinstance(y, Traced) else x.ring
        sine, cosine = (self._polynomial(quotient(part, ring)) for part in (y, x))
        square = sine * sine + cosine * cosine
        if square:
            self._frames.undefined.append(square.split()[1])
        return self._frames.angle(sine, cosine) or Arc(sine, cosine)

    arctan2 = atan2

    def _polynomial(self, value: Traced) -> Expansion:
        ratio = value.quotient()
        if ratio.under.variables():
            raise Untraceable("it takes a square root or atan2 of quotients")
        return ratio.over
