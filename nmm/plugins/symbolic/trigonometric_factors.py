"""Exact factors of a trigonometric polynomial: with t = tan(φ/2) it becomes a rational polynomial, which
FLINT factors. Factors of odd degree in some t (half angles) are joined in pairs, so that all are
trigonometric polynomials in whole angles. Their product is compared with the value in the end."""

import itertools
import math
import operator
from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from typing import Any

import flint

from nmm.plugins.symbolic.expansion import Expansion, Key, TooLarge, fraction, rational

#: Most terms of a polynomial that FLINT is given.
_LARGEST = 20_000
#: Whole factors of the angles in a wave, and other exponents.
Integers = tuple[int, ...]
#: A factor in the half angles' tangents, and its degree in each.
Form = tuple[Any, Integers]


def factors_of(value: Expansion) -> tuple[Fraction, Key, list[tuple[Expansion, int]]]:
    """Factorise into a number, powers of scalars, and factors with their powers."""
    common, rest = value.split()
    ((scalars, (size, _)),) = common.terms.items()
    factors = _polynomial_factors(rest) if rest.variables() else []
    product = value.ring.number(1)
    for factor, power in factors:
        product = product * factor.power(power)
    number = _ratio(rest, product)
    if number is None:  # never seen; the value itself is always right
        factors, number = [(rest, 1)], Fraction(1)
    return size * number, scalars, factors


def _ratio(value: Expansion, product: Expansion) -> Fraction | None:
    """value / product where that is a number."""
    key = next(iter(product.terms))
    if key not in value.terms:
        return None
    part = 0 if product.terms[key][0] else 1
    number = value.terms[key][part] / product.terms[key][part]
    return number if product.scaled(number) == value else None


def _polynomial_factors(value: Expansion) -> list[tuple[Expansion, int]]:
    """Nonconstant factors with their powers, up to a number."""
    half_angles = HalfAngles(value)
    degrees = half_angles.degrees
    forms: list[Form] = []
    for polynomial, power in half_angles.polynomial(value).factor()[1]:
        degree = tuple(map(int, polynomial.degrees()[: len(degrees)]))
        forms += [(polynomial, degree)] * power
    # Degrees missing up to 2 m are factors cos(φ/2).
    for j, m in enumerate(degrees):
        unit = tuple(int(i == j) for i in range(len(degrees)))
        forms += [(half_angles.context.constant(1), unit)] * (2 * m - sum(degree[j] for _, degree in forms))
    counted: list[tuple[Expansion, int]] = []
    for factor in _joined(forms, half_angles):
        for i, (same, power) in enumerate(counted):
            if _ratio(factor, same) is not None:
                counted[i] = (same, power + 1)
                break
        else:
            counted.append((factor, 1))
    return counted


