"""Trigonometric polynomials in exact arithmetic: sums of e^{i k·angles} times powers of scalars.

Products of cosines and sines become sums of angles at once, so that equal expressions are equal term by term
and a platform's heading falls out of the minors without any simplification.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from fractions import Fraction

from sympy import QQ, QQ_I
from sympy.polys.rings import ring as polynomial_ring

from nmm.errors import InputError

#: Powers of the variables in a term, by their index, sorted; an angle's power is its factor in the exponent.
Key = tuple[tuple[int, int], ...]
#: Real and imaginary part.
Gaussian = tuple[Fraction, Fraction]

_ZERO = Fraction(0)


class TooLarge(InputError):
    """The expressions grew beyond what a person could read: use the numeric analysis."""


class Ring:
    """The variables of an analysis, and how much work it may still do.

    Parameters
    ----------
    budget : products of terms after which `TooLarge` is raised

    Attributes
    ----------
    names, is_angle : of each variable
    sample : a value of each, together in general position: where a kernel that is traced branches
    ratios : for an angle α, by its index, the name of the scalar α / sin α
    branched : whether a kernel has compared formulas
    """

    def __init__(self, budget: int) -> None:
        self.names: list[str] = []
        self.is_angle: list[bool] = []
        self.sample: list[float] = []
        self.ratios: dict[int, str] = {}
        self.branched = False
        self.budget = budget
        self._left = budget

    def renewed(self) -> None:
        """The whole budget again, for another analysis in the same variables."""
        self._left = self.budget

    def variable(self, name: str, angle: bool) -> int:
        """Index of a variable, which is made when it is new."""
        if name in self.names:
            index = self.names.index(name)
            if self.is_angle[index] != angle:
                raise InputError(f"symbolic: {name!r} names an angle and a length; give other names")
            return index
        self.names.append(name)
        self.is_angle.append(angle)
        self.sample.append(0.2 + (0.7548776662 * len(self.names)) % 1.0)
        return len(self.names) - 1

    def spend(self, products: int) -> None:
        """Count work; `TooLarge` when none is left."""
        self._left -= products
        if self._left < 0:
            raise TooLarge(f"formulas too long to be read (more than {self.budget} products of terms)")

    def number(self, value: Fraction | int) -> Expansion:
        """A constant."""
        return Expansion(self, {(): (Fraction(value), _ZERO)} if value else {})

    def scalar(self, name: str, power: int = 1) -> Expansion:
        """A length or a straight coordinate, to a power that may be negative."""
        return Expansion(self, {((self.variable(name, False), power),): (Fraction(1), _ZERO)})

    def cos(self, angle: Mapping[int, int]) -> Expansion:
        """cos(k·angles); `angle` holds k by the variables' index."""
        return self.wave(angle, (Fraction(1, 2), _ZERO))

    def sin(self, angle: Mapping[int, int]) -> Expansion:
        """sin(k·angles)."""
        return self.wave(angle, (_ZERO, Fraction(-1, 2)))

    def wave(self, angle: Mapping[int, int], half: Gaussian) -> Expansion:
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
        terms = dict(self.terms)
        for key, (re, im) in other.terms.items():
            old = terms.get(key)
            new = (re, im) if old is None else (old[0] + re, old[1] + im)
            if new[0] or new[1]:
                terms[key] = new
            else:
                del terms[key]
        return Expansion(self.ring, terms)

    def __neg__(self) -> Expansion:
        return self.scaled(Fraction(-1))

    def __sub__(self, other: Expansion) -> Expansion:
        return self + (-other)

    def scaled(self, factor: Fraction) -> Expansion:
        """Times a number."""
        if not factor:
            return Expansion(self.ring, {})
        return Expansion(self.ring, {k: (re * factor, im * factor) for k, (re, im) in self.terms.items()})

    def __mul__(self, other: Expansion) -> Expansion:
        self.ring.spend(len(self.terms) * len(other.terms))
        terms: dict[Key, Gaussian] = {}
        for one, (a, b) in self.terms.items():
            for two, (c, d) in other.terms.items():
                key = _times(one, two)
                re = a * c - b * d if b and d else a * c
                im = a * d + b * c
                old = terms.get(key)
                terms[key] = (re, im) if old is None else (old[0] + re, old[1] + im)
        return Expansion(self.ring, {k: v for k, v in terms.items() if v[0] or v[1]})

    def power(self, exponent: int) -> Expansion:
        """To a power of at least 0."""
        result = self.ring.number(1)
        for _ in range(exponent):
            result = result * self
        return result

    def derivative(self, variable: int) -> Expansion:
        """By an angle or a scalar."""
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
        """A number with powers of scalars that all terms have, and the rest, which multiples have, too."""
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
        """By another one, where that leaves no remainder."""
        if not other.variables():
            return self * other.inverse()
        if not self or not other.variables() <= self.variables():
            return None if self else self
        variables = sorted(self.variables())
        self.ring.spend(len(self.terms) * len(other.terms))
        domain = polynomial_ring([f"x{i}" for i in variables], QQ_I)[0]
        shifts = [
            {i: min(dict(key).get(i, 0) for key in one.terms) for i in variables} for one in (self, other)
        ]
        top, bottom = (
            domain.from_dict(
                {
                    tuple(dict(key).get(i, 0) - shift[i] for i in variables): QQ_I(*map(QQ.convert, number))
                    for key, number in one.terms.items()
                }
            )
            for one, shift in zip((self, other), shifts, strict=True)
        )
        quotient, remainder = top.div(bottom)
        if remainder:
            return None
        terms = {}
        for powers, number in quotient.items():
            moved = [(i, n + shifts[0][i] - shifts[1][i]) for i, n in zip(variables, powers, strict=True)]
            parts = [Fraction(int(part.numerator), int(part.denominator)) for part in (number.x, number.y)]
            terms[tuple((i, n) for i, n in moved if n)] = (parts[0], parts[1])
        return Expansion(self.ring, terms)

    def at_sample(self) -> float:
        """The value at `Ring.sample`."""
        ring, total = self.ring, 0.0
        for key, (re, im) in self.terms.items():
            angle = sum(n * ring.sample[i] for i, n in key if ring.is_angle[i])
            size = math.prod(ring.sample[i] ** n for i, n in key if not ring.is_angle[i])
            total += size * (float(re) * math.cos(angle) - float(im) * math.sin(angle))
        return total

    def variables(self) -> set[int]:
        """Those that occur."""
        return {i for key in self.terms for i, _ in key}

    def without(self, variables: set[int]) -> Expansion:
        """The terms in which none of the variables occurs: with scalars set to 0, or averaged over angles."""
        kept = {k: v for k, v in self.terms.items() if not any(i in variables for i, _ in k)}
        return Expansion(self.ring, kept)


