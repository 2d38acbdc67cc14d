"""Factors of a trigonometric polynomial, exactly.

With t = tan(φ/2) a trigonometric polynomial becomes a polynomial with rational coefficients, which SymPy
factors. Factors of odd degree in some t (half angles) are joined in pairs, so that all are trigonometric
polynomials in whole angles again. The product is multiplied out and compared in the end.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import sympy
from sympy.polys.rings import ring as polynomial_ring

from nmm.analysis.formulas.expansion import Expansion, Key, Ring, TooLarge
from nmm.analysis.formulas.fewest_angles import basis_of
from nmm.analysis.formulas.half_angles import to_tangents, to_waves
from nmm.analysis.formulas.polynomial_factors import polynomial_factors

#: The largest polynomial that is given to SymPy: its terms.
_LARGEST = 20_000


def factors_of(value: Expansion) -> tuple[Fraction, Key, list[tuple[Expansion, int]]]:
    """A number, powers of scalars, and factors with their powers, whose product is the value.

    Raises
    ------
    TooLarge : the polynomial in the half angles' tangents has too many terms
    """
    common, rest = value.split()
    ((scalars, (size, _)),) = common.terms.items()
    found = _polynomial_factors(rest)
    product = value.ring.number(1)
    for factor, power in found:
        product = product * factor.power(power)
    number = _ratio(rest, product)
    if number is None:  # never seen; the value itself is always right
        found, number = [(rest, 1)], Fraction(1)
    return size * number, scalars, found


def _ratio(value: Expansion, product: Expansion) -> Fraction | None:
    """value / product where that is a number."""
    if not product:
        return None
    key = next(iter(product.terms))
    if key not in value.terms:
        return None
    part = 0 if product.terms[key][0] else 1
    number = value.terms[key][part] / product.terms[key][part]
    return number if product.scaled(number) == value else None


def _polynomial_factors(value: Expansion) -> list[tuple[Expansion, int]]:
    """Factors up to a number, none of them one."""
    ring = value.ring
    angles = sorted(i for i in value.variables() if ring.is_angle[i])
    scalars = sorted(i for i in value.variables() if not ring.is_angle[i])
    combinations = [tuple(dict(key).get(i, 0) for i in angles) for key in value.terms]
    basis, seen = basis_of(combinations, len(angles))
    degrees = [max((abs(k[j]) for k in seen), default=0) for j in range(len(basis))]
    size = math.prod(2 * degree + 1 for degree in degrees)
    size *= len({tuple((i, n) for i, n in key if i in scalars) for key in value.terms})
    if size > _LARGEST:
        raise TooLarge(
            f"formulas too long to be read ({len(angles)} angles and {len(scalars)} lengths in one: up to "
            f"{size} terms in half angles, limit {_LARGEST})"
        )
    ring.spend(size)
    if not angles and not scalars:
        return []
    generators = [f"t{j}" for j in range(len(basis))] + [f"a{j}" for j in range(len(scalars))]
    domain, *_ = polynomial_ring(generators, sympy.QQ)
    waves = {
        (*k, *(dict(key).get(i, 0) for i in scalars)): coefficient
        for (key, coefficient), k in zip(value.terms.items(), seen, strict=True)
    }
    total = domain.from_dict(
        {key: sympy.QQ(n.numerator, n.denominator) for key, n in to_tangents(waves, degrees).items()}
    )
    found = polynomial_factors(total, list(range(len(basis), len(generators))))
    forms: list[tuple[Any, tuple[int, ...]]] = []
    for polynomial, power in found:
        top = tuple(max(m[j] for m in polynomial.monoms()) for j in range(len(basis)))
        forms += [(polynomial, top)] * power
    # What the degrees lack of 2 m are factors cos(φ/2).
    for j, m in enumerate(degrees):
        lacking = 2 * m - sum(degree[j] for _, degree in forms)
        unit = tuple(int(i == j) for i in range(len(basis)))
        forms += [(domain.one, unit)] * lacking
    back = _Back(ring, angles, scalars, basis)
    return _joined(forms, back)


class _Back:
    """From forms in half angles to trigonometric polynomials in the ring's angles."""

    def __init__(
        self, ring: Ring, angles: list[int], scalars: list[int], basis: list[tuple[int, ...]]
    ) -> None:
        self.ring = ring
        self.scalars = scalars
        self.angles = angles
        self.basis = basis

    def __call__(self, polynomial: Any, degree: tuple[int, ...]) -> Expansion:
        """The form, whose degrees are even: t^n of degree 2 m is sin^n cos^(2m-n) of the half angle."""
        powers = {
            monomial: Fraction(int(coefficient.numerator), int(coefficient.denominator))
            for monomial, coefficient in polynomial.terms()
        }
        terms = {}
        for exponents, coefficient in to_waves(powers, degree).items():
            key = dict(zip(self.scalars, exponents[len(degree) :], strict=True))
            for k, row in zip(exponents, self.basis, strict=False):
                for i, n in zip(self.angles, row, strict=True):
                    key[i] = key.get(i, 0) + k * n
            terms[tuple(sorted((i, n) for i, n in key.items() if n))] = coefficient
        self.ring.spend(len(terms))
        return Expansion(self.ring, terms)


def _joined(forms: list[tuple[Any, tuple[int, ...]]], back: _Back) -> list[tuple[Expansion, int]]:
    """Forms of even degree, odd ones joined with one of the same parity whose product is shortest."""
    even: list[Expansion] = []
    odd: dict[tuple[int, ...], list[tuple[Any, tuple[int, ...]]]] = {}
    for polynomial, degree in forms:
        parity = tuple(d % 2 for d in degree)
        if any(parity):
            odd.setdefault(parity, []).append((polynomial, degree))
        else:
            even.append(back(polynomial, degree))
    left: list[tuple[Any, tuple[int, ...]]] = []
    for group in odd.values():
        while len(group) > 1:
            pairs = [
                (len(product.terms), i, j, product)
                for i in range(len(group))
                for j in range(i + 1, len(group))
                for product in [back(group[i][0] * group[j][0], _added(group[i][1], group[j][1]))]
            ]
            _, i, j, product = min(pairs, key=lambda pair: pair[:3])
            even.append(product)
            del group[j], group[i]
        left += group
    if left:  # parities that only cancel among three or more
        polynomial, degree = left[0]
        for other, more in left[1:]:
            polynomial, degree = polynomial * other, _added(degree, more)
        even.append(back(polynomial, degree))
    counted: list[tuple[Expansion, int]] = []
    for factor in even:
        if factor.variables():
            for i, (same, power) in enumerate(counted):
                if _ratio(factor, same) is not None:
                    counted[i] = (same, power + 1)
                    break
            else:
                counted.append((factor, 1))
    return counted


def _added(a: tuple[int, ...], b: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(x + y for x, y in zip(a, b, strict=True))
