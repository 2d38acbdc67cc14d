"""Numbers on which kernels are run to get formulas: quotients of trigonometric polynomials; coordinates."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from fractions import Fraction
from numbers import Real
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from nmm.base.errors import InputError
from nmm.plugins.symbolic.expansion import Expansion, Ring, exact
from nmm.plugins.symbolic.geometry import Geometry

#: How far from a multiple of π/2 a fixed angle may be and still be one, rad.
_SQUARE = 1e-9


class Untraceable(InputError):
    """A kernel does what has no formula."""


class Traced(NDArrayOperatorsMixin, ABC):
    """Arithmetic together with numbers of Python and numpy. `==` is exact; other comparisons, on which a
    kernel branches, are made at `Ring.sample`, a point in general position."""

    ring: Ring

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if ufunc in (np.equal, np.not_equal):
            return (ufunc is np.equal) != bool(_plus(inputs[0], inputs[1], -1))
        if ufunc in (np.less, np.less_equal, np.greater, np.greater_equal):
            self.ring.branched = True
            return bool(ufunc(*(float(value) for value in inputs)))
        if ufunc not in _OPERATIONS:
            raise Untraceable(f"it takes {ufunc.__name__} of a formula")
        return _OPERATIONS[ufunc](*inputs)

    @abstractmethod
    def quotient(self) -> Quotient:
        """As a quotient of trigonometric polynomials; `Untraceable` where it is none."""


class Quotient(Traced):
    """One trigonometric polynomial over another; lengths alone go into the numerator, as negative powers."""

    def __init__(self, over: Expansion, under: Expansion | None = None) -> None:
        self.ring = over.ring
        self.over = over
        self.under = over.ring.number(1) if under is None else under

    def __bool__(self) -> bool:
        return bool(self.over)

    def __float__(self) -> float:
        return self.over.at_sample() / self.under.at_sample()

    def quotient(self) -> Quotient:
        return self

    def times(self, other: Quotient) -> Quotient:
        a, d = _cancelled(self.over, other.under)
        c, b = _cancelled(other.over, self.under)
        return Quotient(a * c, b * d)

    def plus(self, other: Quotient) -> Quotient:
        under = common_multiple([self.under, other.under])
        return Quotient(*_cancelled(self.above(under) + other.above(under), under))

    def inverse(self) -> Quotient:
        if not self.over:
            raise Untraceable("it divides by what is 0")
        factor, under = self.over.split()
        return Quotient(self.under * factor.inverse(), under)

    def above(self, under: Expansion) -> Expansion:
        """The numerator over `under`, a multiple of the denominator."""
        factor = under.divided(self.under)
        if factor is None:
            raise Untraceable("its denominators have no common multiple")
        return self.over * factor


class Linear(Traced):
    """A combination of coordinates (coefficients by index) plus a constant, rad or m; angles may go into
    cosines and sines, or out as a value."""

    def __init__(self, ring: Ring, terms: dict[int, Fraction], constant: Fraction = Fraction(0)) -> None:
        self.ring = ring
        self.terms = {i: n for i, n in terms.items() if n}
        self.constant = constant

    def __bool__(self) -> bool:
        return bool(self.terms or self.constant)

    def __float__(self) -> float:
        return float(self.constant) + sum(float(n) * self.ring.sample[i] for i, n in self.terms.items())

    def quotient(self) -> Quotient:
        ring, total = self.ring, self.ring.number(self.constant)
        for i, n in self.terms.items():
            if not ring.is_angle[i]:
                total = total + ring.scalar(ring.names[i]).scaled(n)
            elif i in ring.ratios:  # alpha = kappa sin(alpha)
                total = total + (ring.scalar(ring.ratios[i]) * ring.sin({i: 1})).scaled(n)
            else:
                raise Untraceable(f"the angle {ring.names[i]} occurs outside of cosines and sines")
        return Quotient(total)

    @property
    def quarters(self) -> tuple[int, float]:
        """The constant in quarter turns, and the remainder, rad."""
        count = round(float(self.constant) / (math.pi / 2))
        rest = float(self.constant) - count * math.pi / 2
        return count, rest if abs(rest) > _SQUARE else 0.0

    def wave(self, geometry: Geometry) -> tuple[Quotient, Quotient]:
        ring, angle = self.ring, {}
        for i, n in self.terms.items():
            if not ring.is_angle[i] or n.denominator != 1:
                raise Untraceable(f"it takes the cosine or sine of {n} {ring.names[i]}")
            angle[i] = int(n)
        quarters, rest = self.quarters
        if rest:
            angle[geometry.fixed_angle(abs(rest))] = 1 if rest > 0.0 else -1
        cosine, sine = ring.waves(angle, quarters % 4)
        return Quotient(cosine), Quotient(sine)


def quotient(value: Any, ring: Ring) -> Quotient:
    return value.quotient() if isinstance(value, Traced) else Quotient(ring.number(exact(float(value))))


def common_multiple(values: Iterable[Expansion]) -> Expansion:
    """A polynomial divisible by all of them; common factors are found only where one divides another."""
    first, *others = values
    for value in others:
        if value.divided(first) is not None:
            first = value
        elif first.divided(value) is None:
            first = first * value
    return first


def _cancelled(over: Expansion, under: Expansion) -> tuple[Expansion, Expansion]:
    """Both, divided by one of them where that is a factor of the other."""
    if not under.variables():
        return over, under
    if (divided := over.divided(under)) is not None:
        return divided, under.ring.number(1)
    if over.variables() and (divided := under.divided(over)) is not None:
        factor, rest = divided.split()
        return factor.inverse(), rest
    return over, under


def _plus(a: Any, b: Any, sign: int = 1) -> Any:
    ring = (a if isinstance(a, Traced) else b).ring
    linear = [
        value if isinstance(value, Linear) else Linear(ring, {}, exact(float(value)))
        for value in (a, b)
        if isinstance(value, Linear | Real)
    ]
    if len(linear) == 2:
        left, right = linear
        terms = left.terms | {i: left.terms.get(i, Fraction(0)) + sign * n for i, n in right.terms.items()}
        return Linear(ring, terms, left.constant + sign * right.constant)
    return quotient(a, ring).plus(_times(quotient(b, ring), sign))


def _times(a: Any, b: Any) -> Any:
    if isinstance(a, Real):
        a, b = b, a
    if isinstance(b, Real) and isinstance(a, Linear):
        factor = exact(float(b))
        return Linear(a.ring, {i: n * factor for i, n in a.terms.items()}, a.constant * factor)
    return quotient(a, a.ring).times(quotient(b, a.ring))


def _over(a: Any, b: Any) -> Any:
    return _times(a, 1 / exact(float(b)) if isinstance(b, Real) else b.quotient().inverse())


def _power(a: Any, n: int) -> Any:
    return math.prod([a if n > 0 else _over(1, a)] * abs(int(n)))


_OPERATIONS: dict[Any, Any] = {
    np.add: _plus,
    np.subtract: lambda a, b: _plus(a, b, -1),
    np.multiply: _times,
    np.divide: _over,
    np.power: _power,
    np.negative: lambda a: _times(a, -1),
    np.absolute: lambda a: a if a >= 0.0 else _times(a, -1),
}