class HalfAngles:
    """Between waves z^k, z = e^{iφ}, and powers of t = tan(φ/2) = x / i: z = (1 + x)/(1 - x) and
    x = (z - 1)/(z + 1) are substitutions in rational polynomials. The polynomial is the value times
    Π (1 + t²)^degree, an angle's degree being its largest |k|; `TooLarge` if it would have too many terms."""

    def __init__(self, value: Expansion) -> None:
        self.ring = ring = value.ring
        self._angles = sorted(i for i in value.variables() if ring.is_angle[i])
        self._scalars = sorted(i for i in value.variables() if not ring.is_angle[i])
        waves = [tuple(dict(key).get(i, 0) for i in self._angles) for key in value.terms]
        self._basis, self._seen = basis_of(waves, len(self._angles))
        self.degrees = tuple(max(map(abs, column)) for column in zip(*self._seen, strict=True))
        size = math.prod(2 * degree + 1 for degree in self.degrees)
        size *= len({tuple((i, n) for i, n in key if not ring.is_angle[i]) for key in value.terms})
        if size > _LARGEST:
            raise TooLarge(
                f"formulas too long to be read ({len(self._angles)} angles and {len(self._scalars)} lengths "
                f"in one: up to {size} terms in half angles, limit {_LARGEST})"
            )
        ring.spend(size)
        names = [f"{kind}{j}" for kind in "xy" for j in range(len(self._basis))]
        scalars = [f"a{j}" for j in range(len(self._scalars))]
        self.context = flint.fmpq_mpoly_ctx.get(names[: len(self._basis)] + scalars, "lex")
        self._homogeneous = flint.fmpq_mpoly_ctx.get(names + scalars, "lex")

    def polynomial(self, value: Expansion) -> Any:
        count, gens, coefficients = len(self.degrees), self.context.gens(), {}
        x, lengths = gens[:count], gens[count:]
        for part in (0, 1):
            terms = {}
            for (key, number), wave in zip(value.terms.items(), self._seen, strict=True):
                up, down = map(operator.add, self.degrees, wave), map(operator.sub, self.degrees, wave)
                terms[*up, *down, *(dict(key).get(i, 0) for i in self._scalars)] = rational(number[part])
            form = self._homogeneous.from_dict(terms)
            form = form.compose(*(1 + gen for gen in x), *(1 - gen for gen in x), *lengths, ctx=self.context)
            for key, number in form.to_dict().items():
                n = int(sum(key[:count]))  # x^n is i^n t^n, and the sum is real
                if n % 2 == part:
                    coefficients[key] = number * (1, -1, -1, 1)[n % 4]
        return self.context.from_dict(coefficients)

    def waves(self, polynomial: Any, degree: Integers) -> Expansion:
        """A form of even degree as a trigonometric polynomial: t^n is sin^n cos^(degree-n) of the half angle,
        that is (z - 1)^n (z + 1)^(degree-n) / (i^n 2^degree z^(degree/2))."""
        count, gens = len(degree), self.context.gens()
        table: dict[Integers, list[Any]] = {}
        for part in (0, 1):
            terms = {}
            for exponents, number in polynomial.to_dict().items():
                powers = tuple(map(int, exponents[:count]))
                if sum(powers) % 2 == part:
                    sign = 1 if sum(powers) % 4 in (0, 3) else -1  # of i^-n, but for its i
                    terms[*powers, *map(operator.sub, degree, powers), *exponents[count:]] = number * sign
            form, z, scalars = self._homogeneous.from_dict(terms), gens[:count], gens[count:]
            form = form.compose(*(x - 1 for x in z), *(x + 1 for x in z), *scalars, ctx=self.context)
            for exponents, number in form.to_dict().items():
                table.setdefault(tuple(map(int, exponents)), [0, 0])[part] = number
        self.ring.spend(len(table))
        over, coefficients = Fraction(1, 2 ** sum(degree)), {}
        for exponents, (a, b) in table.items():
            key = dict(zip(self._scalars, exponents[len(degree) :], strict=True))
            for n, d, row in zip(exponents, degree, self._basis, strict=False):
                for i, k in zip(self._angles, row, strict=True):
                    key[i] = key.get(i, 0) + (n - d // 2) * k
            numbers = (fraction(a) * over, fraction(b) * over)
            coefficients[tuple(sorted((i, n) for i, n in key.items() if n))] = numbers
        return Expansion(self.ring, coefficients)


def basis_of(waves: Sequence[Integers], n: int) -> tuple[list[Integers], list[Integers]]:
    """Angles φ = B q, B integer, and the waves k = m B in them. B's rows can be completed to a unimodular
    matrix, so that q1 is among the angles of cos(2 q1), too."""
    columns = [list(column) for column in zip(*waves, strict=True)] if waves and n else []
    inverse = [[int(i == j) for j in range(n)] for i in range(n)]  # rows: the new angles
    rank = 0
    # Short waves first: they make the angles that a person would choose, and low degrees.
    for row in sorted(range(len(waves)), key=lambda i: sum(map(abs, waves[i]))):
        while True:
            busy = [j for j in range(rank, n) if columns[j][row]]
            if not busy:
                break
            pivot = min(busy, key=lambda j: abs(columns[j][row]))
            if len(busy) == 1:
                columns[rank], columns[pivot] = columns[pivot], columns[rank]
                inverse[rank], inverse[pivot] = inverse[pivot], inverse[rank]
                rank += 1
                break
            for j in busy:
                if j != pivot:
                    times = columns[j][row] // columns[pivot][row]
                    columns[j] = [a - times * b for a, b in zip(columns[j], columns[pivot], strict=True)]
                    inverse[pivot] = [a + times * b for a, b in zip(inverse[pivot], inverse[j], strict=True)]
    basis = [tuple(row) for row in inverse[:rank]]
    return basis, [tuple(columns[j][i] for j in range(rank)) for i in range(len(waves))]


def _joined(forms: list[Form], half_angles: HalfAngles) -> list[Expansion]:
    """Forms of even degree, odd ones joined with one of the same parity whose product is shortest."""
    even: list[Expansion] = []
    odd: dict[Integers, list[Form]] = {}
    for form in forms:
        parity = tuple(d % 2 for d in form[1])
        if any(parity):
            odd.setdefault(parity, []).append(form)
        else:
            even.append(half_angles.waves(*form))
    left: list[Form] = []
    for group in odd.values():
        while len(group) > 1:
            pairs = [
                (half_angles.waves(*_product(group[i], group[j])), i, j)
                for i, j in itertools.combinations(range(len(group)), 2)
            ]
            product, i, j = min(pairs, key=lambda pair: (len(pair[0].terms), *pair[1:]))
            even.append(product)
            del group[j], group[i]
        left += group
    if left:  # parities that only cancel among three or more
        even.append(half_angles.waves(*reduce(_product, left)))
    return [factor for factor in even if factor.variables()]


def _product(left: Form, right: Form) -> Form:
    return left[0] * right[0], tuple(a + b for a, b in zip(left[1], right[1], strict=True))