def _times(one: Key, two: Key) -> Key:
    if not one or not two:
        return one or two
    powers = dict(one)
    for i, n in two:
        total = powers.get(i, 0) + n
        if total:
            powers[i] = total
        else:
            del powers[i]
    return tuple(sorted(powers.items()))


def exact(value: float) -> Fraction:
    """The shortest decimal fraction that is this float, without the dust of its last digits."""
    near = Fraction(value).limit_denominator(1_000_000)
    return near if abs(float(near) - value) < 1e-15 * max(1.0, abs(value)) else Fraction(repr(value))


def maximal_minors(rows: list[list[Expansion]]) -> dict[tuple[int, ...], Expansion]:
    """Of a matrix (s, m), s <= m, by their columns: along the first row, each smaller minor made once."""
    ring = rows[0][0].ring
    below: dict[tuple[int, ...], Expansion] = {(): ring.number(1)}
    for size, row in enumerate(reversed(rows), 1):
        found = {}
        for columns in itertools.combinations(range(len(row)), size):
            total = ring.number(0)
            for i, j in enumerate(columns):
                minor = below[columns[:i] + columns[i + 1 :]]
                if row[j] and minor:
                    product = row[j] * minor
                    total = total - product if i % 2 else total + product
            found[columns] = total
        below = found
    return below
