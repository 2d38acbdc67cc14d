"""Trigonometric polynomials in exact arithmetic: sums of e^{i k·angles} times powers of scalars. As products
of cosines and sines become sums of angles at once, equal expressions are equal term by term, and a platform's
heading drops out of the minors without any simplification."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import flint

from nmm.base.errors import InputError

#: Powers of the variables in a term, by their index, sorted; an angle's power is its factor in the exponent.
Key = tuple[tuple[int, int], ...]
#: Real and imaginary part.
Gaussian = tuple[Fraction, Fraction]

_ZERO = Fraction(0)


class TooLarge(InputError):
    """The expressions grew beyond what a person could read: use the numeric analysis."""


class Ring:
    """The variables of an analysis, and how many products of terms it may still take (`budget`)."""

    def __init__(self, budget: int) -> None:
        self.names: list[str] = []
        self.is_angle: list[bool] = []
        #: A value of each variable, together in general position: where a kernel that is traced branches.
        self.sample: list[float] = []
        #: For an angle α, by its index, the name of the scalar α / sin α.
        self.ratios: dict[int, str] = {}
        #: Whether a kernel has compared formulas.
        self.branched = False
        self.budget = budget
        self._left = budget

    def renewed(self) -> None:
        self._left = self.budget

    def variable(self, name: str, angle: bool) -> int:
        """Index of a variable, added if it is new."""
        if name in self.names:
            index = self.names.index(name)
            if self.is_angle[index] != angle:
                raise InputError(f"{name!r} names an angle and a length; give other names", where="symbolic")
            return index
        self.names.append(name)
        self.is_angle.append(angle)
        self.sample.append(0.2 + (0.7548776662 * len(self.names)) % 1.0)
        return len(self.names) - 1

    def spend(self, products: int) -> None:
        self._left -= products
        if self._left < 0:
            raise TooLarge(f"formulas too long to be read (more than {self.budget} products of terms)")

    def number(self, value: Fraction | int) -> Expansion:
        return Expansion(self, {(): (Fraction(value), _ZERO)} if value else {})

    def scalar(self, name: str, power: int = 1) -> Expansion:
        """A length or a straight coordinate, to a power that may be negative."""
        return Expansion(self, {((self.variable(name, False), power),): (Fraction(1), _ZERO)})

    def cos(self, angle: Mapping[int, int]) -> Expansion:
        """cos(k·angles); `angle` holds k by the variables' index."""
        return self._wave(angle, (Fraction(1, 2), _ZERO))

    def sin(self, angle: Mapping[int, int]) -> Expansion:
        return self._wave(angle, (_ZERO, Fraction(-1, 2)))

    def waves(self, angle: Mapping[int, int], quarters: int) -> tuple[Expansion, Expansion]:
        """Cosine and sine of k·angles plus some quarter turns."""
        cosine, sine = self.cos(angle), self.sin(angle)
        for _ in range(quarters):
            cosine, sine = -sine, cosine
        return cosine, sine

    def _wave(self, angle: Mapping[int, int], half: Gaussian) -> Expansion:
        """half e^{i k·angles} and its conjugate."""
        k = tuple(sorted((i, n) for i, n in angle.items() if n))
        if not k:
            return self.number(2 * half[0])
        return Expansion(self, {k: half, tuple((i, -n) for i, n in k): (half[0], -half[1])})


