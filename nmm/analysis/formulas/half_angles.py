"""Between waves e^{ikφ} and powers of t = tan(φ/2), one angle after the other, in whole numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache
from math import lcm
from typing import TypeAlias

#: Exponents: one an angle, then those of scalars.
Exponents: TypeAlias = tuple[int, ...]
#: Real and imaginary part.
Whole: TypeAlias = tuple[int, int]


def to_tangents(
    waves: Mapping[Exponents, tuple[Fraction, Fraction]], degrees: Sequence[int]
) -> dict[Exponents, Fraction]:
    """Σ c Π e^{i k_j φ_j} times Π (1 + t_j²)^m_j, by powers of t; |k_j| is at most degrees[j] = m_j.

    The sum is real: its waves come with their conjugates.
    """
    over = lcm(*(part.denominator for value in waves.values() for part in value))
    table = {key: (int(re * over), int(im * over)) for key, (re, im) in waves.items()}
    for j, m in enumerate(degrees):
        table = _transformed(table, j, {k: _tangents(k, m) for k in range(-m, m + 1)})
    return {key: Fraction(re, over) for key, (re, _) in table.items() if re}


def to_waves(
    powers: Mapping[Exponents, Fraction], degrees: Sequence[int]
) -> dict[Exponents, tuple[Fraction, Fraction]]:
    """Σ c Π sin^n_j cos^(d_j - n_j) of the half angles, d = degrees (even), by the waves' k."""
    over = lcm(*(number.denominator for number in powers.values()))
    table = {key: (int(number * over), 0) for key, number in powers.items()}
    for j, d in enumerate(degrees):
        table = _transformed(table, j, {n: _waves(n, d) for n in range(d + 1)})
    over *= 2 ** sum(degrees)
    return {key: (Fraction(re, over), Fraction(im, over)) for key, (re, im) in table.items() if re or im}


def _transformed(
    table: dict[Exponents, Whole], j: int, to: Mapping[int, Sequence[tuple[int, int, int]]]
) -> dict[Exponents, Whole]:
    """Each exponent j replaced by its sum of (exponent, real, imaginary part)."""
    found: dict[Exponents, Whole] = {}
    for key, (re, im) in table.items():
        before, after = key[:j], key[j + 1 :]
        for exponent, a, b in to[key[j]]:
            place = (*before, exponent, *after)
            x, y = found.get(place, (0, 0))
            found[place] = (x + re * a - im * b, y + re * b + im * a)
    return {key: value for key, value in found.items() if value[0] or value[1]}


@cache
def _tangents(k: int, m: int) -> list[tuple[int, int, int]]:
    """z^k (1 + t²)^m = (1 + i t)^(m+k) (1 - i t)^(m-k)."""
    found = {0: (1, 0)}
    for sign in (1,) * (m + k) + (-1,) * (m - k):
        found = _added(found, {n + 1: (-sign * im, sign * re) for n, (re, im) in found.items()})
    return [(n, re, im) for n, (re, im) in found.items() if re or im]


@cache
def _waves(n: int, d: int) -> list[tuple[int, int, int]]:
    """2^d times ((w - 1/w)/2i)^n ((w + 1/w)/2)^(d-n), w = e^{iφ/2}: only even powers of w are left."""
    found = {0: (1, 0)}
    for sign in (-1,) * n + (1,) * (d - n):
        up = {k + 1: value for k, value in found.items()}
        down = {k - 1: (sign * re, sign * im) for k, (re, im) in found.items()}
        found = _added(up, down)
    a, b = ((1, 0), (0, -1), (-1, 0), (0, 1))[n % 4]  # 1/i^n
    return [(k // 2, re * a - im * b, re * b + im * a) for k, (re, im) in found.items() if re or im]


def _added(one: dict[int, Whole], two: dict[int, Whole]) -> dict[int, Whole]:
    found = dict(one)
    for key, (re, im) in two.items():
        x, y = found.get(key, (0, 0))
        found[key] = (x + re, y + im)
    return found
