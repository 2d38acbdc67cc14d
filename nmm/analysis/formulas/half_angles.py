"""Between waves z^k, z = e^{iφ}, and powers of t = tan(φ/2), in whole numbers: z = (1 + i t)/(1 - i t)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache
from math import lcm
from typing import TypeAlias

#: Exponents: one an angle, then those of scalars.
Exponents: TypeAlias = tuple[int, ...]
#: Real and imaginary part.
Gaussian: TypeAlias = tuple[Fraction, Fraction]
Whole: TypeAlias = tuple[int, int]


def to_tangents(waves: Mapping[Exponents, Gaussian], degrees: Sequence[int]) -> dict[Exponents, Fraction]:
    """Σ c Π e^{i k_j φ_j} times Π (1 + t_j²)^m_j, by powers of t; |k_j| is at most degrees[j] = m_j.

    The sum is real: its waves come with their conjugates.
    """
    shifted = {_shifted(key, degrees): value for key, value in waves.items()}
    found = _replaced(shifted, [2 * m for m in degrees], ((1, 0), (0, 1)), ((1, 0), (0, -1)))
    return {key: re for key, (re, _) in found.items() if re}


def to_waves(powers: Mapping[Exponents, Fraction], degrees: Sequence[int]) -> dict[Exponents, Gaussian]:
    """Σ c Π sin^n_j cos^(d_j - n_j) of the half angles, d = degrees (even), by the waves' k.

    These are ((z - 1)/2i)^n ((z + 1)/2)^(d-n) / z^(d/2).
    """
    over = Fraction(1, 2 ** sum(degrees))
    given = {key: (number * over, Fraction(0)) for key, number in powers.items()}
    found = _replaced(given, degrees, ((0, 1), (0, -1)), ((1, 0), (1, 0)))
    return {_shifted(key, [-(d // 2) for d in degrees]): value for key, value in found.items()}


def _shifted(key: Exponents, by: Sequence[int]) -> Exponents:
    return (*(k + m for k, m in zip(key, by, strict=False)), *key[len(by) :])


def _replaced(
    given: Mapping[Exponents, Gaussian],
    degrees: Sequence[int],
    up: tuple[Whole, Whole],
    down: tuple[Whole, Whole],
) -> dict[Exponents, Gaussian]:
    """x_j^k replaced by up^k down^(d_j - k), polynomials (constant, slope), one variable after the other."""
    over = lcm(*(part.denominator for value in given.values() for part in value))
    table = {key: (int(re * over), int(im * over)) for key, (re, im) in given.items()}
    for j, d in enumerate(degrees):
        found: dict[Exponents, Whole] = {}
        for key, (re, im) in table.items():
            for n, (a, b) in enumerate(_product(key[j], d, up, down)):
                if a or b:
                    place = (*key[:j], n, *key[j + 1 :])
                    x, y = found.get(place, (0, 0))
                    found[place] = (x + re * a - im * b, y + re * b + im * a)
        table = {key: value for key, value in found.items() if value[0] or value[1]}
    return {key: (Fraction(re, over), Fraction(im, over)) for key, (re, im) in table.items()}


@cache
def _product(k: int, d: int, up: tuple[Whole, Whole], down: tuple[Whole, Whole]) -> list[Whole]:
    """Coefficients of up^k down^(d - k)."""
    found = [(1, 0)]
    for (a, b), (c, e) in [up] * k + [down] * (d - k):
        pairs = zip([*found, (0, 0)], [(0, 0), *found], strict=True)
        found = [(x * a - y * b + u * c - v * e, x * b + y * a + u * e + v * c) for (x, y), (u, v) in pairs]
    return found