class Expansion:
    """A real trigonometric polynomial: coefficient by key, no coefficient zero."""

    __slots__ = ("ring", "terms")

    def __init__(self, ring: Ring, terms: dict[Key, Gaussian]) -> None:
        self.ring = ring
        self.terms = terms

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expansion) and self.terms == other.terms

    __hash__ = None  # type: ignore[assignment]  # made of a dict

    def __add__(self, other: Expansion) -> Expansion:
        return collected(self.ring, itertools.chain(self.terms.items(), other.terms.items()))

    def __neg__(self) -> Expansion:
        return self.scaled(Fraction(-1))

    def __sub__(self, other: Expansion) -> Expansion:
        return self + (-other)

    def scaled(self, factor: Fraction) -> Expansion:
        if not factor:
            return Expansion(self.ring, {})
        return Expansion(self.ring, {k: (re * factor, im * factor) for k, (re, im) in self.terms.items()})

    def __mul__(self, other: Expansion) -> Expansion:
        self.ring.spend(len(self.terms) * len(other.terms))
        products = (
            (_times(left, right), (a * c - b * d if b and d else a * c, a * d + b * c))
            for left, (a, b) in self.terms.items()
            for right, (c, d) in other.terms.items()
        )
        return collected(self.ring, products)

    def power(self, exponent: int) -> Expansion:
        return math.prod([self] * exponent, start=self.ring.number(1))

    def derivative(self, variable: int) -> Expansion:
        angle = self.ring.is_angle[variable]
        terms: dict[Key, Gaussian] = {}
        for key, (re, im) in self.terms.items():
            n = dict(key).get(variable, 0)
            if n and angle:
                terms[key] = (-im * n, re * n)
            elif n:
                lower = tuple((i, m - (i == variable)) for i, m in key if i != variable or m != 1)
                terms[lower] = (re * n, im * n)
        return Expansion(self.ring, terms)

    def split(self) -> tuple[Expansion, Expansion]:
        """The number and powers of scalars common to all terms, and the rest, which multiples share."""
        scalars = [i for i in sorted(self.variables()) if not self.ring.is_angle[i]]
        least = [(i, min(dict(key).get(i, 0) for key in self.terms)) for i in scalars]
        common = Expansion(self.ring, {tuple((i, n) for i, n in least if n): (Fraction(1), _ZERO)})
        rest = self * common.inverse()
        key = min(rest.terms)
        number = next(part for part in rest.terms[key] if part)
        if any(self.ring.is_angle[i] for i, _ in key):
            number *= 2  # of cos and sin themselves it is 1
        return common.scaled(number), rest.scaled(1 / number)

    def inverse(self) -> Expansion:
        """1 over a number times powers of scalars."""
        ((key, (number, _)),) = self.terms.items()
        return Expansion(self.ring, {tuple((i, -n) for i, n in key): (1 / number, _ZERO)})

    def divided(self, other: Expansion) -> Expansion | None:
        """The quotient; None where the division leaves a remainder."""
        if not other.variables():
            return self * other.inverse()
        if not self or not other.variables() <= self.variables():
            return None if self else self
        self.ring.spend(len(self.terms) * len(other.terms))
        variables = sorted(self.variables())
        context = flint.fmpq_mpoly_ctx.get([f"x{i}" for i in variables], "lex")
        shifts, parts = [], []
        for operand in (self, other):
            powers = [[dict(key).get(i, 0) for i in variables] for key in operand.terms]
            shifts.append([min(column) for column in zip(*powers, strict=True)])
            keys = [tuple(map(operator.sub, key, shifts[-1])) for key in powers]
            for numbers in zip(*operand.terms.values(), strict=True):
                parts.append(context.from_dict(dict(zip(keys, map(rational, numbers), strict=True))))
        a, b, c, d = parts
        norm = c * c + d * d  # of c + d i, by which a + b i is divided
        try:
            re, im = ((part / norm).to_dict() for part in (a * c + b * d, b * c - a * d))
        except flint.utils.flint_exceptions.DomainError:
            return None
        terms = {}
        for exponents in sorted({*re, *im}, reverse=True):
            moved = zip(variables, map(int, exponents), *shifts, strict=True)
            key = tuple((i, n) for i, power, more, less in moved if (n := power + more - less))
            terms[key] = (fraction(re.get(exponents, 0)), fraction(im.get(exponents, 0)))
        return Expansion(self.ring, terms)

    def at_sample(self) -> float:
        ring, total = self.ring, 0.0
        for key, (re, im) in self.terms.items():
            angle = sum(n * ring.sample[i] for i, n in key if ring.is_angle[i])
            size = math.prod(ring.sample[i] ** n for i, n in key if not ring.is_angle[i])
            total += size * (float(re) * math.cos(angle) - float(im) * math.sin(angle))
        return total

    def variables(self) -> set[int]:
        return {i for key in self.terms for i, _ in key}

    def without(self, variables: set[int]) -> Expansion:
        """The terms without these variables: the value where scalars are 0, or its mean over angles."""
        terms = {k: v for k, v in self.terms.items() if not any(i in variables for i, _ in k)}
        return Expansion(self.ring, terms)


def collected(ring: Ring, terms: Iterable[tuple[Key, Gaussian]]) -> Expansion:
    sums: dict[Key, Gaussian] = {}
    for key, (re, im) in terms:
        old = sums.get(key)
        sums[key] = (re, im) if old is None else (old[0] + re, old[1] + im)
    return Expansion(ring, {key: number for key, number in sums.items() if number[0] or number[1]})


def _times(left: Key, right: Key) -> Key:
    if not left or not right:
        return left or right
    powers = dict(left)
    for i, n in right:
        powers[i] = powers.get(i, 0) + n
    return tuple(sorted((i, n) for i, n in powers.items() if n))


def rational(number: Fraction) -> Any:
    return flint.fmpq(number.numerator, number.denominator)


def fraction(number: Any) -> Fraction:
    return Fraction(int(number.numerator), int(number.denominator))


def exact(value: float) -> Fraction:
    """A simple fraction within the float's rounding, else its shortest decimal form."""
    near = Fraction(value).limit_denominator(1_000_000)
    return near if abs(float(near) - value) < 1e-15 * max(1.0, abs(value)) else Fraction(repr(value))


def maximal_minors(rows: list[list[Expansion]]) -> dict[tuple[int, ...], Expansion]:
    """Minors of a matrix (s, m), s <= m, by columns: expanded along rows, each smaller one computed once."""
    ring = rows[0][0].ring
    below: dict[tuple[int, ...], Expansion] = {(): ring.number(1)}
    for size, row in enumerate(reversed(rows), 1):
        minors = {}
        for columns in itertools.combinations(range(len(row)), size):
            total = ring.number(0)
            for i, j in enumerate(columns):
                minor = below[columns[:i] + columns[i + 1 :]]
                if row[j] and minor:
                    product = row[j] * minor
                    total = total - product if i % 2 else total + product
            minors[columns] = total
        below = minors
    return below
